"""Operators on edges, events as observables, observables as feeds (rule P9)."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Any

import pytest
import reactivex
from reactivex import Observable, Subject, operators

import hfg
from hfg.testing import recorder, replay
from tests.semantics.nodes import (
    Burst,
    Ear,
    Keep,
    KeepTokens,
    Send,
    Timed,
    drive,
    numbers,
    run,
    slow_numbers,
    value_of,
)


@pytest.mark.rule("P9")
def test_operators_see_tokens_and_lie_before_the_queue(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(Burst(count=6)), graph.add(KeepTokens())
    even = operators.filter(lambda token: value_of(token) % 2 == 0)
    times_ten = operators.map(lambda token: value_of(token) * 10)
    graph.connect(source.rang, sink.value, through=[even, times_ten], capacity=2, overflow="drop_oldest")
    report = run(graph, fast)
    assert [token.value for token in sink.tokens] == [40, 60]
    assert report.edges["burst.rang -> keep_tokens.value"].dropped == 1


@pytest.mark.rule("P9", "T5")
def test_what_comes_out_and_is_no_token_becomes_one_with_the_newest_stamp_that_went_in(fast: bool) -> None:
    graph = hfg.Graph()
    source, send, sink = graph.add(slow_numbers(pause_s=2)), graph.add(Send(modifier=1)), graph.add(KeepTokens())
    graph.connect(source.out, send.value)
    pairs = [operators.map(value_of), operators.buffer_with_count(2)]
    graph.connect(send.rang, sink.value, through=pairs)
    run(graph, fast)
    assert [(token.value, token.stamp, token.activity) for token in sink.tokens] == [([1, 2], 2, 0), ([3], 4, 0)]


@pytest.mark.rule("P9", "F9")
@pytest.mark.parametrize("call_first", [False, True])
def test_what_operators_say_when_they_are_connected_enables_in_the_order_of_their_edges(call_first: bool) -> None:
    done: list[str] = []

    class Listens(hfg.Node):
        value = hfg.Input(int)

        def process(self, value: int) -> None:
            done.append(f"fire {value}")

        @hfg.slot
        def hear(self, value: int) -> None:
            done.append(f"call {value}")

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, listener = graph.add(Burst(count=0)), graph.add(Listens())
        targets: list[Any] = [listener.value, listener.hear]
        for target in reversed(targets) if call_first else targets:
            graph.connect(source.rang, target, through=[operators.start_with(5)])
        return graph

    trace = recorder()
    run(build(), trace=trace)
    assert done == (["call 5", "fire 5"] if call_first else ["fire 5", "call 5"])
    replay(build, trace)


@pytest.mark.rule("P9")
def test_a_token_that_comes_out_keeps_its_stamp(fast: bool) -> None:
    graph = hfg.Graph()
    source, send, sink = graph.add(slow_numbers(pause_s=2)), graph.add(Send(modifier=1)), graph.add(KeepTokens())
    graph.connect(source.out, send.value)
    graph.connect(send.rang, sink.value, through=[operators.take_last(3)])
    run(graph, fast)
    assert [(token.value, token.stamp, token.activity) for token in sink.tokens] == [(1, 0, 0), (2, 2, 0), (3, 4, 0)]


@pytest.mark.rule("P9", "R6")
def test_an_operator_of_time_runs_on_the_clock_of_the_run(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(Burst(count=5)), graph.add(Timed())
    graph.connect(source.rang, sink.value, through=[operators.delay(0.2), operators.map(value_of)])
    report = run(graph, fast)
    assert sink.seen == [(number, 0.2) for number in range(1, 6)]
    assert report.duration_s == 0.2


@pytest.mark.rule("P9", "R6")
def test_debounce_on_an_edge_lets_the_last_of_a_burst_through(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(Burst(count=5)), graph.add(Timed())
    graph.connect(source.rang, sink.value, through=[operators.debounce(0.2), operators.map(value_of)])
    assert run(graph, fast).outcome == "done"
    assert [value for value, _ in sink.seen] == [5]


@pytest.mark.rule("P9", "R5")
def test_operators_give_out_what_they_hold_before_the_run_ends(fast: bool) -> None:
    graph = hfg.Graph()
    source, ear = graph.add(Burst(count=5)), graph.add(Ear())
    threes = [operators.map(value_of), operators.buffer_with_count(3)]
    graph.connect(source.rang, ear.hear, through=threes)
    run(graph, fast)
    assert ear.heard == [[1, 2, 3], [4, 5]]


@pytest.mark.rule("P9")
def test_operators_complete_when_the_node_of_the_event_has_ended(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(Burst(count=2)), graph.add(Timed())
    other, keep = graph.add(slow_numbers(count=1, pause_s=100)), graph.add(Keep())
    graph.connect(other.out, keep.value)
    graph.connect(source.rang, sink.value, through=[operators.count()])
    run(graph, fast)
    assert sink.seen == [(2, 0)]


@pytest.mark.rule("P9")
@pytest.mark.parametrize("clock", ["virtual", "real"])
@pytest.mark.parametrize(
    ("operator", "comes_out"),
    [
        (operators.start_with(0), [0, 1, 2, 3]),
        (operators.retry(2), [1, 2, 3]),
        (operators.concat(reactivex.of(9)), [1, 2, 3, 9]),
        (operators.map(value_of), [1, 2, 3]),
    ],
)
def test_operators_are_connected_before_the_first_signal(clock: Any, operator: Any, comes_out: list[int]) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(Burst(count=3)), graph.add(Keep())
    graph.connect(source.rang, sink.value, through=[operator])
    report = hfg.run(graph, clock=clock)
    assert sink.values == comes_out
    assert report.edges["burst.rang -> keep.value"].dropped == 0


@pytest.mark.rule("P9", "F8")
def test_operators_that_begin_again_lose_nothing_in_between(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(Burst(count=6)), graph.add(Keep())
    pairs: list[Callable[[Observable[Any]], Observable[Any]]] = [
        operators.take(2),
        operators.map(value_of),
        operators.sum(),
        operators.repeat(3),
    ]
    graph.connect(source.rang, sink.value, through=pairs)
    run(graph, fast)
    assert sink.values == [3, 7, 11]


class Goes(hfg.Node):
    """Ends with its input; its slot goes on."""

    value = hfg.Input(int)
    rang = hfg.Event(int)

    def process(self, value: int) -> None:
        self.rang.trigger(value)

    @hfg.slot
    def ring(self, value: int) -> None:
        self.rang.trigger(value)


@pytest.mark.rule("P9", "F12", "F13")
def test_what_is_triggered_behind_the_end_of_an_event_with_operators_is_dropped_and_counted(fast: bool) -> None:
    graph = hfg.Graph()
    source, goes, sink = graph.add(numbers(count=2)), graph.add(Goes()), graph.add(Keep())
    graph.connect(source.out, goes.value)
    graph.connect(goes.rang, sink.value, through=[operators.count()])

    async def main() -> tuple[list[int], int]:
        async with hfg.running(graph, fast=fast) as run:
            await run.wait_quiet()
            assert sink.values == [2]  # given out as the node had ended, though it has a slot
            await run.trigger(goes.ring, 7)
            await run.wait_quiet()
            return list(sink.values), run.report().edges["goes.rang -> keep.value"].dropped

    assert drive(main) == ([2], 1)


@pytest.mark.rule("P9", "A9")
def test_operators_begin_afresh_with_the_node_of_the_event(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(Burst(count=2)), graph.add(Keep())
    graph.connect(source.rang, sink.value, through=[operators.count()])

    async def main() -> list[int]:
        async with hfg.running(graph, fast=fast) as run:
            await run.wait_quiet()
            await run.trigger(source.ports.slots["reset"])
            await run.wait_quiet()
            return list(sink.values)

    assert drive(main) == [2, 2]


class Echoes(hfg.Node):
    """Passes on what it is told."""

    said = hfg.Event(int)

    @hfg.slot
    def hit(self, value: int) -> None:
        self.said.trigger(value)


@pytest.mark.rule("F3")
def test_a_signal_is_on_its_edges_before_a_subscriber_hears_of_it(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(Echoes()), graph.add(Keep())
    graph.connect(source.said, sink.value)
    heard: list[int] = []

    async def main() -> list[int]:
        async with hfg.running(graph, fast=fast) as run:
            source.said.subscribe(lambda token: source.said.trigger(token.value + 1) if token.value < 3 else None)
            source.said.subscribe(lambda token: heard.append(token.value))
            await run.trigger(source.hit, 0)
            await run.wait_quiet()
            return list(sink.values)

    assert drive(main) == [0, 1, 2, 3]
    assert heard == [0, 1, 2, 3]


@pytest.mark.rule("P9")
def test_an_event_is_an_observable_of_tokens(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(Burst(count=3)), graph.add(Keep())
    graph.connect(source.rang, sink.value)
    doubled: list[int] = []
    plain: list[int] = []
    source.rang.pipe(operators.map(lambda token: token.value * 2)).subscribe(doubled.append)
    source.rang.subscribe(lambda token: plain.append(token.value))
    run(graph, fast)
    assert (plain, doubled, sink.values) == ([1, 2, 3], [2, 4, 6], [1, 2, 3])


@pytest.mark.rule("P9")
def test_an_event_without_an_edge_is_observed_too_and_completes_with_the_run(fast: bool) -> None:
    graph = hfg.Graph()
    source = graph.add(Burst(count=3))
    seen: list[int] = []
    completed: list[bool] = []
    source.rang.subscribe(lambda token: seen.append(token.value), on_completed=lambda: completed.append(True))
    run(graph, fast)
    assert seen == [1, 2, 3]
    assert completed == [True]


@pytest.mark.rule("P9")
def test_a_subscription_that_is_disposed_of_hears_no_more(fast: bool) -> None:
    graph = hfg.Graph()
    source = graph.add(Burst(count=3))
    seen: list[int] = []
    source.rang.pipe(operators.take(2)).subscribe(lambda token: seen.append(token.value))
    run(graph, fast)
    assert seen == [1, 2]


@pytest.mark.rule("P9", "R6")
def test_debounce_of_a_subscriber_uses_the_clock_of_the_run(fast: bool) -> None:
    async def main() -> list[tuple[int, float]]:
        graph = hfg.Graph()
        source = graph.add(Burst(count=3))
        seen: list[tuple[int, float]] = []
        async with hfg.running(graph, fast=fast) as run:
            source.rang.pipe(operators.debounce(0.5)).subscribe(lambda token: seen.append((token.value, run.now())))
            await run.wait_finished()
        return seen

    assert drive(main) == [(3, 0.5)]


@pytest.mark.rule("A9", "P9")
def test_automatic_events_are_observables_too(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(numbers(count=2)), graph.add(Keep())
    graph.connect(source.out, sink.value)
    seen: list[object] = []
    sink.processed.subscribe(lambda token: seen.append(token.value))
    run(graph, fast)
    assert seen == [None, None]


@pytest.mark.rule("A9", "P9")
def test_an_automatic_event_may_be_subscribed_to_while_the_graph_runs(fast: bool) -> None:
    async def main() -> list[float]:
        graph = hfg.Graph()
        source, sink = graph.add(slow_numbers(count=3)), graph.add(Keep())
        graph.connect(source.out, sink.value)
        seen: list[float] = []
        async with hfg.running(graph, fast=fast) as run:
            await asyncio.sleep(1.5)
            sink.processed.subscribe(lambda token: seen.append(token.stamp))
            await run.wait_finished()
        return seen

    assert drive(main) == [2, 3]


@pytest.mark.rule("P9")
def test_after_a_run_an_event_is_free_of_it() -> None:
    graph = hfg.Graph()
    source = graph.add(Burst(count=3))
    seen: list[int] = []
    for _ in range(2):
        subscribing = threading.Thread(target=lambda: source.rang.subscribe(lambda token: seen.append(token.value)))
        subscribing.start()
        subscribing.join()
        run(graph)
    assert seen == [1, 2, 3, 1, 2, 3]


@pytest.mark.rule("P9")
@pytest.mark.parametrize("target", ["input", "slot"])
def test_an_outside_observable_feeds_a_slot_or_an_input_and_holds_the_run_open(target: str, fast: bool) -> None:
    async def main() -> list[object]:
        graph = hfg.Graph()
        sink, ear = graph.add(Keep()), graph.add(Ear())
        subject: Subject[int] = Subject()
        if target == "input":
            graph.connect(subject, sink.value)
        else:
            graph.connect(subject, ear.hear)
        async with hfg.running(graph, fast=fast) as run:
            subject.on_next(1)
            subject.on_next(2)
            await run.wait_quiet()
            subject.on_next(3)
            subject.on_completed()
            report = await run.wait_finished()
            assert report.outcome == "done"
        return sink.values if target == "input" else ear.heard

    assert drive(main) == [1, 2, 3]


@pytest.mark.rule("P9")
def test_each_edge_from_an_observable_has_an_observer_of_its_own(fast: bool) -> None:
    async def main() -> list[object]:
        graph = hfg.Graph()
        ear = graph.add(Ear())
        first: Subject[int] = Subject()
        second: Subject[int] = Subject()
        graph.connect(first, ear.hear)
        graph.connect(second, ear.hear)
        async with hfg.running(graph, fast=fast) as run:
            first.on_next(1)
            first.on_completed()
            second.on_next(2)
            second.on_completed()
            await run.wait_finished()
        return ear.heard

    assert drive(main) == [1, 2]


@pytest.mark.rule("P9", "R5")
def test_an_observable_that_completes_at_once_feeds_all_it_has(fast: bool) -> None:
    graph = hfg.Graph()
    ear, sink = graph.add(Ear()), graph.add(Keep())
    graph.connect(reactivex.of(1, 2, 3), ear.hear)
    graph.connect(reactivex.of(4, 5), sink.value)
    run(graph, fast)
    assert ear.heard == [1, 2, 3]
    assert sink.values == [4, 5]


@pytest.mark.rule("P9", "R6")
def test_an_observable_of_time_feeds_on_the_clock_of_the_run(fast: bool) -> None:
    graph = hfg.Graph()
    sink = graph.add(Timed())
    graph.connect(reactivex.interval(0.5), sink.value, through=[operators.take(3)])
    assert run(graph, fast).outcome == "done"
    assert sink.seen == [(0, 0.5), (1, 1.0), (2, 1.5)]


@pytest.mark.rule("A10", "A14")
@pytest.mark.parametrize("edge", [True, False])
def test_who_subscribes_to_start_hears_of_it_with_or_without_an_edge(edge: bool, fast: bool) -> None:
    async def main() -> list[str]:
        graph = hfg.Graph()
        ear = graph.add(Ear())
        if edge:
            graph.connect(graph.start, ear.begin)
        story: list[str] = []
        graph.start.subscribe(
            lambda token: story.append(f"early {token.activity}"), on_completed=lambda: story.append("end")
        )
        async with hfg.running(graph, fast=fast) as run:
            graph.start.subscribe(lambda _: story.append("late"))
            run.reset_activity()
            await run.wait_quiet()
        async with hfg.running(graph, fast=fast):
            pass
        return story

    assert drive(main) == ["early 1", "early 1", "late", "end"]


@pytest.mark.rule("F10", "P9", "P10")
def test_nothing_is_sent_to_the_slot_of_a_disabled_node_from_outside() -> None:
    graph = hfg.Graph()
    ear, source = graph.add(Ear(), name="ear", enabled=False), Subject()
    graph.connect(source, ear.hear)

    async def main() -> hfg.Report:
        async with hfg.running(graph) as live:
            source.on_next(1)
            await live.trigger(ear.hear, 2)
            await live.wait_quiet()
            await live.trigger(ear.enable)
            await live.wait_quiet()
            source.on_next(3)
            await live.trigger(ear.hear, 4)
            await live.wait_quiet()
            await live.trigger(ear.disable)
            await live.wait_quiet()
            source.on_next(5)
            await live.trigger(ear.hear, 6)
            source.on_completed()
            return await live.wait_finished()

    report = drive(main)
    assert ear.heard == [3, 4]
    assert report.nodes["ear"].calls == 4
