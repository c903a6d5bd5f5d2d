"""Run the benchmarks: `python -m benchmarks [SUITE ...] [--runs N] [--json FOLDER]`.

Every case runs in a fresh process, several times, the cases in turn. The table shows the median and the spread,
(max - min) / median; `--json` writes one line per case with every single figure, the machine and the versions.
`python -m benchmarks.page` makes the tables of docs/speed.md from those lines.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import sys
from pathlib import Path

from benchmarks.measure import Record, here, machine, measure, write

SUITES = (
    "bench_edits",
    "bench_kinds",
    "bench_live",
    "bench_observers",
    "bench_shape",
    "bench_threads",
    "bench_virtual_day",
)
OTHERS = ("bench_peers",)


def main() -> int:
    """Run what was asked for and print the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "suites", nargs="*", default=SUITES, help=f"of {', '.join(SUITES + OTHERS)}; all but the last by default"
    )
    parser.add_argument("--runs", type=int, help="fresh processes per case; each suite has its own default, mostly 5")
    parser.add_argument("--json", type=Path, metavar="FOLDER", help="write one line per case, a file per suite")
    parser.add_argument("--case", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.case:
        print(json.dumps(here(*arguments.case.split(":", 1))))
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
        records = measure(name, arguments.runs or getattr(suite, "RUNS", 5), progress)
        progress("")
        for record in records:
            print(row(record))
        if arguments.json:
            write(arguments.json, records)
    return 0


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
