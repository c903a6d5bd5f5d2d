"""Nodes, events and runs end (rules F12, F13, R5)."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import pytest
from reactivex import operators

import hfg
from hfg import END
from hfg.testing import recorder, replay
from hfg.testing.nodes import Doubter
from hfg.trace import (
    ActivityChanged,
    ActivityLost,
    ErrorRaised,
    FiringEnded,
    NodeEnded,
    TokenDrained,
    TokenDropped,
    TokenSent,
    TraceEvent,
)
from tests.semantics.nodes import (
    Both,
    Clock,
    Countdown,
    Ear,
    Keep,
    Ringing,
    Total,
    activity,
    add,
    drive,
    firings,
    forward,
    forward_later,
    merge,
    modifiers,
    numbers,
    of_kind,
    run,
    slow_numbers,
    traced,
)

# --- F12 ---


@pytest.mark.rule("F12")
def test_tokens_for_an_ended_node_are_drained_without_a_firing(fast: bool) -> None:
    graph = hfg.Graph()
    short, long = graph.add(numbers(count=1)), graph.add(numbers(count=5))
    node, other = graph.add(add()), graph.add(Keep())
    graph.connect(short.out, node.a)
    graph.connect(long.out, node.b)
    graph.connect(long.out, other.value)
    report = run(graph, fast)
    assert other.values == [1, 2, 3, 4, 5]
    assert report.nodes["add"].firings == 2
    assert report.edges["numbers_2.out -> add.b"].drained == 4  # 3, 4, 5 and END; 2 was dropped with the end
    assert report.edges["numbers_2.out -> add.b"].dropped == 1


@pytest.mark.rule("F12")
def test_a_chain_in_front_of_an_ended_node_goes_on_for_nobody(fast: bool) -> None:
    graph = hfg.Graph()
    short, long, between = graph.add(numbers(count=1)), graph.add(numbers(count=5)), graph.add(forward())
    node, other = graph.add(add()), graph.add(Keep())
    graph.connect(short.out, node.a)
    graph.connect(long.out, between.value)
    graph.connect(between.out, node.b)
    graph.connect(graph.add(numbers(count=9)).out, other.value)
    report = run(graph, fast)
    assert report.edges["forward.out -> add.b"].drained == 4
    assert len(other.values) == 9


class Hums(hfg.Node):
    """Says something at its end, and may be called for a long time meanwhile."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        return value

    def end(self) -> None:
        self.out.send(99)

    @hfg.slot
    async def hum(self, value: int) -> None:
        await asyncio.sleep(1.5)


@pytest.mark.rule("F4", "F9")
def test_end_follows_although_the_outputs_become_free_during_a_slot_call(fast: bool) -> None:
    graph = hfg.Graph()
    node, later, sink = graph.add(Hums()), graph.add(forward_later(), release="pipelined"), graph.add(Keep())
    graph.connect(graph.add(numbers(count=1)).out, node.value)
    graph.connect(graph.add(slow_numbers(count=1, pause_s=1.5)).out, node.hum)
    graph.connect(node.out, later.value)
    graph.connect(later.out, sink.value)
    report = run(graph, fast)
    assert sink.values == [1, 99]
    assert report.outcome == "done"
    assert report.nodes["keep"].ended


@pytest.mark.rule("F12")
def test_the_slots_of_an_ended_node_go_on(fast: bool) -> None:
    graph = hfg.Graph()
    source, late, node = graph.add(numbers(count=1)), graph.add(slow_numbers(count=2)), graph.add(Both())
    graph.connect(source.out, node.value)
    graph.connect(late.out, node.call)
    graph.connect(late.out, graph.add(Keep()).value)
    run(graph, fast)
    assert node.story == [("fire", 1), ("call", 1), ("call", 2)]


@pytest.mark.rule("F12", "A6")
def test_a_drained_modifier_acts_but_not_before_the_nodes_own_end_was_sent() -> None:
    graph = hfg.Graph()
    none, late, send = graph.add(numbers(count=0)), graph.add(slow_numbers(count=2)), graph.add(SecondActive())
    node, sink = graph.add(LateEnd()), graph.add(Keep())
    graph.connect(none.out, node.value)
    graph.connect(late.out, send.value)
    graph.connect(send.out, node.more, active=True)
    graph.connect(node.out, sink.value, active=True)
    graph.connect(late.out, graph.add(Keep()).value)
    trace = traced(graph)
    drained = [event for event in of_kind(trace, TokenDrained) if event.edge == "second_active.out -> late_end.more"]
    assert [(event.token.value, event.token.activity, event.time) for event in drained] == [(2, 1, 2), (END, 0, 2)]
    assert modifiers(trace, "late_end.out -> keep.value") == [0]
    changes = [(event.active, event.time) for event in of_kind(trace, ActivityChanged) if event.node == "late_end"]
    assert changes == [(True, 4)]


@pytest.mark.rule("F12", "A5", "A9", "P9")
@pytest.mark.parametrize("operated", [False, True])
def test_what_was_drained_until_the_end_acts_before_that_end_is_told_of(operated: bool) -> None:
    """END takes the activity, what was drained brings it back; both are told behind, and then the events complete."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        none, late, send = graph.add(numbers(count=0)), graph.add(slow_numbers(count=2)), graph.add(SecondActive())
        node, sink, gone, come = graph.add(LateEnd()), graph.add(Keep()), graph.add(Doubter()), graph.add(Doubter())
        graph.start.activates(node.activate)
        graph.connect(none.out, node.value)
        graph.connect(late.out, send.value)
        graph.connect(send.out, node.more, active=True)
        graph.connect(node.out, sink.value, active=True)
        graph.connect(late.out, graph.add(Keep()).value)
        through = [operators.skip(0)] if operated else []
        graph.connect(node.deactivated, gone.hear, through=through, active=not operated)
        graph.connect(node.activated, come.hear, through=through)
        return graph

    trace = traced(build())
    at = trace.index(next(event for event in of_kind(trace, NodeEnded) if event.node == "late_end"))
    behind = [
        event.active if isinstance(event, ActivityChanged) else event.token.activity
        for event in trace[at:]
        if (isinstance(event, ActivityChanged) and event.node == "late_end")
        or (isinstance(event, TokenSent) and event.edge.startswith("late_end."))
    ]
    assert behind == ([True, 0, 0] if operated else [True, 1, False, 0, 0])
    replay(build, trace)


class SecondActive(hfg.Node):
    """Gives activity with the value 2."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> None:
        self.out.send(value, activity=1 if value == 2 else 0)


class LateEnd(hfg.Node):
    """Ends by its first input and takes its time."""

    value = hfg.Input(int)
    more = hfg.Input(int, optional=True)
    out = hfg.Output(int)

    async def process(self, value: int, more: int | None) -> None:
        pass

    async def end(self) -> None:
        await asyncio.sleep(3)


class LeavesWithNinetyNine(hfg.Node):
    """A source that takes its activity away with its last token."""

    out = hfg.Output(int)
    count = hfg.State(0)

    def process(self) -> None:
        self.count += 1
        if self.count > 1:
            raise hfg.EndOfStream
        self.out.send(self.count, activity=0)

    def end(self) -> None:
        if self.active:
            self.out.send(99, activity=-1)


class Three(hfg.Node):
    """Joins three."""

    a = hfg.Input(int)
    b = hfg.Input(int)
    c = hfg.Input(int)

    def process(self, a: int, b: int, c: int) -> None:
        pass


@pytest.mark.rule("F12", "P5", "A8")
@pytest.mark.parametrize("release", ["sequential", "pipelined"])
@pytest.mark.parametrize("first", ["delay", "end"])
def test_what_lies_before_a_node_that_ends_is_drained_before_the_end_that_is_sent_by_that(
    first: str, release: Any, fast: bool
) -> None:
    graph, trace = hfg.Graph(), recorder()
    leaves, other = graph.add(LeavesWithNinetyNine()), graph.add(LeavesWithNinetyNine(), name="other")
    node = graph.add(Three(), release=release)
    graph.connect(graph.start, leaves.activate, active=True)
    delayed, ends = (node.b, node.a) if first == "end" else (node.a, node.b)
    graph.connect(leaves.out, ends)
    graph.connect(leaves.out, delayed, active=True, initial=(0,))
    graph.connect(other.out, node.c)
    run(graph, fast, trace=trace)
    assert trace.drained(f"leaves_with_ninety_nine.out -> three.{delayed.name}") == [99, END]
    assert activity(trace, "leaves_with_ninety_nine") == [True, False]
    assert activity(trace, "three") == [True]  # by the END, behind the -1
    replay(graph, trace)


class SpeaksAtItsEnd(hfg.Node):
    """Ends by one input and triggers into the other."""

    a = hfg.Input(int)
    b = hfg.Input(int)
    said = hfg.Event(int)

    def process(self, a: int, b: int) -> None:
        pass

    def end(self) -> None:
        self.said.trigger(7)


@pytest.mark.rule("F12", "P5")
def test_what_lies_before_a_node_is_drained_before_its_end_hook_speaks() -> None:
    graph, trace = hfg.Graph(), recorder()
    node = graph.add(SpeaksAtItsEnd())
    graph.connect(graph.add(numbers(count=0)).out, node.a)
    graph.connect(node.said, node.b, initial=(1, 2), capacity=1, overflow="drop_newest")
    run(graph, trace=trace)
    assert trace.drained("speaks_at_its_end.said -> speaks_at_its_end.b") == [2, 7]  # there was room again for 7
    replay(graph, trace)


class FailsAtItsEnd(hfg.Node):
    """Has last words and then fails."""

    a = hfg.Input(int)
    out = hfg.Output(int)

    async def process(self, a: int) -> int:
        return a

    async def end(self) -> None:
        self.out.send(99)
        raise ValueError("not so")


@pytest.mark.rule("F4", "X1", "R7")
@pytest.mark.parametrize("concurrency", [1, 2])
@pytest.mark.parametrize("policy", ["skip", "disable", "restart"])
def test_an_end_hook_that_fails_is_seen_to_fail_and_says_nothing(policy: Any, concurrency: int) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        node = graph.add(FailsAtItsEnd(), name="node", on_error=policy, concurrency=concurrency)
        graph.connect(graph.add(numbers(count=1)).out, node.a)
        graph.connect(node.out, graph.add(Ear(), name="ear").hear)
        graph.connect(node.failed, graph.add(Ear(), name="other").hear)
        return graph

    trace = recorder()
    assert run(build(), trace=trace).nodes["node"].failed == 1
    assert [event.outcome for event in trace.of(FiringEnded) if event.node == "node"] == ["done", "failed"]
    assert [error.policy for error in trace.of(ErrorRaised)] == [policy]
    assert len(trace.values("node.failed -> other.hear")) == 1
    assert trace.values("node.out -> ear.hear") == [1, *([] if policy == "disable" else [END])]  # what it said is void
    replay(build, trace)


class SlowEnd(hfg.Node):
    """A source that sees late that it has ended."""

    text = hfg.Parameter(0)
    out = hfg.Output(int)

    async def process(self) -> None:
        await asyncio.sleep(1)
        raise hfg.EndOfStream


@pytest.mark.rule("F4", "P8")
def test_what_a_source_has_taken_for_a_parameter_is_processed_as_it_ends() -> None:
    graph, trace = hfg.Graph(), recorder()
    source, slow = graph.add(numbers(count=3)), graph.add(SlowEnd())
    graph.connect(source.out, slow.ports.parameters["text"])
    graph.connect(source.out, graph.add(Keep()).value)
    run(graph, trace=trace)
    assert trace.taken("numbers.out -> slow_end.text") == [1]
    assert trace.drained("numbers.out -> slow_end.text") == [2, 3, END]
    replay(graph, trace)


@pytest.mark.rule("F12")
def test_a_node_says_that_it_has_ended_once() -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(numbers(count=2)), graph.add(Total()), graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    assert [event.node for event in of_kind(traced(graph), NodeEnded)] == ["numbers", "total", "keep"]


# --- F13 ---


@pytest.mark.rule("F13")
def test_a_sink_fed_by_events_is_closed_properly(fast: bool) -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(Ringing(count=4)), graph.add(Total()), graph.add(Keep())
    graph.connect(source.rang, node.value)
    graph.connect(node.out, sink.value)
    run(graph, fast)
    assert sink.values == [1 + 2 + 3 + 4]


@pytest.mark.rule("F13")
def test_all_open_event_edges_get_end_at_the_same_moment_and_once() -> None:
    graph = hfg.Graph()
    source = graph.add(Ringing(count=2))
    first, second, third = graph.add(Total()), graph.add(Echo()), graph.add(Keep())
    graph.connect(source.rang, first.value)
    graph.connect(source.rang, second.value)
    graph.connect(second.rang, third.value)
    trace = traced(graph)
    ends = [(event.edge, event.time) for event in of_kind(trace, TokenSent) if event.token.value is END]
    assert ends == [
        ("ringing.rang -> total.value", 0),
        ("ringing.rang -> echo.value", 0),
        ("echo.rang -> keep.value", 0),
    ]
    assert third.values == [1, 2]  # a signal behind END is dropped: "at the same moment"
    assert firings(trace, "keep") == ["process", "process", "end"]


@pytest.mark.rule("F13", "F4")
@pytest.mark.parametrize(
    ("overflow", "capacity"), [("wait", 16), ("wait", 1), ("latest", 1), ("drop_oldest", 2), ("error", 1)]
)
def test_a_signal_behind_the_end_of_its_edge_is_dropped_and_nobody_waits_for_it(
    overflow: Any, capacity: int, fast: bool
) -> None:
    graph = hfg.Graph()
    source, node = graph.add(SpeaksNowAndThen()), graph.add(TwoOfThem())
    graph.connect(source.out, node.a)
    graph.connect(source.said, node.b, overflow=overflow, capacity=capacity)
    report = run(graph, fast)
    assert node.values == [(1, 1), (2, None), (3, None), (4, None)]  # END came on b as 2 could not move
    assert report.edges["speaks_now_and_then.said -> two_of_them.b"].dropped == 2


class SpeaksNowAndThen(hfg.Node):
    """A source whose signal is missing in its second firing, so that a join with it stands still."""

    out = hfg.Output(int)
    said = hfg.Event(int)
    silent_until = hfg.Parameter(0)
    count = hfg.State(0)

    def process(self) -> int:
        self.count += 1
        if self.count > 4:
            raise hfg.EndOfStream
        if self.count != 2 and self.count > self.silent_until:
            self.said.trigger(self.count)
        return self.count


class TwoOfThem(hfg.Node):
    """Keeps pairs."""

    a = hfg.Input(int)
    b = hfg.Input(int, optional=True)
    values = hfg.State(factory=list)

    def process(self, a: int, b: int | None) -> None:
        self.values.append((a, b))


@pytest.mark.rule("F13", "A8")
@pytest.mark.parametrize("forked", [False, True], ids=["alone", "with another edge"])
def test_activity_of_a_signal_behind_the_end_of_its_edge_goes_back_to_its_sender(forked: bool, fast: bool) -> None:
    graph, trace = hfg.Graph(), recorder()
    source, node, other = graph.add(SpeaksNowAndThen(silent_until=2)), graph.add(TwoOfThem()), graph.add(Ear())
    graph.connect(graph.start, source.activate, active=True)
    graph.connect(source.out, node.a)
    graph.connect(source.said, node.b, active=True)
    if forked:
        graph.connect(source.said, other.hear, active=True)
    run(graph, fast, trace=trace)
    behind = [event.token.activity for event in of_kind(trace, TokenDropped) if event.reason == "ended"]
    assert behind == [1, 1]  # of 3 and 4
    assert not of_kind(trace, ActivityLost)
    returned = [event for event in of_kind(trace, ActivityChanged) if event.cause == "returned"]
    assert [(event.node, event.active) for event in returned] == [("speaks_now_and_then", True)] * 2
    replay(graph, trace)


class Echo(hfg.Node):
    """Triggers once more when it ends."""

    value = hfg.Input(int)
    rang = hfg.Event(int)

    def process(self, value: int) -> None:
        self.rang.trigger(value)

    def end(self) -> None:
        self.rang.trigger(99)


@pytest.mark.rule("F13")
def test_edges_that_were_busy_get_their_end_in_a_later_round(fast: bool) -> None:
    graph = hfg.Graph()
    rings, other = graph.add(Ringing(count=1)), graph.add(Ringing(count=3))
    node, sink, last = graph.add(merge()), graph.add(Total3()), graph.add(Keep())
    graph.connect(rings.rang, node.a)
    graph.connect(other.rang, node.b)
    graph.connect(node.out, sink.value)
    graph.connect(sink.out, last.value)
    report = run(graph, fast)
    assert report.outcome == "done"
    assert last.values == [3]  # 1 joined with 1; then END on a lets the two others through


class Total3(hfg.Node):
    """How many values came."""

    value = hfg.Input(object)
    out = hfg.Output(int)
    count = hfg.State(0)

    def process(self, value: object) -> None:
        self.count += 1

    def end(self) -> None:
        self.out.send(self.count)


@pytest.mark.rule("F13", "R5")
def test_the_end_of_events_waits_as_long_as_somebody_outside_holds_the_run_open(fast: bool) -> None:
    async def main() -> tuple[list[object], list[object]]:
        graph = hfg.Graph()
        ear, node, sink = graph.add(Ear()), graph.add(Total()), graph.add(Keep())
        graph.connect(ear.passed, node.value)
        graph.connect(node.out, sink.value)
        async with hfg.running(graph, fast=fast) as run:
            await run.trigger(ear.hear, 5)
            await run.wait_quiet()
            before = list(sink.values)
            await run.wait_finished()
        return before, sink.values

    assert drive(main) == ([], [5])


@pytest.mark.rule("F13", "R5")
def test_events_end_behind_the_end_of_a_closed_feed_that_had_to_wait_for_its_place() -> None:
    trace = recorder()

    async def main() -> None:
        graph = hfg.Graph()
        red, blue = graph.input("red", int), graph.input("blue", int)
        join, ear, node = graph.add(add(), max_rate_hz=100.0), graph.add(Ear()), graph.add(Total())
        graph.connect(red, join.a)
        graph.connect(blue, join.b)
        graph.connect(ear.passed, node.value)
        async with hfg.running(graph, trace=trace) as run:
            async with run.feed(red) as reds, run.feed(blue) as blues:
                sending = asyncio.gather(reds.send(1), blues.send(1))
                await run.wait_quiet()
                await sending
                waiting = asyncio.ensure_future(reds.send(2))  # lies there until blue's END lets it be dropped
                await run.wait_quiet()
                waiting.cancel()
            await run.wait_finished()

    drive(main)
    ends = [event.edge for event in of_kind(trace, TokenSent) if event.token.value is END]
    assert ends[:3] == ["blue -> add.b", "red -> add.a", "ear.passed -> total.value"]


# --- R5 ---


@pytest.mark.rule("R5")
def test_a_run_ends_at_the_first_quiet_moment(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(slow_numbers(count=2, pause_s=3)), graph.add(Keep())
    graph.connect(source.out, sink.value)
    report = run(graph, fast)
    assert (report.outcome, report.duration_s) == ("done", 6)


@pytest.mark.rule("R5")
def test_an_empty_graph_is_done_at_once(fast: bool) -> None:
    assert run(hfg.Graph(), fast).outcome == "done"


@pytest.mark.rule("R5")
def test_a_pending_timer_keeps_the_run_open(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=3)), graph.add(forward(), max_rate_hz=0.5)
    graph.connect(source.out, node.value)
    assert run(graph, fast).duration_s >= 4


@pytest.mark.rule("R5")
def test_a_futile_endless_source_does_not_keep_the_run_open(fast: bool) -> None:
    graph = hfg.Graph()
    short, endless = graph.add(numbers(count=3)), graph.add(Clock(), max_rate_hz=10)
    node, sink = graph.add(add()), graph.add(Keep())
    graph.connect(short.out, node.a)
    graph.connect(endless.out, node.b)
    graph.connect(node.out, sink.value)
    report = run(graph, fast)
    assert report.outcome == "done"
    assert sink.values == [2, 4, 6]


@pytest.mark.rule("R5")
def test_a_futile_source_that_waits_in_its_code_does_not_keep_the_run_open(fast: bool) -> None:
    graph = hfg.Graph()
    short, endless = graph.add(numbers(count=2)), graph.add(forever())
    node = graph.add(add())
    graph.connect(short.out, node.a)
    graph.connect(endless.out, node.b)
    report = run(graph, fast)
    assert report.outcome == "done"
    assert report.duration_s < 10


@hfg.node
async def forever() -> AsyncIterator[int]:
    """A number each second, without end."""
    number = 0
    while True:
        await asyncio.sleep(1)
        number += 1
        yield number


class Echoes(hfg.Node):
    """A source without end that says again and again what its parameter is."""

    text = hfg.Parameter(0)
    out = hfg.Output(int)

    def process(self) -> int:
        return self.text


@pytest.mark.rule("R5")
def test_a_source_for_nobody_holds_nobody_up_who_works_for_others_too(fast: bool) -> None:
    """What lies before it would else wait until all is quiet, and then be drained: an hour, beside this clock."""
    graph, trace = hfg.Graph(), recorder()
    sets, echoes, node = graph.add(numbers(count=3), name="sets"), graph.add(Echoes()), graph.add(add())
    graph.connect(echoes.out, node.a)
    graph.connect(graph.add(numbers(count=0)).out, node.b)
    graph.connect(sets.out, echoes.ports.parameters["text"])
    graph.connect(sets.out, graph.add(Keep()).value)
    graph.connect(graph.add(slow_numbers(count=2, pause_s=1800)).out, graph.add(Keep(), name="slow").value)
    assert run(graph, fast, trace=trace).outcome == "done"
    assert [event.time for event in trace.of(TokenSent) if event.edge == "sets.out -> keep.value"] == [0, 0, 0, 0]


@pytest.mark.rule("R5", "F12")
@pytest.mark.parametrize("count", [5, 10**9], ids=["behind one that ends", "behind one without end"])
@pytest.mark.parametrize("release", ["sequential", "pipelined"])
def test_what_lies_before_a_source_that_is_given_up_is_drained(count: int, release: Any, fast: bool) -> None:
    graph, trace = hfg.Graph(), recorder()
    short, sets, echoes = (
        graph.add(numbers(count=1)),
        graph.add(numbers(count=count), name="sets"),
        graph.add(Echoes(), release=release),
    )
    node = graph.add(add())
    graph.connect(short.out, node.a)
    graph.connect(echoes.out, node.b)
    graph.connect(sets.out, echoes.ports.parameters["text"])
    assert run(graph, fast, trace=trace).outcome == "done"
    taken = len(trace.taken("sets.out -> echoes.text"))
    drained = trace.drained("sets.out -> echoes.text")
    assert len(drained) == len(trace.tokens("sets.out -> echoes.text")) - taken
    assert len(drained) <= 2  # what it would have taken next, and perhaps END: those who send to it alone go with it


@pytest.mark.rule("R5", "A6", "F12")
def test_activity_that_lies_before_a_source_that_is_given_up_arrives() -> None:
    graph, trace = hfg.Graph(), recorder()
    sets, echoes, node = graph.add(Countdown(count=1)), graph.add(Echoes()), graph.add(add())
    graph.connect(graph.start, sets.activate)
    graph.connect(graph.add(slow_numbers(count=1)).out, node.a)
    graph.connect(echoes.out, node.b)
    graph.connect(sets.out, echoes.ports.parameters["text"], active=True, initial=(7, 7, 7))
    assert run(graph, trace=trace).outcome == "done"
    assert trace.active_at_end() == ["echoes"]


@pytest.mark.rule("R5", "A11")
def test_a_source_that_rests_keeps_no_run_open_beside_one_that_works_for_nobody(fast: bool) -> None:
    graph = hfg.Graph()
    short, endless, resting = graph.add(numbers(count=1)), graph.add(Echoes()), graph.add(numbers(), name="resting")
    node, state = graph.add(add()), graph.add(Ear())
    graph.connect(short.out, node.a)
    graph.connect(endless.out, node.b)
    graph.gate(resting, by=state)
    report = run(graph, fast)
    assert (report.outcome, report.nodes["resting"].firings) == ("done", 0)


@pytest.mark.rule("R5", "A11")
def test_a_source_that_has_rested_goes_on_although_the_others_worked_for_nobody_by_then(fast: bool) -> None:
    graph = hfg.Graph()
    short, endless, resting = graph.add(numbers(count=1)), graph.add(Clock(), max_rate_hz=1), graph.add(numbers())
    node, state, sink, opens = graph.add(add()), graph.add(Ear()), graph.add(Keep()), graph.add(Later())
    graph.connect(short.out, node.a)
    graph.connect(endless.out, node.b)
    graph.connect(resting.out, sink.value)
    graph.gate(resting, by=state)
    graph.connect(graph.start, opens.begin)
    graph.connect(opens.done, state.activate)
    report = run(graph, fast)
    assert (report.outcome, sink.values) == ("done", [1, 2, 3])


class Later(hfg.Node):
    """Takes five seconds for a call."""

    done = hfg.Event()

    @hfg.slot
    async def begin(self) -> None:
        await asyncio.sleep(5)
        self.done.trigger()


@pytest.mark.rule("R5", "F10")
@pytest.mark.parametrize("boxed", [False, True])
def test_the_run_ends_when_the_last_source_that_works_for_somebody_is_disabled(boxed: bool, fast: bool) -> None:
    graph = hfg.Graph()
    short, endless = graph.add(numbers(count=1)), graph.add(Clock(), max_rate_hz=1)
    node, opens = graph.add(add()), graph.add(Later())
    useful: Any = graph.add(Ticking(), name="useful") if boxed else graph.add(Clock(), name="useful", max_rate_hz=1)
    graph.connect(useful.out, graph.add(Keep()).value)
    graph.connect(short.out, node.a)
    graph.connect(endless.out, node.b)
    graph.connect(graph.start, opens.begin)
    graph.connect(opens.done, useful.disable)
    report = run(graph, fast, until_s=100)
    assert (report.outcome, report.duration_s) == ("done", 5)


class Ticking(hfg.Subgraph):
    """A box around a clock."""

    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        graph.connect(graph.add(Clock(), max_rate_hz=1).out, self.out.inner)


@pytest.mark.rule("R5")
def test_a_source_with_an_edge_into_a_living_node_keeps_the_run_open(fast: bool) -> None:
    graph = hfg.Graph()
    short, endless = graph.add(numbers(count=1)), graph.add(Clock(), max_rate_hz=1)
    node, ear = graph.add(add()), graph.add(Keep())
    graph.connect(short.out, node.a)
    graph.connect(endless.out, node.b)
    graph.connect(endless.out, ear.value)
    assert run(graph, fast, until_s=7.5).outcome == "until"
    assert ear.values == list(range(1, 9))


@pytest.mark.rule("R5")
def test_until_ends_the_run_well_and_counts_what_is_left() -> None:
    graph = hfg.Graph()
    source, slow = graph.add(Ringing(count=10)), graph.add(forward_later())
    graph.connect(source.rang, slow.value)
    trace: list[TraceEvent] = []
    report = run(graph, until_s=2.5, trace=trace.append)
    assert (report.outcome, report.duration_s) == ("until", 2.5)
    assert [(event.token.value, event.reason) for event in of_kind(trace, TokenDropped)] == [
        (number, "stopped") for number in range(4, 11)
    ]


@pytest.mark.rule("R5", "A10")
def test_stop_and_abort_end_the_run_well_and_in_failure(fast: bool) -> None:
    graph = hfg.Graph()
    source, ear = graph.add(Clock(), max_rate_hz=1), graph.add(Ear())
    graph.connect(source.ticked, ear.hear)
    third = graph.add(OnThird())
    graph.connect(ear.passed, third.hear)
    graph.connect(third.now, graph.stop)
    report = run(graph, fast)
    assert (report.outcome, report.duration_s) == ("stopped", 2)

    graph = hfg.Graph()
    source, third = graph.add(Clock(), max_rate_hz=1), graph.add(OnThird())
    graph.connect(source.ticked, third.hear)
    graph.connect(third.now, graph.abort)
    with pytest.raises(hfg.errors.Aborted, match=r'slot "abort" was called by "on_third.now"') as raised:
        run(graph, fast)
    assert raised.value.report.outcome == "aborted"  # type: ignore[attr-defined]


class OnThird(hfg.Node):
    """Triggers at the third signal."""

    now = hfg.Event()

    @hfg.slot
    def hear(self, value: int) -> None:
        if value == 3:
            self.now.trigger()


@pytest.mark.rule("R5")
def test_allow_idle_keeps_a_quiet_graph_open() -> None:
    async def main() -> str:
        graph = hfg.Graph()
        ear = graph.add(Ear())
        task = asyncio.create_task(hfg.run_async(graph, allow_idle=True))
        await asyncio.sleep(100)
        assert not task.done()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        return str(ear.active)

    assert drive(main) == "False"


def stalled(build: object, fast: bool) -> str:
    graph = hfg.Graph()
    build(graph)  # type: ignore[operator]
    with pytest.raises(hfg.errors.Stalled) as raised:
        run(graph, fast)
    assert raised.value.report.outcome == "stalled"  # type: ignore[attr-defined]
    return str(raised.value)


def _unready(graph: hfg.Graph) -> None:
    source, node = graph.add(numbers(count=2)), graph.add(Never())
    graph.connect(source.out, node.value)


class Never(hfg.Node):
    """Never ready."""

    value = hfg.Input(int)

    def ready(self) -> bool:
        return False

    def process(self, value: int) -> None:
        pass


def _half_fed(graph: hfg.Graph) -> None:
    rings, ear, node = graph.add(Countdown(count=2)), graph.add(Ear()), graph.add(add())
    graph.connect(rings.out, node.a)
    graph.connect(graph.add(Unfed()).out, node.b)
    graph.connect(rings.out, ear.hear)


class Unfed(hfg.Node):
    """Its input is not connected."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        return value


@pytest.mark.rule("R5")
@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (_unready, '"never" says by ready() that it is not ready, while tokens lie on "numbers.out -> never.value"'),
        (_half_fed, '"add" waits for "b", while tokens lie on "countdown.out -> add.a"'),
        (
            _half_fed,
            'source "countdown" has not ended and waits until its token is processed on "countdown.out -> add.a"',
        ),
    ],
)
def test_a_stall_says_who_waits_for_what(build: object, sentence: str, fast: bool) -> None:
    assert sentence in stalled(build, fast)
