"""Full queues, the order of calls and firings, independence of the schedule, rates (rules F7, F8, F9, F11)."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import pytest

import hfg
from hfg.trace import CallStarted, FiringStarted, QueueGrown, TokenSent
from tests.semantics.nodes import (
    Both,
    Burst,
    Clock,
    Ear,
    Keep,
    KeepTokens,
    Ringing,
    add,
    add_optional,
    drive,
    forward,
    forward_async,
    forward_later,
    gaps,
    merge,
    numbers,
    of_kind,
    only_odd,
    run,
    split,
    traced,
)

# --- F7 ---


def mixed(policy: str, seed: int, place: int, release: str) -> dict[str, list[Any]]:
    """What runs over every edge of a graph of synchronous edges."""
    graph = hfg.Graph()
    graph.group("work", threads=1, policy=policy, seed=seed)  # type: ignore[arg-type]
    graph.group("loop", policy=policy, seed=seed)  # type: ignore[arg-type]
    number = 0

    def put(node: Any) -> Any:
        nonlocal number
        number += 1
        group = "work" if (number * 7 + place) % 3 == 0 and not node._type.process_kind.startswith("async") else None
        mode: Any = release if release != "mixed" else ("sequential" if number % 2 else "pipelined")
        return graph.add(node, group=group, release=mode, priority=number % 4)

    source, holes, few = put(numbers(count=12)), put(gaps(count=12)), put(numbers(count=5))
    node, odd, halves, later = put(add()), put(only_odd()), put(split()), put(forward_async())
    joined, some, last = put(merge()), put(add_optional()), put(add())
    graph.connect(source.out, node.a)
    graph.connect(holes.out, node.b)
    graph.connect(node.out, odd.value)
    graph.connect(node.out, halves.value)
    graph.connect(halves.small, joined.a)
    graph.connect(odd.out, joined.b)
    graph.connect(source.out, later.value)
    graph.connect(later.out, some.a)
    graph.connect(few.out, some.b)
    graph.connect(some.out, last.a)
    graph.connect(last.out, last.b, initial=[0])
    for end in (joined.out, last.out, halves.big):
        graph.connect(end, put(Keep()).value)
    found: dict[str, list[Any]] = {}
    for event in of_kind(traced(graph), TokenSent):
        found.setdefault(event.edge, []).append((event.token.value, event.token.activity))
    return found


@pytest.mark.slow
@pytest.mark.rule("F7")
def test_what_runs_over_every_edge_depends_on_no_policy_group_or_mode() -> None:
    expected = mixed("fifo", 0, 0, "auto")
    assert len(expected) == 14
    for policy, seed, place, release in [
        ("priority", 0, 1, "sequential"),
        ("random", 1, 2, "pipelined"),
        ("random", 2, 0, "mixed"),
        ("random", 3, 1, "mixed"),
        ("fifo", 0, 2, "mixed"),
    ]:
        assert mixed(policy, seed, place, release) == expected


# --- F8 ---


@pytest.mark.rule("F8")
def test_triggering_does_not_make_a_node_wait_and_what_one_firing_triggers_always_fits(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(Burst(count=100)), graph.add(Keep())
    graph.connect(source.rang, sink.value, capacity=3)
    report = run(graph, fast)
    assert sink.values == list(range(1, 101))
    assert (report.edges["burst.rang -> keep.value"].dropped, report.edges["burst.rang -> keep.value"].grown) == (0, 0)


@pytest.mark.rule("F8")
def test_a_node_with_a_full_queue_starts_no_firing_until_there_is_room(fast: bool) -> None:
    graph = hfg.Graph()
    source, slow, sink = graph.add(Ringing(count=5)), graph.add(forward_later()), graph.add(KeepTokens())
    graph.connect(source.rang, slow.value, capacity=2)
    graph.connect(slow.out, sink.value)
    run(graph, fast)
    assert [token.stamp for token in sink.tokens] == [0, 0, 0, 1, 2]


@pytest.mark.rule("F8")
def test_a_node_with_a_full_queue_starts_no_slot_call() -> None:
    graph = hfg.Graph()
    source, ear, slow = graph.add(Burst(count=4)), graph.add(Ear()), graph.add(forward_later())
    graph.connect(source.rang, ear.hear)
    graph.connect(ear.passed, slow.value, capacity=1)
    calls = [event.time for event in of_kind(traced(graph), CallStarted)]
    assert calls == [0, 0, 1, 2]


class Doubles(hfg.Node):
    """Each call triggers twice."""

    heard = hfg.State(0)
    passed = hfg.Event(int)

    @hfg.slot
    def hear(self, value: int) -> None:
        self.heard += 1
        if value < 5:
            self.passed.trigger(value + 1)
            self.passed.trigger(value + 1)


@pytest.mark.rule("F8")
def test_where_only_full_queues_hold_nodes_back_the_smallest_grows_and_nothing_is_lost(fast: bool) -> None:
    graph = hfg.Graph()
    source, a, b = graph.add(Ringing(count=1)), graph.add(Doubles()), graph.add(Doubles())
    graph.connect(source.rang, a.hear)
    graph.connect(a.passed, b.hear, capacity=2)
    graph.connect(b.passed, a.hear, capacity=1)
    report = run(graph, fast)
    assert (a.heard, b.heard) == (1 + 4 + 16, 2 + 8)
    assert report.edges["doubles_2.passed -> doubles.hear"].grown > 0
    assert report.edges["doubles_2.passed -> doubles.hear"].dropped == 0


@pytest.mark.rule("F8", "R7")
def test_growing_is_traced_one_place_at_a_time_and_the_first_of_equals_grows() -> None:
    graph = hfg.Graph()
    source, a, b = graph.add(Ringing(count=1)), graph.add(Doubles()), graph.add(Doubles())
    graph.connect(source.rang, a.hear)
    graph.connect(a.passed, b.hear, capacity=1)
    graph.connect(b.passed, a.hear, capacity=1)
    grown = of_kind(traced(graph), QueueGrown)
    assert (grown[0].edge, grown[0].capacity) == ("doubles.passed -> doubles_2.hear", 2)
    for edge in ("doubles.passed -> doubles_2.hear", "doubles_2.passed -> doubles.hear"):
        places = [event.capacity for event in grown if event.edge == edge]
        assert places == list(range(2, 2 + len(places)))


@pytest.mark.rule("F8")
def test_code_that_triggers_without_end_waits_for_room(fast: bool) -> None:
    graph = hfg.Graph()
    source, slow, sink = graph.add(Flood()), graph.add(forward_later()), graph.add(KeepTokens())
    graph.connect(source.rang, slow.value, capacity=2)
    graph.connect(slow.out, sink.value)
    run(graph, fast)
    assert source.times == [0, 0, 1, 2, 3, 4]
    assert [token.value for token in sink.tokens] == [0, 1, 2, 3, 4, 5]


class Flood(hfg.Node):
    """One firing, many signals."""

    rang = hfg.Event(int)
    times = hfg.State(factory=list)

    async def process(self) -> None:
        if self.times:
            raise hfg.EndOfStream
        for number in range(6):
            await self.rang.trigger_wait(number)
            self.times.append(hfg.now())


@pytest.mark.rule("F8", "P10")
def test_code_outside_that_triggers_an_event_waits_for_room(fast: bool) -> None:
    async def main() -> list[float]:
        graph = hfg.Graph()
        ear, slow = graph.add(Ear()), graph.add(forward_later())
        graph.connect(ear.passed, slow.value, capacity=2)
        times = []
        async with hfg.running(graph, fast=fast) as run:
            for number in range(5):
                await run.trigger(ear.passed, number)
                times.append(run.now())
        return times

    assert drive(main) == [0, 0, 1, 2, 3]  # the second waits until the first is taken


# --- F9 ---


class Careful(hfg.Node):
    """Notices if a call and a firing overlap."""

    value = hfg.Input(int)
    inside = hfg.State(0)
    worst = hfg.State(0)
    count = hfg.State(0)

    async def process(self, value: int) -> None:
        await self.work()

    @hfg.slot
    async def call(self, value: int) -> None:
        await self.work()

    async def work(self) -> None:
        self.inside += 1
        self.worst = max(self.worst, self.inside)
        await asyncio.sleep(1)
        self.inside -= 1
        self.count += 1


@pytest.mark.rule("F9")
def test_calls_and_firings_of_a_node_never_overlap(fast: bool) -> None:
    graph = hfg.Graph()
    source, rings, node = graph.add(numbers(count=5)), graph.add(Burst(count=5)), graph.add(Careful())
    graph.connect(source.out, node.value)
    graph.connect(rings.rang, node.call)
    report = run(graph, fast)
    assert (node.worst, node.count, report.duration_s) == (1, 10, 10)


@pytest.mark.rule("F9")
def test_of_one_sending_the_slots_come_first(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=2)), graph.add(Both())
    graph.connect(source.out, node.value)
    graph.connect(source.out, node.call)
    run(graph, fast)
    assert node.story == [("call", 1), ("fire", 1), ("call", 2), ("fire", 2)]


@pytest.mark.rule("F9")
def test_of_one_signal_the_slots_come_first(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(Ringing(count=2)), graph.add(Both())
    graph.connect(source.rang, node.value)
    graph.connect(source.rang, node.call)
    run(graph, fast)
    assert node.story == [("call", 1), ("fire", 1), ("call", 2), ("fire", 2)]


class Starter(hfg.Node):
    """One firing triggers twice, in between a value."""

    calls = hfg.Event(int)
    values = hfg.Event(int)
    over = hfg.State(False)

    def process(self) -> None:
        if self.over:
            raise hfg.EndOfStream
        self.over = True
        self.calls.trigger(1)
        self.values.trigger(2)
        self.calls.trigger(3)
        self.values.trigger(4)
        self.calls.trigger(5)


@pytest.mark.rule("F9")
def test_calls_and_firings_form_one_order_by_arrival_and_by_when_they_became_enabled(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(Starter()), graph.add(Both())
    graph.connect(source.calls, node.call)
    graph.connect(source.values, node.value)
    run(graph, fast)
    # the second firing's place is when the first has left the input: behind all three calls
    assert node.story == [("call", 1), ("fire", 2), ("call", 3), ("call", 5), ("fire", 4)]


@pytest.mark.rule("F9")
def test_a_slot_handler_may_trigger_events(fast: bool) -> None:
    graph = hfg.Graph()
    source, ear, sink = graph.add(Ringing(count=2)), graph.add(Ear()), graph.add(Keep())
    graph.connect(source.rang, ear.hear)
    graph.connect(ear.passed, sink.value)
    run(graph, fast)
    assert sink.values == [1, 2]


# --- F11 ---


@pytest.mark.rule("F11")
def test_firings_start_at_the_rate_and_the_first_at_once(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(Clock(), max_rate_hz=10), graph.add(KeepTokens())
    graph.connect(source.out, sink.value)
    run(graph, fast, until_s=0.45)
    assert [round(token.stamp, 6) for token in sink.tokens] == [0, 0.1, 0.2, 0.3, 0.4]


@pytest.mark.rule("F11")
def test_missed_time_is_not_made_up() -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(uneven()), graph.add(forward(), max_rate_hz=1), graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    trace = traced(graph)
    assert [event.time for event in of_kind(trace, FiringStarted) if event.node == "forward"][:4] == [0, 5, 6, 7]


@hfg.node
async def uneven() -> AsyncIterator[int]:
    """One number, a long pause, three at once."""
    yield 1
    await asyncio.sleep(5)
    for number in (2, 3, 4):
        yield number


@pytest.mark.rule("F11")
def test_the_rate_is_one_of_starts_not_of_pauses() -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=3)), graph.add(forward_later(), max_rate_hz=0.8)
    graph.connect(source.out, node.value)
    starts = [event.time for event in of_kind(traced(graph), FiringStarted) if event.node == "forward_later"]
    assert starts[:3] == [0, 1.25, 2.5]


@pytest.mark.rule("F11")
def test_silent_firings_are_not_counted() -> None:
    graph = hfg.Graph()
    source, node = graph.add(gaps(count=5)), graph.add(forward(), max_rate_hz=1)
    graph.connect(source.out, node.value)
    starts = [(event.kind, event.time) for event in of_kind(traced(graph), FiringStarted) if event.node == "forward"]
    assert starts == [("process", 0), ("silent", 1), ("process", 1), ("silent", 2), ("process", 2), ("end", 3)]
