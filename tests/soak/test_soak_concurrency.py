"""Ten thousand firings, eight at once, all of it explained by the oracle, by `make soak` (rule F14)."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

import pytest

import hfg
from hfg.testing import replay
from hfg.trace import TraceEvent

REQUESTS = 10_000


@hfg.node
def numbers(*, count: int) -> Iterator[int]:
    yield from range(count)


@hfg.node
async def ask(value: int) -> int:
    """Answers after 80 ms or some more."""
    await asyncio.sleep(0.08 + (value * 7919 % 13) / 1000)
    return 2 * value


def asking(ordered: bool) -> hfg.Graph:
    graph = hfg.Graph("asking")
    source, node = graph.add(numbers(count=REQUESTS)), graph.add(ask(), concurrency=8, ordered=ordered)
    graph.connect(source.out, node.value)
    graph.connect(node.out, graph.output("out", int))
    return graph


@pytest.mark.soak
@pytest.mark.rule("F14", "R6")
@pytest.mark.parametrize("ordered", [True, False])
def test_ten_thousand_requests_go_by_the_rules(ordered: bool) -> None:
    trace: list[TraceEvent] = []
    report = hfg.run(asking(ordered), clock="virtual", trace=trace)
    values = report.outputs["out"]
    assert sorted(values) == [2 * number for number in range(REQUESTS)]
    assert (values == sorted(values)) is ordered
    assert report.nodes["ask"].most_under_way == 8
    replay(asking(ordered), trace)
