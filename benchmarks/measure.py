"""Fresh processes in turn, and what is written down of them.

A suite is a module with `CASES`; each case is measured by a process of its own, `runs` times, the cases in turn
(A B C A B C ...), so that a drift of the machine meets all of them. Knows nothing of what is measured.
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
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

__all__ = ["ROOT", "Case", "Record", "here", "machine", "measure", "one", "read", "versions", "write"]

Figures = float | dict[str, float]
ROOT = Path(__file__).resolve().parent.parent


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


def measure(name: str, runs: int, say: Callable[[str], None]) -> list[Record]:
    """Measure all cases of the suite."""
    suite = importlib.import_module(f"benchmarks.{name}")
    load = os.getloadavg()[0]
    found: dict[str, list[dict[str, float]]] = {case: [] for case in suite.CASES}
    for number in range(runs):
        for position, case in enumerate(suite.CASES):
            say(f"{name}: run {number + 1} of {runs}, case {position + 1} of {len(suite.CASES)}")
            found[case].append(one(name, case))
    loads = (round(load, 2), round(os.getloadavg()[0], 2))
    return [
        Record(
            suite=name,
            case=case,
            unit=suite.CASES[case].unit,
            size=suite.CASES[case].size,
            figures={key: [round(figures[key], 5) for figures in several] for key in several[0]},
            machine=machine(),
            versions=versions(*getattr(suite, "DISTRIBUTIONS", ())),
            load=loads,
        )
        for case, several in found.items()
    ]


def one(suite: str, case: str) -> dict[str, float]:
    """Measure one case in a fresh process.

    Raises:
      RuntimeError: the case failed; with what it said.
    """
    command = [sys.executable, "-m", "benchmarks", "--case", f"{suite}:{case}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300, cwd=ROOT)
    if done.returncode:
        raise RuntimeError(f"{suite}: {case} failed:\n{done.stdout}{done.stderr}")
    return dict(json.loads(done.stdout.strip().splitlines()[-1]))


def here(suite: str, case: str) -> dict[str, float]:
    """Measure one case in this process."""
    found = importlib.import_module(f"benchmarks.{suite}").CASES[case]
    figures = found.run(found.size)
    return figures if isinstance(figures, dict) else {"value": figures}


def machine() -> str:
    """What the figures were measured on."""
    cores = os.cpu_count()
    return f"{platform.system()} {platform.machine()}, {processor()}, {cores} cores, Python {platform.python_version()}"


def versions(*packages: str) -> dict[str, str]:
    """What the packages are at; one that runs from its sources has no version here."""
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
