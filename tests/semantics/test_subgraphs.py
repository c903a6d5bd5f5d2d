"""Boxes that change nothing, their activity, and iteration (rules G1-G4)."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

import hfg
from hfg.trace import NodeEnabled
from tests.semantics.nodes import (
    Countdown,
    Ear,
    Keep,
    Ringing,
    Send,
    Timed,
    add,
    drive,
    fail_on,
    forward,
    forward_async,
    numbers,
    of_kind,
    only_odd,
    run,
    scale,
    slow_numbers,
    traced,
)

# --- G1 ---


class Work(hfg.Subgraph):
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
        box: Any = graph.add(Nested(depth=depth - 1) if depth > 1 else Work())
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
    source, box, sink = graph.add(numbers(count=3)), graph.add(Work()), graph.add(Keep())
    graph.connect(source.out, box.value)  # its output leads nowhere, its slot and event neither
    report = run(graph, fast)
    assert report.nodes["work/times"].firings == 4
    assert list(report.edges) == ["numbers.out -> work/times.value"]
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
        return [story, tapped, graph["nested/nested/nested/work/ear"].heard]

    story, tapped, heard = drive(main)
    assert sorted(story) == [7, 8, 8]  # type: ignore[type-var]
    assert tapped == [2, 4, hfg.END]
    assert heard == [7, 8]


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


@pytest.mark.rule("G1")
def test_what_a_box_has_only_inside_is_refused_with_the_remedy() -> None:
    async def main() -> None:
        graph = hfg.Graph()
        box = graph.add(Work())
        async with hfg.running(graph) as run:
            with pytest.raises(hfg.errors.UsageError, match='"work.rang" is the event of a subgraph'):
                await run.trigger(box.rang, 1)
            with pytest.raises(hfg.errors.UsageError, match='"work" is a subgraph'):
                await run.wait_inputs(box)

    drive(main)


@pytest.mark.rule("G3")
def test_inner_ports_have_paths_and_parameters_are_promoted(fast: bool) -> None:
    graph = hfg.Graph()
    source, box, sink = graph.add(numbers(count=2)), graph.add(Nested(depth=3, factor=5)), graph.add(Keep())
    graph.connect(source.out, box.value)
    graph.connect(box.out, sink.value)
    assert graph["nested/nested/nested/work/times.out"].path == "nested/nested/nested/work/times.out"
    report = run(graph, fast)
    assert sink.values == [5, 10]
    assert "nested/nested/nested/work/times" in report.nodes


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


# --- G4 ---


class Each(hfg.Subgraph):
    """Adds, element by element."""

    iterate_over = ("a", "b")
    a = hfg.Input(int)
    b = hfg.Input(int)
    sums = hfg.Output(int)
    odd = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        node, odd = graph.add(add(), name="add"), graph.add(only_odd(), name="odd")
        graph.connect(self.a.inner, node.a)
        graph.connect(self.b.inner, node.b)
        graph.connect(node.out, self.sums.inner)
        graph.connect(node.out, odd.value)
        graph.connect(odd.out, self.odd.inner)


class Lists(hfg.Node):
    """Lists of these lengths."""

    lengths = hfg.Parameter((3,), type=tuple[int, ...])
    out = hfg.Output(list[int])
    left = hfg.State(factory=list)

    def setup(self) -> None:
        self.left = list(self.lengths)

    def process(self) -> list[int]:
        if not self.left:
            raise hfg.EndOfStream
        return list(range(1, self.left.pop(0) + 1))


def iterated(
    a: tuple[int, ...], b: tuple[int, ...], fast: bool, **options: Any
) -> tuple[list[Any], list[Any], hfg.Report]:
    graph = hfg.Graph()
    one, two, box = graph.add(Lists(lengths=a)), graph.add(Lists(lengths=b)), graph.add(Each(), **options)
    sums, odd = graph.add(Keep(), name="sums"), graph.add(Keep(), name="odds")
    graph.connect(one.out, box.a)
    graph.connect(two.out, box.b)
    graph.connect(box.sums, sums.value)
    graph.connect(box.odd, odd.value)
    report = run(graph, fast)
    return sums.values, odd.values, report


@pytest.mark.rule("G4")
def test_iteration_zips_its_inputs_and_gives_lists_without_the_silences(fast: bool) -> None:
    sums, odd, _ = iterated((3, 2), (3, 2), fast)
    assert sums == [[2, 4, 6], [2, 4]]
    assert odd == [[], []]


@pytest.mark.rule("G4", "X1")
def test_unequal_lengths_are_an_error_of_the_firing(fast: bool) -> None:
    with pytest.raises(hfg.errors.NodeError, match=r'node "each" failed in firing 1: .*"a" has 3, "b" has 2 elements'):
        iterated((3,), (2,), fast)
    sums, _, report = iterated((3, 1), (2, 1), fast, on_error="skip")
    assert sums == [[2]]
    assert report.nodes["each"].failed == 1


@pytest.mark.rule("G4")
def test_an_empty_collection_gives_empty_lists_without_running_the_inside(fast: bool) -> None:
    sums, odd, _ = iterated((0, 1), (0, 1), fast)
    assert (sums, odd) == ([[], [2]], [[], []])


class Repeats(hfg.Subgraph):
    """One input is iterated, the other repeats; feedback inside counts; asynchronous inside."""

    iterate_over = ("values",)
    values = hfg.Input(int)
    offset = hfg.Input(int)
    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        node, total, later = graph.add(add(), name="add"), graph.add(add(), name="total"), graph.add(forward_async())
        graph.connect(self.values.inner, node.a)
        graph.connect(self.offset.inner, node.b)
        graph.connect(node.out, later.value)
        graph.connect(later.out, total.a)
        graph.connect(total.out, total.b, initial=[0])
        graph.connect(total.out, self.out.inner)


@pytest.mark.rule("G4")
def test_other_inputs_repeat_and_feedback_inside_keeps_its_tokens(fast: bool) -> None:
    graph = hfg.Graph()
    values, offsets = graph.add(Lists(lengths=(3, 2))), graph.add(Tens())
    box, sink = graph.add(Repeats()), graph.add(Keep())
    graph.connect(values.out, box.values)
    graph.connect(offsets.out, box.offset)
    graph.connect(box.out, sink.value)
    run(graph, fast)
    assert sink.values == [[11, 23, 36], [57, 79]]


class Tens(hfg.Node):
    """10, 20."""

    out = hfg.Output(int)
    count = hfg.State(0)

    def process(self) -> int:
        if self.count == 2:
            raise hfg.EndOfStream
        self.count += 1
        return 10 * self.count


class Signals(hfg.Subgraph):
    """Events inside: each element to quiet before the next."""

    iterate_over = ("values",)
    values = hfg.Input(int)
    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        send, last = graph.add(Send(), name="send"), graph.add(forward_later_once(), name="last")
        graph.connect(self.values.inner, send.value)
        graph.connect(send.rang, last.value)
        graph.connect(last.out, self.out.inner)


@hfg.node
async def forward_later_once(value: int) -> int:
    """After a second."""
    await asyncio.sleep(1)
    return value


@pytest.mark.rule("G4")
def test_each_element_goes_to_quiet_before_the_next(fast: bool) -> None:
    graph = hfg.Graph()
    values, box, sink = graph.add(Lists(lengths=(3,))), graph.add(Signals()), graph.add(Timed())
    graph.connect(values.out, box.values)
    graph.connect(box.out, sink.value)
    run(graph, fast)
    assert sink.seen == [([1, 2, 3], 3)]


@pytest.mark.rule("G4", "X1")
def test_an_error_inside_an_iteration_names_the_inner_node(fast: bool) -> None:
    class Fails(hfg.Subgraph):
        iterate_over = ("values",)
        values = hfg.Input(int)
        out = hfg.Output(int)

        def build(self, graph: hfg.Graph) -> None:
            node = graph.add(fail_on(bad=2), name="inner")
            graph.connect(self.values.inner, node.value)
            graph.connect(node.out, self.out.inner)

    graph = hfg.Graph()
    values, box, sink = graph.add(Lists()), graph.add(Fails(), name="box"), graph.add(Keep())
    graph.connect(values.out, box.values)
    graph.connect(box.out, sink.value)
    with pytest.raises(hfg.errors.NodeError, match='node "box/inner" failed in firing 2'):
        run(graph, fast)


class RingsLists(hfg.Node):
    rang = hfg.Event(list[int])


@pytest.mark.rule("G4")
def test_active_edges_sources_and_signals_over_the_border_are_refused() -> None:
    graph = hfg.Graph()
    values, box = graph.add(Lists()), graph.add(Each())
    with pytest.raises(hfg.errors.ConnectionError, match="iterates"):
        graph.connect(values.out, box.a, active=True)
    with pytest.raises(hfg.errors.ConnectionError, match="iterates"):
        graph.connect(graph.add(RingsLists()).rang, box.a)

    class WithSource(hfg.Subgraph):
        iterate_over = ("values",)
        values = hfg.Input(int)

        def build(self, graph: hfg.Graph) -> None:
            graph.connect(self.values.inner, graph.add(Keep()).value)
            graph.add(numbers())

    graph = hfg.Graph()
    values, other = graph.add(Lists()), graph.add(WithSource())
    graph.connect(values.out, other.values)
    with pytest.raises(hfg.errors.CheckFailed, match=r"numbers"):
        run(graph)


class Box3(hfg.Subgraph):
    """A node that takes three seconds, and is set up in one."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        slow = graph.add(Slow3(), name="slow")
        graph.connect(self.value.inner, slow.value)
        graph.connect(slow.out, self.out.inner)


class Slow3(hfg.Node):
    value = hfg.Input(int)
    out = hfg.Output(int)
    story: list[tuple[str, float]] = []  # noqa: RUF012 - over setups

    async def setup(self) -> None:
        self.story.append(("setup", hfg.now()))
        await asyncio.sleep(1)

    async def process(self, value: int) -> int:
        await asyncio.sleep(3)
        self.story.append((f"{value} over", hfg.now()))
        return value


@pytest.mark.rule("F10", "F9")
@pytest.mark.parametrize("slot", ["enable", "reset"])
def test_a_node_starts_afresh_only_when_the_firing_under_way_is_over(slot: str, fast: bool) -> None:
    async def main() -> list[object]:
        graph = hfg.Graph()
        box, sink = graph.add(Box3()), graph.add(Keep())
        graph.connect(graph.input("in", int), box.value)
        graph.connect(box.out, sink.value)
        async with hfg.running(graph, fast=fast) as run, run.feed("in") as feed:
            sending = asyncio.create_task(feed.send(1))
            await asyncio.sleep(1)
            if slot == "enable":
                await run.trigger(box.disable)
            await run.trigger(box.ports.slots[slot])
            await asyncio.sleep(10)
            await sending
            await feed.send(2)
        return sink.values

    Slow3.story.clear()
    values = drive(main)
    assert values == ([2] if slot == "enable" else [1, 2])
    assert Slow3.story == [("setup", 0), ("1 over", 4), ("setup", 4), ("2 over", 15)]


class Many(hfg.Subgraph):
    """Thousands of nodes."""

    def build(self, graph: hfg.Graph) -> None:
        for _ in range(2_000):
            graph.add(Ear())


@pytest.mark.rule("F10")
def test_a_box_of_thousands_is_disabled_enabled_and_reset_without_a_deep_stack(fast: bool) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        box = graph.add(Many())
        async with hfg.running(graph, fast=fast) as run:
            for port in (box.disable, box.enable, box.reset):
                await run.trigger(port)
                await run.wait_quiet()

    drive(main)
