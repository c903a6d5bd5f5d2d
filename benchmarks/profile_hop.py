"""Where the time of a hop goes: the share of each part of the engine in a chain of ten functions.

A chain of ten runs for some seconds while py-spy, from another process, stops it some hundred times a second and notes
the line of Python it is at. That is the honest way here: cProfile would charge every call some 0.1 us where a whole hop
costs less than ten of them, and samplers inside the process see it only where the interpreter looks for signals. The
lines are sorted into parts by what stands in them. As a check the parts that can be taken out are measured alone, and
the hop with and without the sampler.

`python -m benchmarks.profile_hop [--json FOLDER]`; needs py-spy (`pip install py-spy`; on some systems more rights).
"""

from __future__ import annotations

import argparse
import linecache
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter, deque
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

from benchmarks.measure import ROOT, Record, machine, one, versions, write
from benchmarks.meters import Arrivals
from benchmarks.nodes import through
from benchmarks.ours import Kind, run
from hfg.token import Token

__all__ = ["PARTS", "Frame", "Part", "part_of", "shares", "stacks"]

LENGTH = 10
RATE_HZ = 400
SECONDS = 10
RUNS = 3


class Part(NamedTuple):
    """A part of the engine, and how its lines are known: the first part that fits a line has it."""

    name: str
    place: str
    """A regular expression for module and name of the innermost function."""
    line: str
    """One for the line's text."""


ANY = ""
_YOURS = "your function: its call and its return"
_TOKEN = "the token: making it, onto its edge and off it"
_CHECKS = "is there anything that is not ordinary?"
_BARRIER = "the receiver: has it everything now?"
_QUEUE = "the run queue: in, out, and the step's call"
_RELEASE = "release: what was taken is processed, up the chain"
_BOOKS = "books: who is at work, how often, stamps"
STEP = r"steps\..*step$"
PARTS = (
    Part(_YOURS, r"^(nodes|meters)\.", ANY),
    Part(_YOURS, STEP, r"process\(|next\(generator\)"),
    Part(_TOKEN, STEP, r"Token\(|\.sent = |given\.held =|taken\.token|^inputs\.missing = 1"),
    Part(_BARRIER, STEP, r"target_inputs|^if not missing|target\.(blocked|placed)|consider\("),
    Part(_CHECKS, STEP, r"special|silent_code|is None|is not None|type\(|^try:|calls|right"),
    Part("activity", STEP, r"activ|carries"),
    Part(_QUEUE, STEP, r"queued|push\(|^def step"),
    Part(_QUEUE, r"^engine\.Engine\._drain$|^agenda\.queue$", ANY),
    Part(_BARRIER, r"^agenda\.", ANY),
    Part(_RELEASE, STEP, r"held|sequential|only|outputs|release"),
    Part(_RELEASE, r"^releasing\.", ANY),
    Part(_BOOKS, STEP, r"firings|core\.current|stamp|busy"),
    Part(_BOOKS, r"(now|time)$", ANY),
)
REST = "the rest of the engine"


class Frame(NamedTuple):
    """Where a sample was: function, file and line."""

    function: str
    file: str
    line: int


def part_of(innermost: Frame, text: str) -> str:
    """The part that a sample belongs to."""
    place = f"{Path(innermost.file).stem}.{innermost.function}"
    for part in PARTS:
        if re.search(part.place, place) and re.search(part.line, text.strip()):
            return part.name
    return REST


def stacks(lines: Iterable[str]) -> Iterable[tuple[list[Frame], int]]:
    """Stacks, outermost first, and how often each was seen, from py-spy's raw form."""
    for line in lines:
        stack, _, count = line.rstrip().rpartition(" ")
        frames = [Frame(f[1], f[2], int(f[3])) for f in re.finditer(r"(?:^|;)([^;]*?) \(([^;()]*):(\d+)\)", stack)]
        if frames:
            yield frames, int(count)


def shares(lines: Iterable[str]) -> dict[str, float]:
    """The share of each part, in percent, of the samples that were taken while the engine was at work."""
    found: Counter[str] = Counter()
    for frames, count in stacks(lines):
        if any(frame.function == "Engine._drain" for frame in frames):
            innermost = frames[-1]
            found[part_of(innermost, linecache.getline(innermost.file, innermost.line))] += count
    total = found.total()
    if not total:
        raise RuntimeError("no sample met the engine at work: has Engine._drain another name now?")
    names = [*dict.fromkeys(part.name for part in PARTS), REST]
    return {name: 100 * found[name] / total for name in names}


def work(seconds: float) -> None:
    """Run the chain for about so long; prints microseconds a hop."""
    tokens = int(seconds * 1e6 / (LENGTH + 1) / 0.75)
    meter = Arrivals(tokens)
    run(Kind("function", through).chain_graph(LENGTH, tokens, meter))
    print(meter.figures(LENGTH + 1)["wall"])


def sampled(sampler: str, seconds: float) -> tuple[dict[str, float], float]:
    """Shares, and microseconds a hop under the sampler, of one fresh process."""
    with tempfile.TemporaryDirectory() as folder:
        raw = Path(folder) / "raw.txt"
        watch = [sampler, "record", "--rate", str(RATE_HZ), "--format", "raw", "--full-filenames", "--output", str(raw)]
        command = [sys.executable, "-m", "benchmarks.profile_hop", "--work", str(seconds)]
        done = subprocess.run([*watch, "--", *command], capture_output=True, text=True, check=False, cwd=ROOT)
        if done.returncode or not raw.exists():
            raise RuntimeError(f"py-spy could not watch the run:\n{done.stdout}{done.stderr}")
        hop = next(float(line) for line in done.stdout.splitlines() if re.fullmatch(r"\d+\.\d+", line.strip()))
        return shares(raw.read_text().splitlines()), hop


def alone(statement: Callable[[], object], repeat: int = 300_000) -> float:
    """Microseconds of a call, less those of one that does nothing; the least of several."""

    def loop(call: Callable[[], object]) -> float:
        began = perf_counter()
        for _ in range(repeat):
            call()
        return perf_counter() - began

    empty = min(loop(lambda: None) for _ in range(5))
    return (min(loop(statement) for _ in range(5)) - empty) / repeat * 1e6


def checks() -> dict[str, float]:
    """What can be measured by itself: microseconds."""
    function = through.function
    queue: deque[int] = deque()
    push, pop = queue.append, queue.popleft
    return {
        "a call of the function alone": alone(lambda: function(1)),
        "making a token alone": alone(lambda: Token(1, 0, 0.0, 1)),
        "into the queue and out of it alone": alone(lambda: (push(1), pop())),
    }


def gather(sampler: str, runs: int, seconds: float) -> list[Record]:
    """Everything that is on the page, from so many fresh processes."""
    load = os.getloadavg()[0]
    found: dict[tuple[str, str], list[float]] = {}
    for _ in range(runs):
        parts, hop = sampled(sampler, seconds)
        plain = one("bench_kinds", f"function | A{LENGTH}")["wall"]
        times = {"a hop": plain, "a hop, sampled": hop, **checks()}
        for unit, several in (("%", parts), ("us", times)):
            for name, value in several.items():
                found.setdefault((unit, name), []).append(round(value, 4))
    record = partial(
        Record,
        suite="profile_hop",
        size=int(seconds * RATE_HZ),
        machine=machine(),
        versions=versions("hfg", "py-spy"),
        load=(round(load, 2), round(os.getloadavg()[0], 2)),
    )
    return [record(case=name, unit=unit, figures={"value": values}) for (unit, name), values in found.items()]


def main() -> int:
    """Sample several fresh processes and print the table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.profile_hop", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("--runs", type=int, default=RUNS, help="fresh processes")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="how long each runs, about")
    parser.add_argument("--json", type=Path, metavar="FOLDER", help="write one line per part")
    parser.add_argument("--work", type=float, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.work:
        work(arguments.work)
        return 0
    beside = Path(sys.executable).with_name("py-spy")
    sampler = str(beside) if beside.exists() else shutil.which("py-spy")
    if sampler is None:
        print("profile_hop: skipped, py-spy is not installed (pip install py-spy)")
        return 0
    records = gather(sampler, arguments.runs, arguments.seconds)
    print(
        f"{machine()}\nprofile_hop: where the time of a hop goes, chain of {LENGTH}, {records[0].size:,} samples a run"
    )
    for found in records:
        singles = " ".join(f"{value:.3g}" for value in found.values)
        print(f"  {found.case:52} {found.median:9.3f} {found.unit:3} [{singles}]")
    if arguments.json:
        write(arguments.json, records)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
