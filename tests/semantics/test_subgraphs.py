"""Boxes that change nothing (rules G1, G3)."""

from __future__ import annotations

import asyncio
from typing import Any, cast

import pytest

import hfg
from tests.semantics.nodes import (
    Countdown,
    Ear,
    Keep,
    Ringing,
    drive,
    numbers,
    run,
    scale,
    slow_numbers,
    traced,
)

# --- G1 ---


class Several(hfg.Subgraph):
    """Streams that meet at one output."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        for factor in (2, 3):
            times = graph.add(scale(factor=factor))
            graph.connect(self.value.inner, times.value)
            graph.connect(times.out, self.out.inner)


@pytest.mark.rule("G1", "P2")
def test_streams_converge_at_the_output_of_a_box_on_their_way_into_a_slot(fast: bool) -> None:
    graph = hfg.Graph()
    box, ear = graph.add(Several()), graph.add(Ear())
    graph.connect(graph.add(numbers(count=2)).out, box.value)
    graph.connect(box.out, ear.hear)
    run(graph, fast)
    assert sorted(ear.heard) == [2, 3, 4, 6]


@pytest.mark.rule("G1", "P2")
def test_streams_that_converge_in_a_box_do_not_reach_an_input() -> None:
    graph = hfg.Graph()
    box, sink = graph.add(Several()), graph.add(Keep())
    graph.connect(box.out, sink.value)
    assert "has an edge already" in graph.check()[0].what


class Works(hfg.Subgraph):
    """All four kinds of port as relays."""

    value = hfg.Input(int)
    call = hfg.slot(type=int)
    out = hfg.Output(int)
    rang = hfg.Event(int)
    factor = hfg.Parameter(2)

    def build(self, graph: hfg.Graph) -> None:
        times, ear = graph.add(scale(), name="times"), graph.add(Ear(), name="ear")
        graph.promote(self.factor, times.ports.parameters["factor"])
        graph.connect(self.value.inner, times.value)
        graph.connect(times.out, self.out.inner, active=True)
        graph.connect(self.call.inner, ear.hear)
        graph.connect(ear.passed, self.rang.inner)


def boxed(depth: int) -> hfg.Graph:
    """The same graph with the middle in so many boxes."""
    graph = hfg.Graph()
    source, rings = graph.add(numbers(count=5)), graph.add(Ringing(count=3))
    sink, last = graph.add(Keep(), name="sink"), graph.add(Keep(), name="last")
    if depth == 0:
        times, ear = graph.add(scale(factor=3)), graph.add(Ear())
        ports = (times.value, times.out, ear.hear, ear.passed)
    else:
        box: Any = graph.add(Nested(depth=depth, factor=3))
        ports = (box.value, box.out, box.call, box.rang)
    graph.connect(source.out, ports[0])
    graph.connect(ports[1], sink.value, active=True)
    graph.connect(rings.rang, ports[2], capacity=2)
    graph.connect(ports[3], last.value, capacity=1)
    return graph


class Nested(hfg.Subgraph):
    """A box in a box ..."""

    value = hfg.Input(int)
    call = hfg.slot(type=int)
    out = hfg.Output(int)
    rang = hfg.Event(int)
    factor = hfg.Parameter(2)
    depth = hfg.Parameter(1)

    def build(self, graph: hfg.Graph) -> None:
        depth = self.depth.value
        box: Any = graph.add(Nested(depth=depth - 1) if depth > 1 else Works())
        graph.promote(self.factor, box.ports.parameters["factor"])
        graph.connect(self.value.inner, box.value)
        graph.connect(box.out, self.out.inner, active=True)
        graph.connect(self.call.inner, box.call)
        graph.connect(box.rang, self.rang.inner)


@pytest.mark.rule("G1", "G3")
@pytest.mark.parametrize("depth", [1, 2, 5])
def test_grouping_nodes_into_boxes_changes_nothing_that_others_see(depth: int) -> None:
    def seen(graph: hfg.Graph) -> list[str]:
        trace = traced(graph)
        return [str(event) for event in trace if getattr(event, "node", "") in ("numbers", "ringing", "sink", "last")]

    assert seen(boxed(depth)) == seen(boxed(0))


@pytest.mark.rule("G1")
def test_an_outer_edge_and_the_inner_one_act_as_one_that_is_active_if_both_are(fast: bool) -> None:
    outcomes = []
    for inner in (False, True):
        for outer in (False, True):
            graph = hfg.Graph()
            box, ear = graph.add(OneEdge(is_active=inner)), graph.add(Ear(), name="ear")
            graph.start.activates(box.begin)
            graph.connect(box.rang, ear.hear, active=outer)
            outcomes.append(run(graph, fast).nodes["ear"].active)
    assert outcomes == [False, False, False, True]


class OneEdge(hfg.Subgraph):
    """Its inner edge is active or not."""

    begin = hfg.slot(type=object)
    rang = hfg.Event()
    is_active = hfg.Parameter(True)

    def build(self, graph: hfg.Graph) -> None:
        ear = graph.add(Ear(), name="inside")
        graph.connect(self.begin.inner, ear.poke, active=True)
        graph.connect(ear.poked, self.rang.inner, active=self.is_active.value)


@pytest.mark.rule("G1", "P5")
def test_of_two_joined_event_edges_the_outer_capacity_and_policy_hold(fast: bool) -> None:
    graph = hfg.Graph()
    source, box = graph.add(Bursts()), graph.add(Queued())
    edge = graph.connect(source.rang, box.value, capacity=3, overflow="drop_oldest")
    report = run(graph, fast)
    assert report.edges["bursts.rang -> queued/keep.value"].dropped == 7
    assert graph["queued/keep"].values == [8, 9, 10]
    assert edge.capacity == 3


class Bursts(hfg.Node):
    rang = hfg.Event(int)
    over = hfg.State(False)

    def process(self) -> None:
        if self.over:
            raise hfg.EndOfStream
        self.over = True
        for number in range(1, 11):
            self.rang.trigger(number)


class Queued(hfg.Subgraph):
    value = hfg.Input(int)

    def build(self, graph: hfg.Graph) -> None:
        graph.connect(self.value.inner, graph.add(Keep(), name="keep").value)


@pytest.mark.rule("G1", "P7")
def test_initial_tokens_add_up(fast: bool) -> None:
    graph = hfg.Graph()
    source, box = graph.add(Countdown(count=1)), graph.add(Delayed())
    graph.connect(source.out, box.value, initial=[3, 4])
    run(graph, fast)
    assert graph["delayed/keep"].values == [1, 2, 3, 4, 0]


class Delayed(hfg.Subgraph):
    value = hfg.Input(int)

    def build(self, graph: hfg.Graph) -> None:
        graph.connect(self.value.inner, graph.add(Keep(), name="keep").value, initial=[1, 2])


@pytest.mark.rule("G1")
def test_a_relay_without_an_edge_on_one_side_is_no_edge_at_all(fast: bool) -> None:
    graph = hfg.Graph()
    source, box, sink = graph.add(numbers(count=3)), graph.add(Works()), graph.add(Keep())
    graph.connect(source.out, box.value)  # its output leads nowhere, its slot and event neither
    report = run(graph, fast)
    assert report.nodes["works/times"].firings == 4
    assert list(report.edges) == ["numbers.out -> works/times.value"]
    assert sink.values == []


@pytest.mark.rule("G1", "R5", "F13")
def test_the_end_of_events_and_of_the_run_see_inner_nodes_only(fast: bool) -> None:
    graph = hfg.Graph()
    source, box = graph.add(Ringing(count=3)), graph.add(Queued())
    graph.connect(source.rang, box.value)
    report = run(graph, fast)
    assert report.outcome == "done"
    assert report.nodes["queued/keep"].ended
    assert list(report.nodes) == ["ringing", "queued/keep"]


@pytest.mark.rule("G1", "P10")
def test_from_outside_the_ports_of_a_box_stand_for_those_behind_them(fast: bool) -> None:
    async def main() -> list[object]:
        graph = hfg.Graph()
        source, box, sink = graph.add(slow_numbers(count=2)), graph.add(Nested(depth=3)), graph.add(Keep())
        graph.connect(source.out, box.value)
        graph.connect(box.out, sink.value)
        story: list[object] = []
        tapped: list[object] = []
        box.rang.subscribe(lambda token: story.append(token.value))
        async with hfg.running(graph, fast=fast) as run:
            await run.trigger(box.call, 7)
            waiting = asyncio.create_task(run.wait_for(box.rang))
            await asyncio.sleep(0)
            await run.trigger(box.call, 8)
            story.append((await waiting).value)

            async def look() -> None:
                tapped.extend([token.value async for token in run.tap(box.out)])

            looking = asyncio.create_task(look())
            await run.wait_finished()
            await looking
        return [story, tapped, graph["nested/nested/nested/works/ear"].heard]

    story, tapped, heard = drive(main)
    assert sorted(cast(list[int], story)) == [7, 8, 8]
    assert tapped == [2, 4, hfg.END]
    assert heard == [7, 8]


@pytest.mark.rule("G1")
def test_what_a_box_has_only_inside_is_refused_with_the_remedy() -> None:
    async def main() -> None:
        graph = hfg.Graph()
        box = graph.add(Works())
        async with hfg.running(graph) as run:
            with pytest.raises(hfg.errors.UsageError, match='"works.rang" is the event of a subgraph'):
                await run.trigger(box.rang, 1)
            with pytest.raises(hfg.errors.UsageError, match='"works" is a subgraph'):
                await run.wait_inputs(box)

    drive(main)


@pytest.mark.rule("G3")
def test_inner_ports_have_paths_and_parameters_are_promoted(fast: bool) -> None:
    graph = hfg.Graph()
    source, box, sink = graph.add(numbers(count=2)), graph.add(Nested(depth=3, factor=5)), graph.add(Keep())
    graph.connect(source.out, box.value)
    graph.connect(box.out, sink.value)
    assert graph["nested/nested/nested/works/times.out"].path == "nested/nested/nested/works/times.out"
    report = run(graph, fast)
    assert sink.values == [5, 10]
    assert "nested/nested/nested/works/times" in report.nodes


@pytest.mark.rule("G3", "P8")
def test_a_token_sets_a_promoted_parameter(fast: bool) -> None:
    graph = hfg.Graph()
    source, factors = graph.add(numbers(count=3)), graph.add(numbers(count=3))
    box, sink = graph.add(Nested(depth=2)), graph.add(Keep())
    graph.connect(source.out, box.value)
    graph.connect(factors.out, box.ports.parameters["factor"])
    graph.connect(box.out, sink.value)
    run(graph, fast)
    assert sink.values == [1, 4, 9]
