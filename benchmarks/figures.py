"""How figures are written, and the descriptions of the runs that they come from."""

from __future__ import annotations

import statistics
from collections.abc import Mapping

from benchmarks.measure import Record

__all__ = ["Records", "caption", "cell", "figure", "measured_on"]

MOST_DISTURBED = 1.2
MOST_LOAD = 2.0
WARNING = " **The machine was busy with something else: do not quote these.**"

Records = Mapping[str, Record]


def figure(value: float) -> str:
    """Three digits, as one writes them by hand."""
    if abs(value) >= 100:
        return f"{value:,.0f}"
    return f"{value:.1f}" if abs(value) >= 10 else f"{value:.2f}" if abs(value) >= 0.1 else f"{value:.3f}"


def cell(record: Record) -> str:
    """Median, in rounds also the 99th percentile, and the spread."""
    text = figure(record.median)
    if "p99" in record.figures:
        text += f" / {figure(statistics.median(record.figures['p99']))}"
    return f"{text} ({record.spread:.0%})"


def measured_on(record: Record) -> str:
    """The machine, the versions, and what else it had to do."""
    packages = ", ".join(f"{name} {version}" for name, version in record.versions.items())
    return f"{record.machine}; {packages}; load {record.load[0]:.1f} before and {record.load[1]:.1f} after"


def caption(records: Records) -> str:
    """The machine and versions of the measurement, and how far to trust the figures."""
    several = list(records.values())
    first = several[0]
    spreads = sorted(record.spread for record in several)
    ratios = [record.median / statistics.median(record.figures["cpu"]) for record in several if "cpu" in record.figures]
    disturbed = statistics.median(ratios) if ratios else 1.0
    clock = f"; the clock ran {disturbed:.2f} times the processor time" if ratios else ""
    busy = disturbed > MOST_DISTURBED or first.load[0] > MOST_LOAD
    return (
        f"*{measured_on(first)}{clock}; fresh processes per case: {len(first.values)}; "
        f"spread {statistics.median(spreads):.0%} in the median, {spreads[-1]:.0%} at worst.*"
    ) + (WARNING if busy else "")
