"""A real process is killed in the middle: no pair is torn, and what was lost is counted and reported (rule L2)."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator

import pytest

import hfg

pytestmark = pytest.mark.slow

pytest.importorskip("zenoh", reason="processes speak over Zenoh")

COUNT = 300
KILLED: set[int] = set()


@hfg.node
def numbers(*, count: int = COUNT) -> Iterator[int]:
    yield from range(count)


@hfg.node
def slowly(value: int) -> int:
    time.sleep(0.002)
    return value


@hfg.node
def whose(value: int) -> tuple[int, int]:
    return value, os.getpid()


@hfg.node
def strike(a: tuple[int, int], b: tuple[int, int]) -> tuple[int, int]:
    """Kill the process of one half of the fiftieth pair."""
    if a[0] >= 50 and not KILLED:
        KILLED.add(a[1])
        os.kill(a[1], signal.SIGKILL)
    return a[0], b[0]


@pytest.mark.rule("L2")
def test_a_process_that_is_killed_tears_no_pair_and_what_it_lost_is_reported() -> None:
    KILLED.clear()
    graph = hfg.Graph()
    graph.group("p", process=True)
    source, both = graph.add(numbers()), graph.add(strike())
    for name, port in (("safe", both.a), ("lossy", both.b)):
        first, last = graph.add(slowly(), name=name, group="p"), graph.add(whose(), name=f"{name}_last", group="p")
        graph.connect(source.out, first.value)
        graph.connect(first.out, last.value, active=name == "lossy", buffer=4)
        graph.connect(last.out, port)
    graph.connect(both.out, graph.output("out", tuple[int, int]))
    report = hfg.run(graph)
    found = report.outputs["out"]
    assert KILLED
    assert [one for one in found if one[0] != one[1]] == []
    lost = {label: edge.lost for label, edge in report.edges.items() if edge.lost}
    assert lost.keys() <= {"lossy_last.out -> strike.b"}
    assert sum(lost.values()) == COUNT - len(found)
    assert all(any(label in error and "lost with a process" in error for error in report.errors) for label in lost)
    assert any("restarted 1 times" in error for error in report.errors)
    assert any("up to 2 firings and slot calls in progress" in error for error in report.errors)
