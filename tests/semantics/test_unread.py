"""A graph output that nobody reads holds the graph still, and the run says so (rule P10)."""

from __future__ import annotations

import asyncio
import logging
from typing import Any

import pytest

import hfg
from tests.semantics.nodes import drive, forward, numbers


def sending(count: int) -> hfg.Graph:
    graph = hfg.Graph()
    node = graph.add(forward())
    graph.connect(graph.add(numbers(count=count)).out, node.value)
    graph.connect(node.out, graph.output("values", int))
    return graph


def told(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]


@pytest.mark.rule("P10")
def test_a_run_that_an_unread_output_holds_says_so_once(caplog: pytest.LogCaptureFixture, fast: bool) -> None:
    async def main() -> list[Any]:
        async with hfg.running(sending(9), clock="virtual", fast=fast) as running:
            await running.wait_quiet()
            await running.wait_quiet()
            assert told(caplog) == [
                'graph output "values" is not read, and the graph stands still until it is: read it beside the rest, '
                '`async for value in run.read("values")`, or leave the output out'
            ]
            return [value async for value in running.read("values")]

    assert drive(main) == [*range(1, 10)]
    assert len(told(caplog)) == 1


@pytest.mark.rule("P10")
def test_a_feed_whose_token_is_held_by_it_is_told_of_too(caplog: pytest.LogCaptureFixture) -> None:
    graph = hfg.Graph()
    graph.connect(graph.input("in", int), graph.add(forward()).value)
    graph.connect(graph["forward"].out, graph.output("out", int))

    async def main() -> None:
        async with hfg.running(graph, clock="virtual") as running:
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(5), running.feed("in") as feed:
                    await feed.send(1)

    drive(main)
    assert len(told(caplog)) == 1
    assert 'graph output "out" is not read' in told(caplog)[0]


@pytest.mark.rule("P10")
def test_one_that_holds_nobody_or_is_read_is_not(caplog: pytest.LogCaptureFixture) -> None:
    async def main() -> None:
        async with hfg.running(sending(0), clock="virtual") as running:
            await running.wait_quiet()
        async with hfg.running(sending(3), clock="virtual") as running:
            values = running.read("values")
            assert await anext(values) == 1
            await running.wait_quiet()
            await values.aclose()  # type: ignore[attr-defined]

    drive(main)
    assert told(caplog) == []
