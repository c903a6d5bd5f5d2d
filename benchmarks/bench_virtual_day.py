"""A day of virtual time: one 10 Hz source through a chain of three.

Measured: wall seconds for 864,000 tokens through a source with `max_rate_hz=10`, three functions and a sink under
  the virtual clock.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import hfg
from benchmarks.bench_hop import numbers, sink, through

UNIT = "s"
DAY_S = 86_400


def day() -> float:
    """Run the day."""
    graph = hfg.Graph("day")
    port = graph.add(numbers(count=10 * DAY_S + 10), max_rate_hz=10).out
    for _ in range(3):
        node = graph.add(through())
        graph.connect(port, node.ports.inputs["value"])
        port = node.out
    graph.connect(port, graph.add(sink()).ports.inputs["value"])
    began = time.perf_counter()
    report = hfg.run(graph, clock="virtual", until_s=DAY_S)
    took = time.perf_counter() - began
    assert report.duration_s == DAY_S, report.duration_s
    return took


CASES: dict[str, Callable[[], float]] = {"a day at 10 Hz": day}
