"""A day of virtual time: one 10 Hz source through a chain of three.

Measured: wall seconds for 864,000 tokens through a source with `max_rate_hz=10`, three functions and a sink under
  the virtual clock.
"""

from __future__ import annotations

import time
from math import isclose

import hfg
from benchmarks.measure import Case
from benchmarks.meters import Arrivals
from benchmarks.nodes import numbers, sink, through

DISTRIBUTIONS = ("hfg",)
RUNS = 3
DAY_S = 86_400
RATE_HZ = 10


def day(seconds: int) -> float:
    """Run it for `seconds` of virtual time."""
    graph = hfg.Graph("day")
    meter = Arrivals(RATE_HZ * seconds)
    port = graph.add(numbers(count=RATE_HZ * (seconds + 1)), max_rate_hz=RATE_HZ).out
    for _ in range(3):
        node = graph.add(through())
        graph.connect(port, node.ports.inputs["value"])
        port = node.out
    graph.connect(port, graph.add(sink(meter)).ports.inputs["value"])
    began = time.perf_counter()
    report = hfg.run(graph, clock="virtual", until_s=seconds)
    took = time.perf_counter() - began
    if not isclose(report.duration_s, seconds) or meter.count not in (meter.tokens, meter.tokens + 1):
        raise RuntimeError(f"{report.duration_s} s and {meter.count} tokens instead of {seconds} and {meter.tokens}")
    return took


CASES = {"a day at 10 Hz": Case(day, DAY_S, "s")}
