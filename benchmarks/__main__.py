"""Run the benchmarks: `python -m benchmarks [bench_hop ...] [--runs 5] [--json FILE]`.

Every case runs in a fresh process, `--runs` times, the cases in turn (A B C A B C ...) so that a drift of the
machine meets all of them. The table shows the median and the spread, (max - min) / median; `--json` writes one line
per case with every single figure, the machine and the versions.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import platform
import statistics
import subprocess
import sys
from pathlib import Path
from typing import Any

MODULES = ("bench_hop", "bench_shape", "bench_threads", "bench_virtual_day")


def main() -> int:
    """Run what was asked for and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("modules", nargs="*", default=MODULES, help="which, by module name; all by default")
    parser.add_argument("--runs", type=int, default=5, help="fresh processes per case")
    parser.add_argument("--json", type=Path, help="write one line per case")
    parser.add_argument("--case", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.case:
        module, case = arguments.case.split(":", 1)
        print(json.dumps(importlib.import_module(f"benchmarks.{module}").CASES[case]()))
        return 0
    print(machine())
    for name in arguments.modules:
        module = importlib.import_module(f"benchmarks.{name}")
        print(f"\n{name}: {(module.__doc__ or '').splitlines()[0]}")
        figures: dict[str, list[float]] = {case: [] for case in module.CASES}
        for _ in range(arguments.runs):
            for case in module.CASES:
                figures[case].append(one(name, case))
        unit = getattr(module, "UNIT", "us")
        for case, values in figures.items():
            print(row(case, values, unit))
        for line in getattr(module, "ratios", lambda _: [])(
            {case: statistics.median(values) for case, values in figures.items()}
        ):
            print("  " + line)
        if arguments.json:
            with arguments.json.open("a") as lines:
                for case, values in figures.items():
                    record: dict[str, Any] = {
                        "bench": name,
                        "case": case,
                        "unit": unit,
                        "values": values,
                        "machine": machine(),
                    }
                    lines.write(json.dumps(record) + "\n")
    return 0


def one(module: str, case: str) -> float:
    """One case in a fresh process."""
    command = [sys.executable, "-m", "benchmarks", "--case", f"{module}:{case}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{module}: {case} failed:\n{done.stderr}")
    return float(done.stdout.strip().splitlines()[-1])


def row(case: str, values: list[float], unit: str) -> str:
    """Median, spread and the single figures."""
    median = statistics.median(values)
    spread = (max(values) - min(values)) / median * 100
    singles = " ".join(f"{value:.3g}" for value in values)
    return f"  {case:48} {median:9.3f} {unit:3}  spread {spread:4.0f} %   [{singles}]"


def machine() -> str:
    """What the figures were measured on."""
    load = ", ".join(f"{value:.2f}" for value in os.getloadavg())
    return f"Python {platform.python_version()}, {platform.machine()}, {os.cpu_count()} cores, load {load}"


if __name__ == "__main__":
    raise SystemExit(main())
