"""Fresh processes in turn, and what is written down of them.

A suite is a module with `CASES`; each case is measured by a process of its own, `runs` times, the cases in turn
there and back (A B C C B A ...), so that a drift of the machine meets all of them. Knows nothing of what is measured.
"""

from __future__ import annotations

import importlib
import importlib.metadata
import json
import os
import platform
import re
import statistics
import subprocess
import sys
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

__all__ = ["BEFORE", "ROOT", "Case", "Record", "here", "machine", "measure", "one", "read", "versions", "write"]

Figures = float | dict[str, float]
ROOT = Path(__file__).resolve().parent.parent
BEFORE = "before: "
"""Stands in front of the name of a case that was measured with another checkout's hfg."""
QUICK = 10
LONGEST_S = 300


class Case(NamedTuple):
    """One thing to measure."""

    run: Callable[[int], Figures]
    """Gets the size; gives the figure, or several of which the first is the one that counts."""
    size: int
    unit: str = "us"


class Record(NamedTuple):
    """What several processes found for one case: a line of JSON."""

    suite: str
    case: str
    unit: str
    size: int
    figures: dict[str, list[float]]
    machine: str
    versions: dict[str, str]
    load: tuple[float, float]
    """The machine's load before and after the suite: what it did beside measuring."""

    @property
    def values(self) -> list[float]:
        """Every single figure."""
        return next(iter(self.figures.values()))

    @property
    def median(self) -> float:
        """The figure to quote."""
        return statistics.median(self.values)

    @property
    def spread(self) -> float:
        """(max - min) / median: how far to trust it."""
        return (max(self.values) - min(self.values)) / self.median if self.median else 0.0


def measure(
    name: str,
    runs: int,
    say: Callable[[str], None],
    *,
    only: Collection[str] | None = None,
    quick: bool = False,
    against: Path | None = None,
    failed: dict[str, str] | None = None,
) -> list[Record]:
    """Measure the cases of the suite.

    Args:
      name: of the suite's module.
      runs: how many fresh processes for each case.
      say: called with progress messages.
      only: these cases, by default all.
      quick: each at a tenth of its size.
      against: a checkout of hfg, with which the suite's `AGAINST` are measured too, as `before: ...`.
      failed: gets the cases that fail, and why; they are measured no further. Without it a failure is raised.

    Ctrl-C ends it early: the rounds that are complete count.
    """
    suite = importlib.import_module(f"benchmarks.{name}")
    load = os.getloadavg()[0]
    cases = {case: found for case, found in suite.CASES.items() if only is None or case in only}
    if quick:
        cases = {case: found._replace(size=max(2, found.size // QUICK)) for case, found in cases.items()}
    jobs: dict[str, tuple[str, Path | None]] = {}
    for case in cases:
        jobs[case] = (case, None)
        if against is not None and case in getattr(suite, "AGAINST", ()):
            jobs[BEFORE + case] = (case, against)
    found: dict[str, list[dict[str, float]]] = {job: [] for job in jobs}
    complete = 0
    try:
        for number in range(runs):
            for position, job in enumerate(list(found)[:: -1 if number % 2 else 1]):
                say(f"{name}: run {number + 1} of {runs}, case {position + 1} of {len(found)}: {job}")
                case, engine = jobs[job]
                try:
                    found[job].append(one(name, case, cases[case].size, engine))
                except RuntimeError as error:
                    if failed is None:
                        raise
                    failed[job] = str(error)
                    del found[job]
            complete = number + 1
    except KeyboardInterrupt:
        if not complete:
            raise
    found = {job: several[:complete] for job, several in found.items()}
    loads = (round(load, 2), round(os.getloadavg()[0], 2))
    return [
        Record(
            suite=name,
            case=job,
            unit=cases[jobs[job][0]].unit,
            size=cases[jobs[job][0]].size,
            figures={key: [round(figures[key], 5) for figures in several] for key in several[0]},
            machine=machine(),
            versions=versions(*getattr(suite, "DISTRIBUTIONS", ())),
            load=loads,
        )
        for job, several in found.items()
    ]


def one(suite: str, case: str, size: int | None = None, engine: Path | None = None) -> dict[str, float]:
    """Measure one case in a fresh process.

    Raises:
      RuntimeError: the case failed; with what it said.
    """
    command = [sys.executable, "-m", "benchmarks", "--case", f"{suite}:{case}"]
    if size is not None:
        command += ["--size", str(size)]
    if engine is not None:
        command += ["--engine", str(engine)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONGEST_S, cwd=ROOT)
    except subprocess.TimeoutExpired:
        raise RuntimeError(f"{suite}: {case} was not over after {LONGEST_S} s") from None
    if done.returncode:
        raise RuntimeError(f"{suite}: {case} failed:\n{done.stdout}{done.stderr}")
    return dict(json.loads(done.stdout.strip().splitlines()[-1]))


def here(suite: str, case: str, size: int | None = None, engine: Path | None = None) -> dict[str, float]:
    """Measure one case in this process, with the hfg of another checkout if one is given."""
    if engine is not None:
        use(engine)
    found = importlib.import_module(f"benchmarks.{suite}").CASES[case]
    figures = found.run(found.size if size is None else size)
    return figures if isinstance(figures, dict) else {"value": figures}


def use(checkout: Path) -> None:
    """Take hfg from this checkout, and the benchmarks from here: before anything has imported hfg."""
    sys.path[:0] = [str(checkout), str(checkout / "transports")]
    taken = Path(importlib.import_module("hfg").__file__ or "")
    if checkout.resolve() not in taken.resolve().parents:
        raise RuntimeError(f'there is no hfg in "{checkout}": {taken} would be measured in its place')


def machine() -> str:
    """The machine and versions of the measurement."""
    cores = os.cpu_count()
    return f"{platform.system()} {platform.machine()}, {processor()}, {cores} cores, Python {platform.python_version()}"


def versions(*packages: str) -> dict[str, str]:
    """Versions of the packages; one that runs from its sources has no version here."""
    found = {}
    for package in packages:
        with suppress(importlib.metadata.PackageNotFoundError):
            found[package] = importlib.metadata.version(package)
    return found


def processor() -> str:
    """The processor's name, where the system tells."""
    try:
        found = re.search(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    except OSError:
        found = None
    return found[1] if found else platform.processor() or "unknown processor"


def write(folder: Path, records: Iterable[Record]) -> None:
    """Write each suite's lines into its own file, in place of those of an earlier run."""
    folder.mkdir(parents=True, exist_ok=True)
    lines: dict[str, list[str]] = {}
    for record in records:
        lines.setdefault(record.suite, []).append(json.dumps(record._asdict()))
    for suite, several in lines.items():
        (folder / f"{suite}.jsonl").write_text("\n".join(several) + "\n", encoding="utf-8")


def read(lines: Iterable[str]) -> dict[str, dict[str, Record]]:
    """Suites, and in each its cases, from lines of JSON."""
    found: dict[str, dict[str, Record]] = {}
    for line in lines:
        raw: Mapping[str, Any] = json.loads(line)
        record = Record(**{**raw, "load": tuple(raw["load"])})
        found.setdefault(record.suite, {})[record.case] = record
    return found
