"""Run the benchmarks: `python -m benchmarks [SUITE ...] [--rounds N] [--only REGEX] [--quick] [--json FOLDER]`.

Every case runs in a fresh process, several times, the cases in turn. The table shows the median and the spread,
(max - min) / median; `--json` writes one line per case with every single figure, the machine and the versions.
`python -m benchmarks.page` makes the tables of docs/speed.md from those lines. A suite with goals shows instead how far
each is reached; `--against DIR` gives it another checkout of hfg to measure in turn.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TypeVar

from benchmarks.goals import Goal, cases_of, verdicts
from benchmarks.measure import Record, here, machine, measure, write

SUITES = (
    "bench_alive",
    "bench_budgets",
    "bench_edits",
    "bench_files",
    "bench_kinds",
    "bench_live",
    "bench_missions",
    "bench_observers",
    "bench_robot",
    "bench_shape",
    "bench_start",
    "bench_threads",
    "bench_tuning",
    "bench_virtual_day",
)
OTHERS = ("bench_peers", "bench_goals", "bench_links", "bench_ros", "bench_studio", "bench_viewers")
T = TypeVar("T", str, Goal)


def main() -> int:
    """Run what was asked for and print the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "suites", nargs="*", default=SUITES, help=f"of {', '.join(SUITES + OTHERS)}; all but the last six by default"
    )
    parser.add_argument(
        "--runs", "--rounds", type=int, help="fresh processes per case; each suite has its own default, mostly 5"
    )
    parser.add_argument("--only", metavar="REGEX", help="the cases, or goals, in whose name this is found")
    parser.add_argument("--quick", action="store_true", help="at a tenth of the size: to see that it works")
    parser.add_argument("--against", type=Path, metavar="DIR", help="another checkout of hfg: only bench_goals uses it")
    parser.add_argument("--json", type=Path, metavar="FOLDER", help="write one line per case, a file per suite")
    parser.add_argument("--case", help=argparse.SUPPRESS)
    parser.add_argument("--size", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--engine", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.case:
        suite, _, case = arguments.case.partition(":")
        print(json.dumps(here(suite, case, arguments.size, arguments.engine)))
        return 0
    unknown = [name for name in arguments.suites if name not in SUITES + OTHERS]
    if unknown:
        parser.error(f"there is no suite {', '.join(unknown)}: there are {', '.join(SUITES + OTHERS)}")
    print(machine())
    for name in arguments.suites:
        suite = importlib.import_module(f"benchmarks.{name}")
        print(f"\n{name}: {(suite.__doc__ or '').splitlines()[0]}  (load {os.getloadavg()[0]:.2f})", flush=True)
        for line in getattr(suite, "MISSING", ()):
            print(f"  skipped: {line}")
        goals = chosen(getattr(suite, "GOALS", ()), arguments.only)
        shows_cases = not goals or getattr(suite, "SHOWS_CASES", False)
        wanted = [*cases_of(goals), *(chosen(suite.CASES, arguments.only) if shows_cases else [])]
        failed: dict[str, str] = {}
        records = measure(
            name,
            arguments.runs or getattr(suite, "RUNS", 5),
            progress,
            only=wanted,
            quick=arguments.quick,
            against=arguments.against and arguments.against.resolve(),
            failed=failed if goals else None,
        )
        progress("")
        if shows_cases:
            for record in records:
                print(row(record))
            for case, why in failed.items():
                print(f"  {case}: {why.strip().splitlines()[-1]}")
        if goals:
            print(verdicts(goals, records, {**suite.SKIPPED, **failed}))
        if arguments.json:
            write(arguments.json, records)
    return 0


def chosen(named: Iterable[T], pattern: str | None) -> list[T]:
    """Those in whose name the pattern is found."""
    return [one for one in named if re.search(pattern or "", getattr(one, "name", str(one)))]


def progress(text: str) -> None:
    """Say on a terminal what is going on."""
    if sys.stderr.isatty():
        print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)


def row(record: Record) -> str:
    """Median, spread and the single figures."""
    singles = " ".join(f"{value:.3g}" for value in record.values)
    return f"  {record.case:52} {record.median:9.3f} {record.unit:3}  spread {record.spread:5.0%}   [{singles}]"


if __name__ == "__main__":
    try:
        raise SystemExit(main())
    except RuntimeError as error:
        raise SystemExit(f"{error}") from None
    except KeyboardInterrupt:
        raise SystemExit(130) from None
