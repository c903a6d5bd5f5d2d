"""Where the time of a hop goes: the share of each part of the engine in a chain of ten functions.

A chain of ten runs for some seconds while py-spy, from another process, stops it some hundred times a second and
notes the line of Python it is at. That is the honest way here: cProfile would charge every call some 0.1 us where a
whole hop costs less than ten of them, and samplers inside the process see it only where the interpreter looks for
signals. The lines, those of the code that is written for a fused region too, are sorted into parts by what stands in
them. As a check the parts that can be taken out are measured alone, and the hop with and without the sampler.

`python -m benchmarks.profile_hop [--json FOLDER]`; needs py-spy (`pip install py-spy`; on some systems more rights).
"""

from __future__ import annotations

import argparse
import json
import linecache
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import NamedTuple

from benchmarks.measure import ROOT, Record, machine, one, versions, write
from benchmarks.meters import Arrivals
from benchmarks.nodes import through
from benchmarks.ours import Kind, run
from hfg.base.token import Token

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
_GUARD = "guards: is the result of the usual kind, has anything changed?"
_TURN = "behind a wave: may the next one follow?"
_BOOKS = "books: stamps, how often"
_QUEUE = "the run queue, and into the region and out of it"
WAVE = r"^.?hfg region.*\.wave$"
PARTS = (
    Part(_YOURS, r"^(nodes|meters)\.", ANY),
    Part(_YOURS, WAVE, r"= f\d+\(|next\(generator\)"),
    Part(_TURN, WAVE, r"stamp > until|^while|^continue"),
    Part(_BOOKS, WAVE, r"^stamp =|^done|^spread"),
    Part(_GUARD, WAVE, r"type\(v|flags|is not None|^else"),
    Part(_QUEUE, WAVE, ANY),
    Part(_QUEUE, r"^region\.|^engine\.Engine\._drain$|^agenda\.", ANY),
    Part("as interpreted: until a region is formed", r"^(specialise|firing|sending|releasing|sources)\.", ANY),
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


def shares(lines: Iterable[str], written: Mapping[str, Sequence[str]] | None = None) -> dict[str, float]:
    """The share of each part, in percent, of the samples that were taken while the engine was at work.

    Args:
      lines: of py-spy's raw form.
      written: the lines of code without a file: fused regions, by name.
    """
    texts = written or {}
    found: Counter[str] = Counter()
    for frames, count in stacks(lines):
        if any(frame.function == "Engine._drain" for frame in frames):
            innermost = frames[-1]
            text = texts.get(innermost.file)
            line = linecache.getline(innermost.file, innermost.line) if text is None else text[innermost.line - 1]
            found[part_of(innermost, line)] += count
    total = found.total()
    if not total:
        raise RuntimeError("no sample met the engine at work: has Engine._drain another name now?")
    names = [*dict.fromkeys(part.name for part in PARTS), REST]
    return {name: 100 * found[name] / total for name in names}


def work(seconds: float, into: Path) -> None:
    """Run the chain for about so long; prints microseconds a hop, and leaves the code of its regions in a file."""
    tokens = int(seconds * 1e6 / (LENGTH + 1) / 0.75)
    meter = Arrivals(tokens)
    run(Kind("function", through).chain_graph(LENGTH, tokens, meter))
    print(meter.figures(LENGTH + 1)["wall"])
    regions = [name for name in linecache.cache if "hfg region" in name]
    into.write_text(json.dumps({name: linecache.getlines(name) for name in regions}))


def sampled(sampler: str, seconds: float) -> tuple[dict[str, float], float]:
    """Shares, and microseconds a hop under the sampler, of one fresh process."""
    with tempfile.TemporaryDirectory() as folder:
        raw, regions = Path(folder) / "raw.txt", Path(folder) / "regions.json"
        watch = [sampler, "record", "--rate", str(RATE_HZ), "--format", "raw", "--full-filenames", "--output", str(raw)]
        command = [sys.executable, "-m", "benchmarks.profile_hop", "--work", str(seconds), "--regions", str(regions)]
        done = subprocess.run([*watch, "--", *command], capture_output=True, text=True, check=False, cwd=ROOT)
        if done.returncode or not raw.exists():
            raise RuntimeError(f"py-spy could not watch the run:\n{done.stdout}{done.stderr}")
        hop = next(float(line) for line in done.stdout.splitlines() if re.fullmatch(r"\d+\.\d+", line.strip()))
        return shares(raw.read_text().splitlines(), json.loads(regions.read_text())), hop


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
    parser.add_argument("--regions", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.work:
        work(arguments.work, arguments.regions)
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
