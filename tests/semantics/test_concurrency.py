"""Several firings of one node under way at once (rule F14)."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import pytest

import hfg
from hfg import END, NO_MESSAGE
from hfg.engine.runtime import settings
from hfg.trace import (
    FiringEnded,
    FiringStarted,
    NodeEnded,
    ParameterSet,
    StructureChanged,
    TokenSent,
    TokenTaken,
    TraceEvent,
)
from tests.limits import patience
from tests.semantics.nodes import Ear, Keep, drive, gaps, numbers, of_kind, run, sent, traced


@hfg.node
async def ask(value: int, *, delays: tuple[float, ...] = (3.0, 1.0, 2.0)) -> int:
    """Answers after one of a few delays, in turn."""
    await asyncio.sleep(delays[value % len(delays)])
    return value


@hfg.node
async def at_once(value: int) -> int:
    """Never waits."""
    return value


def asking(node: hfg.Node, count: int = 6, **options: Any) -> tuple[hfg.Graph, Keep]:
    """A source, the node, and a sink that keeps what comes."""
    graph, sink = hfg.Graph(), Keep()
    source = graph.add(numbers(count=count))
    graph.add(node, name="node", **options)
    graph.connect(source.out, node.ports.inputs["value"])
    graph.connect(node.ports.outputs["out"], graph.add(sink).value)
    return graph, sink


def most_at_once(trace: list[TraceEvent], node: str = "node") -> int:
    """How many firings of a node were under way at once."""
    under_way = most = 0
    for event in trace:
        if isinstance(event, FiringStarted | FiringEnded) and event.node == node:
            under_way += 1 if isinstance(event, FiringStarted) else -1
            most = max(most, under_way)
    return most


# --- how many, and in which order ---


@pytest.mark.rule("F14", "F7")
def test_outputs_leave_in_the_order_in_which_the_firings_began(fast: bool) -> None:
    graph, sink = asking(ask(), concurrency=3)
    report = run(graph, fast)
    assert sink.values == [1, 2, 3, 4, 5, 6]
    assert report.duration_s == 6


@pytest.mark.rule("F14")
def test_unordered_outputs_leave_as_their_firings_are_over(fast: bool) -> None:
    graph, sink = asking(ask(delays=(1.0, 6.0, 4.0, 5.0, 2.0, 3.0)), concurrency=6, ordered=False)
    report = run(graph, fast)
    assert sink.values == [6, 4, 5, 2, 3, 1]
    assert report.duration_s == 6


@pytest.mark.rule("F14")
@pytest.mark.parametrize("ordered", [True, False])
@pytest.mark.parametrize("limit", [1, 2, 5, 100])
def test_no_more_firings_are_under_way_than_allowed(ordered: bool, limit: int, fast: bool) -> None:
    graph, _ = asking(ask(), 20, concurrency=limit, ordered=ordered)
    trace = traced(graph, fast=fast)
    assert most_at_once(trace) == min(limit, 21)  # the one that ends it is among them


@pytest.mark.rule("F14")
def test_what_is_over_and_waits_for_its_turn_counts(fast: bool) -> None:
    """The first takes long, so the second, over at once, keeps a third from beginning."""
    graph, _ = asking(ask(delays=(0.0, 10.0, 1.0)), 3, concurrency=2)
    began = [event.time for event in of_kind(traced(graph, fast=fast), FiringStarted) if event.node == "node"]
    assert began[:3] == [0, 0, 10]


@pytest.mark.rule("F14", "F1", "P4")
@pytest.mark.parametrize(("buffer", "takes"), [(0, 3 * (4 + 2 * 2)), (2, 4 + 6 * 2)])
def test_an_occupied_output_holds_back_what_begins_and_a_buffer_helps(buffer: int, takes: int, fast: bool) -> None:
    """The consumer takes two seconds each."""
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=6)), graph.add(ask(delays=(4.0,)), concurrency=2)
    slow, sink = graph.add(ask(delays=(2.0,)), name="slow"), graph.add(Keep())
    source >> node
    graph.connect(node.out, slow.value, buffer=buffer)
    slow >> sink
    report = run(graph, fast)
    assert sink.values == [1, 2, 3, 4, 5, 6]
    assert report.duration_s == takes


@pytest.mark.rule("F14", "F5")
def test_tokens_are_processed_as_they_are_taken(fast: bool) -> None:
    graph, _ = asking(ask(), 4, concurrency=5)
    trace = traced(graph, fast=fast)
    assert [event.time for event in of_kind(trace, TokenTaken) if event.edge == "numbers.out -> node.value"] == [0] * 5


@pytest.mark.rule("F14")
@pytest.mark.parametrize("ordered", [True, False])
def test_code_that_never_waits_is_over_before_the_next_begins(ordered: bool, fast: bool) -> None:
    graph, sink = asking(at_once(), 50, concurrency=8, ordered=ordered)
    trace = traced(graph, fast=fast)
    assert sink.values == list(range(1, 51))
    assert most_at_once(trace) == 1


@pytest.mark.slow
@pytest.mark.rule("F14", "F7")
@pytest.mark.parametrize("ordered", [True, False])
def test_ten_thousand_firings_in_virtual_time(ordered: bool, fast: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "CHECK_ALL", False)  # what holds after every step is seen by the other tests
    count, delays = 10_000, tuple(0.001 * (1 + 7 * k % 13) for k in range(13))
    graph, sink = asking(ask(delays=delays), count, concurrency=8, ordered=ordered)
    report = run(graph, fast)
    assert report.nodes["node"].most_under_way == 8
    assert sorted(sink.values) == list(range(1, count + 1))
    assert (sink.values == sorted(sink.values)) is ordered


# --- silence and the end ---


@pytest.mark.rule("F14", "F4")
@pytest.mark.parametrize("ordered", [True, False])
def test_a_silent_firing_is_over_at_once_and_waits_for_its_turn(ordered: bool, fast: bool) -> None:
    graph, sink = hfg.Graph(), Keep()
    source, node = graph.add(gaps()), graph.add(ask(delays=(2.0,)), name="node", concurrency=4, ordered=ordered)
    source >> node >> graph.add(sink)
    trace = traced(graph, fast=fast)
    values = sent(trace, "node.out -> keep.value")
    given = sent(trace, "gaps.out -> node.value")
    silences = given.count(NO_MESSAGE)
    assert silences
    if ordered:
        assert values == given
    else:
        assert values[:silences] == [NO_MESSAGE] * silences
    assert values[-1] is END


@pytest.mark.rule("F14", "F4")
@pytest.mark.parametrize("ordered", [True, False])
def test_end_leaves_behind_all_firings_and_so_does_what_the_hook_writes(ordered: bool, fast: bool) -> None:
    class Answers(hfg.Node):
        value = hfg.Input(int)
        out = hfg.Output(int)
        count = hfg.State(0)

        async def process(self, value: int) -> None:
            await asyncio.sleep(5 - value)
            self.count += 1
            self.out.send(value)

        def end(self) -> None:
            self.out.send(100 + self.count)

    graph, _ = asking(Answers(), 4, concurrency=4, ordered=ordered)
    trace = traced(graph, fast=fast)
    values = sent(trace, "node.out -> keep.value")
    assert values == [*((1, 2, 3, 4) if ordered else (4, 3, 2, 1)), 104, END]
    assert [event.node for event in of_kind(trace, NodeEnded)] == ["numbers", "node", "keep"]


@pytest.mark.rule("F14", "F2")
def test_a_source_ends_behind_its_firings(fast: bool) -> None:
    class Pages(hfg.Node):
        out = hfg.Output(int)
        page = hfg.State(0)

        async def process(self) -> int:
            self.page += 1
            page = self.page
            await asyncio.sleep(10 - page)
            if page > 5:
                raise hfg.EndOfStream
            return page

    graph, sink = hfg.Graph(), Keep()
    graph.add(Pages(), concurrency=4) >> graph.add(sink)
    report = run(graph, fast)
    assert report.outcome == "done"
    assert sink.values == [1, 2, 3, 4, 5]
    assert report.nodes["pages"].ended


# --- each firing by itself ---


@pytest.mark.rule("F14", "X1")
@pytest.mark.parametrize("ordered", [True, False])
def test_a_firing_that_fails_costs_only_its_own_answer(ordered: bool, fast: bool) -> None:
    @hfg.node
    async def fails(value: int) -> int:
        await asyncio.sleep(10 - value)
        if value == 3:
            raise ValueError("no answer")
        return value

    graph, sink = asking(fails(), 5, concurrency=5, ordered=ordered, on_error="skip")
    ear = graph.add(Ear())
    graph.connect(graph["node"].failed, ear.hear)
    report = run(graph, fast)
    assert sink.values == ([1, 2, 4, 5] if ordered else [5, 4, 2, 1])
    assert report.errors == ['node "node" failed in firing 3: ValueError: no answer']
    assert report.nodes["node"].failed == 1
    assert len(ear.heard) == 1


@pytest.mark.rule("F14", "X1")
def test_a_failure_ends_the_run_and_what_is_under_way(fast: bool) -> None:
    cancelled: list[int] = []

    @hfg.node
    async def fails(value: int) -> int:
        try:
            await asyncio.sleep(value)
        except asyncio.CancelledError:
            cancelled.append(value)
            raise
        raise ValueError("no answer")

    graph, _ = asking(fails(), 4, concurrency=4)
    with pytest.raises(hfg.errors.NodeError, match='node "node" failed in firing 1: ValueError: no answer'):
        run(graph, fast)
    assert cancelled == [2, 3, 4]


@pytest.mark.rule("F14", "X1", "F10")
def test_a_failure_that_disables_lets_the_others_be_finished_and_go_nowhere(fast: bool) -> None:
    finished: list[int] = []

    @hfg.node
    async def fails(value: int) -> int:
        await asyncio.sleep(value)
        if value == 2:
            raise ValueError("no answer")
        finished.append(value)
        return value

    graph, sink = asking(fails(), 8, concurrency=4, on_error="disable")
    trace: list[TraceEvent] = []
    report = run(graph, fast, trace=trace)
    assert report.outcome == "done"
    assert sink.values == [1]
    assert finished == [1, 3, 4, 5]
    ended = {event.number: event.outcome for event in of_kind(trace, FiringEnded) if event.node == "node"}
    assert ended == {1: "done", 2: "failed", 3: "abandoned", 4: "abandoned", 5: "abandoned"}


@pytest.mark.rule("F14", "X1")
def test_a_restart_waits_for_the_firings_under_way(fast: bool) -> None:
    class Fails(hfg.Node):
        async def setup(self) -> None:
            told.append(("setup", hfg.now()))

        async def process(self, value: int) -> int:
            await asyncio.sleep(value)
            if value == 2:
                raise ValueError("no answer")
            return value

        def teardown(self) -> None:
            told.append(("teardown", hfg.now()))

    told: list[tuple[str, float]] = []
    graph, sink = asking(Fails(), 6, concurrency=3, on_error="restart", restart_backoff_s=10)
    report = run(graph, fast)
    assert sink.values == [1, 3, 4, 5, 6]
    assert told == [("setup", 0), ("teardown", 5), ("setup", 15), ("teardown", 21)]
    assert report.nodes["node"].restarts == 1


@pytest.mark.rule("F14", "X2")
@pytest.mark.parametrize("ordered", [True, False])
def test_each_firing_has_its_own_time_limit(ordered: bool, fast: bool) -> None:
    graph, sink = asking(
        ask(delays=(1.0, 100.0, 2.0)), 6, concurrency=3, ordered=ordered, max_duration_s=5, on_error="skip"
    )
    report = run(graph, fast)
    assert sorted(sink.values) == [2, 3, 5, 6]
    assert report.errors == [
        f'node "node" failed in firing {number}: it took longer than max_duration_s = 5 s and was given up'
        for number in (1, 4)
    ]


@pytest.mark.rule("F14", "F10")
def test_disabling_lets_what_is_under_way_be_finished_and_enabling_starts_afresh(fast: bool) -> None:
    async def main() -> tuple[list[object], hfg.Report]:
        graph, sink = asking(ask(delays=(4.0,)), 9, concurrency=3)
        trace: list[TraceEvent] = []
        async with hfg.running(graph, fast=fast, trace=trace) as run:
            await asyncio.sleep(5)
            await run.trigger(graph["node"].disable)
            await asyncio.sleep(1)
            await run.trigger(graph["node"].enable)
            report = await run.wait_finished()
        ends = [event.outcome for event in of_kind(trace, FiringEnded) if event.node == "node"]
        assert ends.count("abandoned") == 3
        return sink.values, report

    values, report = drive(main)
    assert values[:3] == [1, 2, 3]
    assert values[3:] == []  # while it was disabled nobody waited for it, and the source has gone through
    assert report.outcome == "done"


@pytest.mark.rule("F14", "X3")
def test_stopping_cancels_all_of_them_before_the_teardown(fast: bool) -> None:
    told: list[str] = []

    class Waits(hfg.Node):
        async def process(self, value: int) -> None:
            try:
                await asyncio.Event().wait()
            finally:
                told.append(f"cancelled {value}")

        def teardown(self) -> None:
            told.append("teardown")

    async def main() -> None:
        graph = hfg.Graph()
        graph.add(numbers(count=3)) >> graph.add(Waits(), concurrency=2)
        async with hfg.running(graph, fast=fast):
            await asyncio.sleep(1)

    drive(main)
    assert told == ["cancelled 1", "cancelled 2", "teardown"]


# --- slots, parameters, events ---


class Desk(hfg.Node):
    """Answers questions, and is told things meanwhile."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    answered = hfg.Event(int)
    pause_s = hfg.Parameter(4.0)

    @hfg.slot
    async def tell(self, value: int) -> None:
        heard.append((hfg.now(), value))
        await asyncio.sleep(1)

    async def process(self, value: int) -> int:
        await asyncio.sleep(self.pause_s)
        self.answered.trigger(value)
        return value


heard: list[tuple[float, int]] = []


@pytest.mark.rule("F14", "F9")
def test_slot_calls_wait_for_no_firing_but_for_each_other(fast: bool) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        source, desk = graph.add(numbers(count=4)), graph.add(Desk(), concurrency=2)
        graph.connect(source.out, desk.value)
        async with hfg.running(graph, fast=fast) as run:
            await asyncio.sleep(0.5)
            await run.trigger(desk.tell, 1)
            await run.trigger(desk.tell, 2)
            await run.wait_finished()

    heard.clear()
    drive(main)
    assert heard == [(0.5, 1), (1.5, 2)]


@pytest.mark.rule("F14", "T5")
def test_signals_of_a_firing_carry_its_stamp(fast: bool) -> None:
    graph = hfg.Graph()
    source, desk = graph.add(numbers(count=3), max_rate_hz=1), graph.add(Desk(), concurrency=3)
    ear = graph.add(Ear())
    graph.connect(source.out, desk.value)
    graph.connect(desk.answered, ear.hear)
    trace = traced(graph, fast=fast)
    signals = [event for event in of_kind(trace, TokenSent) if event.edge == "desk.answered -> ear.hear"]
    assert [(event.time, event.token.stamp) for event in signals] == [(4, 0), (5, 1), (6, 2)]


@pytest.mark.rule("F14", "P8")
def test_a_parameter_is_set_for_the_firings_that_begin_from_then_on(fast: bool) -> None:
    async def main() -> tuple[list[object], list[float]]:
        graph, sink = asking(ask(delays=(8.0,)), 4, concurrency=2)
        trace: list[TraceEvent] = []
        async with hfg.running(graph, fast=fast, trace=trace) as run:
            await asyncio.sleep(1)
            run.set(graph["node"].ports.parameters["delays"], (1.0,))
            await run.wait_finished()
        assert [event.time for event in of_kind(trace, ParameterSet)] == [1]
        return sink.values, [event.time for event in of_kind(trace, FiringEnded) if event.node == "node"]

    values, ends = drive(main)
    assert values == [1, 2, 3, 4]
    assert ends[:4] == [8, 8, 9, 9]


@pytest.mark.rule("F14", "F3")
def test_each_firing_writes_its_own_outputs(fast: bool) -> None:
    class Both(hfg.Node):
        value = hfg.Input(int)
        first = hfg.Output(int)
        second = hfg.Output(int)

        async def process(self, value: int) -> None:
            self.first.send(value)
            await asyncio.sleep(5 - value)
            self.second.send(10 * value)

    graph = hfg.Graph()
    source, node, sinks = graph.add(numbers(count=4)), graph.add(Both(), concurrency=4), [Keep(), Keep()]
    graph.connect(source.out, node.value)
    graph.connect(node.first, graph.add(sinks[0]).value)
    graph.connect(node.second, graph.add(sinks[1]).value)
    run(graph, fast)
    assert [sink.values for sink in sinks] == [[1, 2, 3, 4], [10, 20, 30, 40]]


@pytest.mark.rule("F14", "F3")
def test_writing_twice_or_behind_the_end_of_a_firing_is_an_error(fast: bool) -> None:
    class Twice(hfg.Node):
        value = hfg.Input(int)
        out = hfg.Output(int)

        async def process(self, value: int) -> int:
            self.out.send(value)
            await asyncio.sleep(1)
            return value

    class Late(hfg.Node):
        value = hfg.Input(int)
        out = hfg.Output(int)

        async def process(self, value: int) -> None:
            async def later() -> None:
                await asyncio.sleep(5)
                with pytest.raises(hfg.errors.UsageError, match=r'"node.out" was written behind the end of its firing'):
                    self.out.send(value)
                refused.append(value)

            tasks.append(asyncio.create_task(later()))
            await asyncio.sleep(1 + value)

    graph, _ = asking(Twice(), 2, concurrency=2)
    with pytest.raises(hfg.errors.NodeError, match='output "node.out" was written twice in one firing'):
        run(graph, fast)
    tasks: list[asyncio.Task[None]] = []
    refused: list[int] = []
    graph, sink = asking(Late(), 3, concurrency=2)
    graph.add(numbers(count=10), name="clock", max_rate_hz=1) >> graph.add(Keep())  # the run goes on meanwhile
    run(graph, fast)
    assert refused == [1, 2, 3]
    assert sink.values == []


# --- threads ---


@pytest.mark.rule("F14", "R1")
@pytest.mark.parametrize("clock", ["virtual", "real"])
@pytest.mark.parametrize("ordered", [True, False])
def test_firings_of_one_node_share_the_threads_of_its_group(clock: Any, ordered: bool, fast: bool) -> None:
    """Each waits until all three have come, which they can only at the same time."""
    together = threading.Barrier(3, timeout=patience(10))
    names: set[str] = set()

    @hfg.node
    def meet(value: int) -> int:
        together.wait()
        names.add(threading.current_thread().name)
        return value

    graph, sink = asking(meet(), 12, concurrency=3, ordered=ordered, group="work")
    graph.group("work", threads=3)
    report = hfg.run(graph, clock=clock, fast=fast)
    assert report.nodes["node"].most_under_way == 3
    assert names == {"hfg group work", "hfg group work 2", "hfg group work 3"}
    assert sorted(sink.values) == list(range(1, 13))
    if ordered or clock == "virtual":
        assert sink.values == list(range(1, 13))


@pytest.mark.rule("R1")
def test_two_nodes_of_a_group_with_two_threads_run_at_once_and_none_beside_itself(fast: bool) -> None:
    together = threading.Barrier(2, timeout=patience(10))
    inside: list[object] = []

    def meet(name: str) -> Any:
        def process(value: int) -> None:
            assert name not in inside
            inside.append(name)
            together.wait()
            inside.remove(name)

        return hfg.node(process)

    graph = hfg.Graph()
    graph.group("work", threads=2)
    source = graph.add(numbers(count=5))
    for name in ("left", "right"):
        node = graph.add(meet(name)(), name=name, group="work")
        graph.connect(source.out, node.value)
    assert hfg.run(graph, fast=fast).nodes["right"].processed == 5


@pytest.mark.rule("F14", "X2")
def test_a_thread_that_does_not_come_back_costs_one_firing(fast: bool) -> None:
    stuck = threading.Event()

    @hfg.node
    def sometimes(value: int) -> int:
        if value == 2:
            stuck.wait(patience(30))
        return value

    graph, sink = asking(sometimes(), 6, concurrency=2, group="work", max_duration_s=0.05, on_error="skip")
    graph.group("work", threads=2)
    report = hfg.run(graph, fast=fast)
    stuck.set()
    assert sink.values == [1, 3, 4, 5, 6]
    assert report.errors == [
        'node "node" failed in firing 2: it took longer than max_duration_s = 0.05 s and was given up'
    ]


@pytest.mark.rule("F14", "F3")
def test_threads_write_each_to_its_own_firing_and_signals_come_before_the_result(fast: bool) -> None:
    class Says(hfg.Node):
        value = hfg.Input(int)
        out = hfg.Output(int)
        seen = hfg.Event(int)

        def process(self, value: int) -> None:
            self.out.send(value)
            self.seen.trigger(value)

    graph = hfg.Graph()
    graph.group("work", threads=4)
    source, node = graph.add(numbers(count=20)), graph.add(Says(), name="node", concurrency=4, group="work")
    sink, ear = graph.add(Keep()), graph.add(Ear())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    graph.connect(node.seen, ear.hear)
    trace = traced(graph, fast=fast)
    assert sink.values == list(range(1, 21))
    order = [event for event in of_kind(trace, TokenSent) if event.edge.startswith("node.")]
    for value in range(1, 21):
        first, second = [event.edge for event in order if event.token.value == value]
        assert (first, second) == ("node.seen -> ear.hear", "node.out -> keep.value")


# --- running ---


@pytest.mark.rule("F14", "R3")
def test_a_step_begins_one_firing_and_waits_for_its_end(fast: bool) -> None:
    async def main() -> None:
        graph, sink = asking(ask(delays=(3.0,)), 4, concurrency=2)
        async with hfg.running(graph, fast=fast) as run:
            run.pause()
            await run.step(graph["numbers"])
            began = hfg.now()
            assert (await run.step(graph["node"])).moved == ("node",)
            assert hfg.now() - began == 3
            assert (await run.step(graph["node"])).why_not.startswith('"node" waits for')
            run.resume()
            await run.wait_finished()
        assert sink.values == [1, 2, 3, 4]

    drive(main)


@pytest.mark.rule("F14", "R4")
def test_an_edit_waits_for_all_firings_of_the_nodes_it_touches(fast: bool) -> None:
    async def main() -> list[TraceEvent]:
        graph, _ = asking(ask(delays=(4.0,)), 6, concurrency=3)
        trace: list[TraceEvent] = []
        async with hfg.running(graph, fast=fast, trace=trace) as run:
            await asyncio.sleep(1)
            await run.edit(hfg.commands.Remove("keep"))
            await run.wait_finished()
        return trace

    trace = drive(main)
    assert [event.time for event in of_kind(trace, StructureChanged)] == [4]
    began = [event.time for event in of_kind(trace, FiringStarted) if event.node == "node"]
    assert began == [0, 0, 0, 4, 4, 4, 8]
    assert not [event for event in of_kind(trace, FiringEnded) if event.outcome == "failed"]


@pytest.mark.rule("F14", "F8", "R5")
def test_full_queues_hold_back_new_firings(fast: bool) -> None:
    graph = hfg.Graph()
    source, desk, slow = graph.add(numbers(count=12)), graph.add(Desk(pause_s=1.0), concurrency=4), graph.add(Slow())
    graph.connect(source.out, desk.value)
    graph.connect(desk.answered, slow.take, capacity=1)
    report = run(graph, fast)
    assert report.outcome == "done"
    assert report.nodes["slow"].calls == 12
    assert report.edges["desk.answered -> slow.take"].grown == 0


class Slow(hfg.Node):
    @hfg.slot
    async def take(self, value: int) -> None:
        await asyncio.sleep(3)


@pytest.mark.rule("F14", "F11")
def test_a_rate_holds_back_the_beginning_of_firings(fast: bool) -> None:
    graph, _ = asking(ask(delays=(3.0,)), 6, concurrency=4, max_rate_hz=2)
    trace = traced(graph, fast=fast)
    began = [event.time for event in of_kind(trace, FiringStarted) if event.node == "node" and event.kind == "process"]
    assert all(later - earlier >= 0.5 for earlier, later in pairwise(began))
    assert began[:4] == [0, 0.5, 1, 1.5]


@pytest.mark.rule("F14", "G4")
def test_a_node_inside_an_iteration_has_several_firings_too(fast: bool) -> None:
    class Each(hfg.Subgraph):
        items = hfg.Input(int)
        answers = hfg.Output(int)
        iterate_over = ("items",)

        def build(self, graph: hfg.Graph) -> None:
            burst, node = graph.add(Bursts()), graph.add(ask(delays=(2.0,)), concurrency=3)
            graph.connect(self.items.inner, burst.count)
            graph.connect(burst.one, node.value)
            graph.connect(node.out, self.answers.inner)

    @hfg.node
    def lists() -> Iterator[list[int]]:
        yield [2, 3]

    graph, sink = hfg.Graph(), Keep()
    box = graph.add(Each())
    graph.connect(graph.add(lists()).out, box.items)  # type: ignore[misc]  # whose elements go in
    graph.connect(box.answers, graph.add(sink).value)
    report = run(graph, fast)
    assert sink.values == [[0, 1, 0, 1, 2]]
    assert report.duration_s == 4


class Bursts(hfg.Node):
    """Gives out as many signals as it is told."""

    count = hfg.Input(int)
    one = hfg.Event(int)

    def process(self, count: int) -> None:
        for value in range(count):
            self.one.trigger(value)


@pytest.mark.rule("F14")
def test_statistics_say_how_many_are_under_way(fast: bool) -> None:
    async def main() -> None:
        graph, _ = asking(ask(delays=(1.0, 2.0, 4.0)), 9, concurrency=3)
        async with hfg.running(graph, fast=fast) as run:
            await asyncio.sleep(0.5)
            node = run.statistics().nodes["node"]
            assert (node.under_way, node.most_under_way, node.doing) == (3, 3, "working")
            assert [one.under_way for one in run.glance().nodes if one.path == "node"] == [3]
            report = await run.wait_finished()
        assert report.nodes["node"].most_under_way == 3
        assert run.statistics().nodes["node"].under_way == 0

    drive(main)
