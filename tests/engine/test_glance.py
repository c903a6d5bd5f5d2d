"""A glance says what statistics say, and `begin=` is early enough to see everything."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Literal

import pytest

import hfg
from hfg.engine import Glance, MonitorGlance
from hfg.trace import RunStarted, TraceEvent


@hfg.node
def numbers() -> Iterator[int]:
    yield from range(10)


@hfg.node
def halved(number: int) -> int:
    if number == 7:
        raise ValueError(number)
    return number // 2


@hfg.node
async def slowly(number: int) -> None:
    await asyncio.sleep(0.3)


class Box(hfg.Subgraph):
    number = hfg.Input(int)

    def build(self, graph: hfg.Graph) -> None:
        graph.connect(self.number.inner, graph.add(halved(), on_error="skip").ports.inputs["number"])


def build() -> hfg.Graph:
    graph = hfg.Graph("halves")
    graph.group("aside", threads=1)
    source, box = graph.add(numbers(), max_rate_hz=1), graph.add(Box(), group="aside")
    graph.connect(source.out, box.number)
    graph.start.activates(source.activate)
    return graph


@pytest.mark.rule("R7")
def test_a_glance_has_the_numbers_of_the_statistics() -> None:
    async def main() -> tuple[Glance, hfg.Statistics]:
        async with hfg.running(build(), clock="virtual") as run:
            first = run.glance()
            assert (first.outcome, first.duration_s, [node.failed for node in first.nodes]) == ("running", 0.0, [0, 0])
            await run.wait_finished()
            return run.glance(), run.statistics()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        seen, statistics = runner.run(main())
    assert (seen.graph, seen.outcome, seen.duration_s) == ("halves", "done", statistics.duration_s)
    assert [node.path for node in seen.nodes] == ["numbers", "box/halved"]
    for node in seen.nodes:
        told = statistics.nodes[node.path]
        assert (node.group, node.done, node.queued) == (told.group, told.firings + told.calls, told.queued)
        assert (node.failed, node.active, node.doing) == (told.failed, told.active, told.doing)


def test_a_paused_run_says_so() -> None:
    async def main() -> None:
        async with hfg.running(build(), clock="virtual") as run:
            run.pause()
            assert run.glance().outcome == "paused"

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())


def test_begin_is_called_before_anything_happens_and_the_rest_is_as_without() -> None:
    events: list[TraceEvent] = []

    def begin(run: hfg.Run) -> None:
        assert run.glance().duration_s == 0.0
        run.trace(events)

    report = hfg.run(build(), clock="virtual", begin=begin)
    assert isinstance(events[0], RunStarted)
    assert report == hfg.run(build(), clock="virtual")


def test_what_begin_raises_comes_out_and_nothing_was_set_up() -> None:
    def begin(run: hfg.Run) -> None:
        raise LookupError(run.graph.name)

    graph = build()
    with pytest.raises(LookupError, match="halves"):
        hfg.run(graph, clock="virtual", begin=begin)
    assert hfg.run(graph, clock="virtual").outcome == "done"


def test_a_glance_tells_what_monitors_have_found_and_how_old_data_has_become() -> None:
    async def main() -> Glance:
        graph = hfg.Graph("late")
        slow = graph.add(slowly(), deadline_s=0.1)
        graph.connect(graph.add(numbers(), max_rate_hz=1).out, slow.number)
        graph.monitor("few", "never(sent(numbers.out, value > 2))")
        async with hfg.running(graph) as run:
            run.glance()
            await run.wait_finished()
            return run.glance()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        glance = runner.run(main())
    assert glance.monitors == [MonitorGlance("few", "violated", 1)]
    assert {node.path: (node.deadline_s, round(node.oldest_s, 6)) for node in glance.nodes} == {
        "numbers": (0.0, 0.0),
        "slowly": (0.1, 0.3),
    }


@pytest.mark.rule("R7")
@pytest.mark.parametrize("clock", ["real", "virtual"])
def test_after_a_run_a_glance_and_statistics_still_count_its_firings(clock: Literal["real", "virtual"]) -> None:
    runs: list[hfg.Run] = []
    graph = build()
    report = hfg.run(graph, clock=clock, begin=runs.append)
    assert {node.path for node in runs[0].glance().nodes} >= set(report.nodes) - {"box"}
    assert runs[0].statistics().firings == report.firings > 0
