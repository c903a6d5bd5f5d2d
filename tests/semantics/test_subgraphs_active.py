"""The activity of boxes; boxes disabled and enabled (rules G2, F10)."""

from __future__ import annotations

import asyncio

import pytest

import hfg
from hfg.testing.nodes import add
from hfg.trace import ActivityChanged, CallStarted, FiringEnded, NodeEnabled, TokenDrained
from tests.semantics.nodes import (
    Countdown,
    Ear,
    Keep,
    Timed,
    drive,
    forward,
    of_kind,
    run,
    slow_numbers,
    traced,
)

# --- G2 ---


class State(hfg.Subgraph):
    """A chain of two states: the first hands on, the second can give it out."""

    begin = hfg.slot(type=object)
    hand_on = hfg.slot(type=object)
    finish = hfg.slot(type=object)
    finished = hfg.Event()

    def build(self, graph: hfg.Graph) -> None:
        first, second = graph.add(Ear(), name="first"), graph.add(Ear(), name="second")
        graph.connect(self.begin.inner, first.begin, active=True)
        graph.connect(self.hand_on.inner, first.poke)
        graph.connect(first.poked, second.begin, active=True)
        graph.connect(self.finish.inner, second.poke)
        graph.connect(second.poked, self.finished.inner, active=True)


class Closed(State):
    """No activity gets in."""

    def build(self, graph: hfg.Graph) -> None:
        ear = graph.add(Ear(), name="first")
        graph.connect(self.begin.inner, ear.begin)
        graph.connect(self.hand_on.inner, ear.poke)
        graph.connect(self.finish.inner, ear.poke)


@pytest.mark.rule("G2", "A9")
def test_a_subgraph_is_active_while_something_inside_is(fast: bool) -> None:
    graph = hfg.Graph()
    box, up, down, ear = graph.add(State()), graph.add(Timed()), graph.add(Timed()), graph.add(Ear())
    graph.start.activates(box.begin)
    on, off = graph.add(slow_numbers(count=1, pause_s=1)), graph.add(slow_numbers(count=1, pause_s=2))
    graph.connect(on.out, box.hand_on)
    graph.connect(off.out, box.finish)
    graph.connect(box.activated, up.value)
    graph.connect(box.deactivated, down.value)
    graph.connect(box.finished, ear.begin, active=True)
    report = run(graph, fast)
    assert up.seen == [(None, 0)]
    assert down.seen == [(None, 2)]
    assert report.nodes["ear"].active


@pytest.mark.rule("G2", "F12")
def test_what_a_node_drains_as_it_ends_makes_the_subgraphs_around_it_active_at_once(fast: bool) -> None:
    """Activity leaves by `activated`, so the node inside never becomes active."""
    graph = hfg.Graph()
    box, ear, twice = graph.add(Pairs()), graph.add(Ear(), name="ear"), graph.add(Twice())
    graph.connect(graph.start, twice.begin)
    graph.connect(graph.add(slow_numbers(count=0, pause_s=1)).out, box.first)
    graph.connect(twice.said, box.second, active=True)
    box.activated.activates(ear.begin)
    trace = traced(graph, fast=fast)
    assert [(event.node, event.active) for event in of_kind(trace, ActivityChanged)] == [("ear", True)]
    kinds = [type(event) for event in trace if isinstance(event, TokenDrained | CallStarted | FiringEnded)]
    assert kinds[-3:] == [TokenDrained, FiringEnded, CallStarted]


class Pairs(hfg.Subgraph):
    """A node that takes two inputs together."""

    first, second = hfg.Input(int), hfg.Input(int)

    def build(self, graph: hfg.Graph) -> None:
        both = graph.add(add(), name="both")
        graph.connect(self.first.inner, both.a)
        graph.connect(self.second.inner, both.b, active=True)


class Twice(hfg.Node):
    """Says something twice, the second time with activity."""

    said = hfg.Event(int)

    @hfg.slot
    def begin(self) -> None:
        self.said.trigger(1)
        self.said.trigger(2, activity=1)


@pytest.mark.rule("G2")
def test_a_token_with_activity_on_an_inner_edge_keeps_the_subgraph_active(fast: bool) -> None:
    graph = hfg.Graph()
    box, down = graph.add(UnderWay()), graph.add(Timed())
    graph.start.activates(box.begin)
    graph.connect(box.deactivated, down.value)
    run(graph, fast)
    assert down.seen == []


class UnderWay(hfg.Subgraph):
    """Activity leaves a node and waits three seconds on an edge."""

    begin = hfg.slot(type=object)

    def build(self, graph: hfg.Graph) -> None:
        first, second = graph.add(Ear(), name="first"), graph.add(Busy(), name="second")
        graph.connect(self.begin.inner, second.wait)
        graph.connect(self.begin.inner, first.poke, active=True)
        graph.connect(first.poked, second.wait, active=True)


class Busy(hfg.Node):
    @hfg.slot
    async def wait(self) -> None:
        await asyncio.sleep(3)


@pytest.mark.rule("G2")
def test_activity_that_leaves_by_deactivated_or_timeout_is_taken_from_everything_inside(fast: bool) -> None:
    graph = hfg.Graph()
    box, ear = graph.add(State(), active_for_s=4), graph.add(Ear())
    graph.start.activates(box.begin)
    graph.connect(box.timeout, ear.begin, active=True)
    report = run(graph, fast)
    assert report.duration_s == 4
    assert [report.nodes[name].active for name in ("state/first", "state/second", "ear")] == [False, False, True]


@pytest.mark.rule("G2")
def test_activity_may_leave_by_activated_and_is_taken_from_the_inside(fast: bool) -> None:
    graph = hfg.Graph()
    box, ear, down = graph.add(State()), graph.add(Ear()), graph.add(Timed())
    graph.start.activates(box.begin)
    graph.connect(box.activated, ear.begin, active=True)
    graph.connect(box.deactivated, down.value)
    report = run(graph, fast)
    assert [report.nodes[name].active for name in ("state/first", "ear")] == [False, True]
    assert down.seen == [(None, 0)]


@pytest.mark.rule("G2")
def test_the_slot_deactivate_deactivates_everything_inside(fast: bool) -> None:
    graph = hfg.Graph()
    box, off = graph.add(State()), graph.add(slow_numbers(count=1, pause_s=1))
    down = graph.add(Timed())
    graph.start.activates(box.begin)
    graph.connect(off.out, box.deactivate)
    graph.connect(box.deactivated, down.value)
    report = run(graph, fast)
    assert down.seen == [(None, 1)]
    assert not report.nodes["state/first"].active


@pytest.mark.rule("G2")
def test_the_slot_deactivate_takes_activity_from_tokens_under_way_too(fast: bool) -> None:
    graph = hfg.Graph()
    box, off = graph.add(UnderWay()), graph.add(slow_numbers(count=1, pause_s=1))
    graph.start.activates(box.begin)
    graph.connect(off.out, box.deactivate)
    report = run(graph, fast)
    assert not report.nodes["under_way/second"].active


@pytest.mark.rule("G2")
def test_who_subscribes_to_the_activity_of_a_subgraph_hears_of_it(fast: bool) -> None:
    async def main() -> list[str]:
        graph = hfg.Graph()
        box = graph.add(State())
        story: list[str] = []
        box.activated.subscribe(lambda _: story.append("activated"))
        async with hfg.running(graph, fast=fast) as run:
            await run.trigger(box.begin, activity=1)
            await run.wait_quiet()
            box.deactivated.subscribe(lambda _: story.append("deactivated"))
            await run.trigger(box.deactivate)
            await run.wait_quiet()
        return story

    assert drive(main) == ["activated", "deactivated"]


@pytest.mark.rule("G2")
def test_a_subgraph_has_no_slot_activate() -> None:
    box = hfg.Graph().add(State())
    with pytest.raises(hfg.errors.UsageError, match='has no slot "activate"'):
        _ = box.ports.slots["activate"]


@pytest.mark.rule("G2", "F10")
def test_disabling_a_subgraph_disables_its_nodes_and_keeps_their_flags(fast: bool) -> None:
    async def main() -> list[object]:
        graph = hfg.Graph()
        box, sink = graph.add(Switched()), graph.add(Keep())
        graph.connect(graph.input("in", int), box.value)
        graph.connect(box.out, sink.value)
        graph.start.activates(box.begin)
        story: list[object] = []
        async with hfg.running(graph, fast=fast) as run, run.feed("in") as feed:
            await feed.send(1)
            await run.trigger(box.disable)
            await run.wait_quiet()
            await feed.send(2)
            story += [list(sink.values), run.active()]
            await run.trigger(box.enable)
            await run.wait_quiet()
            await feed.send(3)
            story += [list(sink.values), run.active()]
        return story

    assert drive(main) == [[1], ["switched/ear"], [1, 3], ["switched/ear"]]


class Switched(hfg.Subgraph):
    value = hfg.Input(int)
    out = hfg.Output(int)
    begin = hfg.slot(type=object)

    def build(self, graph: hfg.Graph) -> None:
        node = graph.add(forward(), name="node")
        graph.connect(self.value.inner, node.value)
        graph.connect(node.out, self.out.inner)
        graph.connect(self.begin.inner, graph.add(Ear(), name="ear").begin, active=True)


@pytest.mark.rule("G2", "F10")
def test_a_node_disabled_itself_stays_so_when_its_box_is_enabled(fast: bool) -> None:
    async def main() -> list[object]:
        graph = hfg.Graph()
        box, sink = graph.add(Switched()), graph.add(Keep())
        node = graph["switched/node"]
        graph.connect(graph.input("in", int), box.value)
        graph.connect(box.out, sink.value)
        async with hfg.running(graph, fast=fast) as run, run.feed("in") as feed:
            for port in (node.disable, box.disable, box.enable):
                await run.trigger(port)
                await run.wait_quiet()
            await feed.send(1)
            await run.trigger(node.enable)
            await run.wait_quiet()
            await feed.send(2)
        return sink.values

    assert drive(main) == [2]


@pytest.mark.rule("G2", "R7")
def test_disabling_a_subgraph_is_traced_as_one() -> None:
    graph = hfg.Graph()
    source, box = graph.add(Countdown(count=1)), graph.add(Switched())
    graph.connect(source.out, box.disable)
    assert [(event.node, event.enabled) for event in of_kind(traced(graph), NodeEnabled)] == [("switched", False)]


@pytest.mark.rule("G1", "A4")
def test_activity_from_outside_gets_into_a_box_over_active_edges_only(fast: bool) -> None:
    async def main(box_type: type[State]) -> list[str]:
        graph = hfg.Graph()
        box = graph.add(box_type())
        async with hfg.running(graph, fast=fast) as run:
            await run.trigger(box.begin, activity=1)
            await run.trigger(box.hand_on, activity=1)
            await run.wait_quiet()
            return run.active()

    assert drive(lambda: main(State)) == ["state/second"]
    assert drive(lambda: main(Closed)) == []
