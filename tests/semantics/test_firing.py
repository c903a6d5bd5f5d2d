"""When a node fires, and what a firing takes and gives (rules F1-F3)."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator

import pytest

import hfg
from hfg import END, NO_MESSAGE
from hfg.trace import TokenSent
from tests.semantics.nodes import (
    Countdown,
    Ear,
    Fork,
    Keep,
    KeepTokens,
    add,
    drive,
    forward_later,
    gaps,
    merge,
    numbers,
    of_kind,
    run,
    sent,
    slow_numbers,
    split,
    traced,
)

# --- F1 ---


@pytest.mark.rule("F1")
def test_a_node_waits_until_every_live_input_holds_a_token(fast: bool) -> None:
    graph = hfg.Graph()
    first, second = graph.add(numbers(count=3)), graph.add(slow_numbers(count=3, pause_s=1))
    node, sink = graph.add(add()), graph.add(Keep())
    graph.connect(first.out, node.a)
    graph.connect(second.out, node.b)
    graph.connect(node.out, sink.value)
    report = run(graph, fast)
    assert sink.values == [2, 4, 6]
    assert report.nodes["add"].firings == 4  # the end too


@pytest.mark.rule("F1")
def test_a_node_whose_mandatory_input_is_unconnected_never_fires(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(Countdown(count=1)), graph.add(add())
    graph.connect(source.out, node.a)
    with pytest.raises(hfg.errors.Stalled, match='"add" waits for its unconnected input "b"'):
        run(graph, fast)


@pytest.mark.rule("F1", "F2")
def test_a_node_with_no_live_input_is_no_source_and_never_fires(fast: bool) -> None:
    graph = hfg.Graph()
    node, sink = graph.add(merge()), graph.add(Keep())
    graph.connect(node.out, sink.value)
    assert run(graph, fast).firings == 0


@pytest.mark.rule("F1")
def test_outputs_that_lead_nowhere_are_always_free(fast: bool) -> None:
    graph = hfg.Graph()
    graph.add(numbers(count=5))
    assert run(graph, fast).nodes["numbers"].firings == 6


@pytest.mark.rule("F1")
def test_a_node_waits_until_its_outputs_are_processed(fast: bool) -> None:
    graph = hfg.Graph()
    source, quick, slow = graph.add(numbers(count=3)), graph.add(KeepTokens()), graph.add(forward_later())
    graph.connect(source.out, quick.value)
    graph.connect(source.out, slow.value)
    run(graph, fast)
    assert [token.stamp for token in quick.tokens] == [0, 1, 2]


class Moody(hfg.Node):
    """Ready as often as `moods` says."""

    value = hfg.Input(int)
    values = hfg.State(factory=list)
    asked = hfg.State(0)
    moods = hfg.State(factory=list)

    def setup(self) -> None:
        self.moods = [True, False, True, True]

    def ready(self) -> bool:
        self.asked += 1
        return self.moods.pop(0) if self.moods else True

    def process(self, value: int) -> None:
        self.values.append(value)

    @hfg.slot
    def nudge(self) -> None:
        pass


@pytest.mark.rule("F1")
def test_ready_is_asked_last_and_again_when_woken(fast: bool) -> None:
    async def main() -> list[object]:
        graph = hfg.Graph()
        node = graph.add(Moody())
        graph.connect(graph.input("in", int), node.value)
        async with hfg.running(graph, fast=fast) as run:
            await run.wait_quiet()
            story: list[object] = [node.asked]  # no token: not asked
            async with run.feed("in") as feed:
                await feed.send(1)
                sending = asyncio.create_task(feed.send(2))
                await run.wait_quiet()
                story += [node.asked, list(node.values)]
                run.wake(node)
                await sending
                story += [node.asked, list(node.values)]
        return story

    assert drive(main) == [0, 2, [1], 3, [1, 2]]


@pytest.mark.rule("F1")
def test_ready_is_asked_again_after_each_call(fast: bool) -> None:
    async def main() -> list[int]:
        graph = hfg.Graph()
        node = graph.add(Moody())
        graph.connect(graph.input("in", int), node.value)
        async with hfg.running(graph, fast=fast) as run, run.feed("in") as feed:
            await feed.send(1)
            sending = asyncio.create_task(feed.send(2))
            await run.wait_quiet()
            await run.trigger(node.nudge)
            await sending
        return node.values

    assert drive(main) == [1, 2]


class AsyncReady(hfg.Node):
    """Waits in ready()."""

    value = hfg.Input(int)
    times = hfg.State(factory=list)

    async def ready(self) -> bool:
        await asyncio.sleep(1)
        return True

    def process(self, value: int) -> None:
        self.times.append(hfg.now())


@pytest.mark.rule("F1")
def test_ready_may_be_async(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=2)), graph.add(AsyncReady())
    graph.connect(source.out, node.value)
    run(graph, fast)
    assert node.times == [1, 2]


# --- F2 ---


@pytest.mark.rule("F2")
def test_each_yield_of_a_generator_is_one_firing(fast: bool) -> None:
    graph = hfg.Graph()
    graph.add(gaps(count=6))
    assert run(graph, fast).nodes["gaps"].firings == 7  # the last finds its end


@pytest.mark.rule("F2")
def test_a_class_without_inputs_is_a_source_that_ends_by_end_of_stream(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(Countdown(count=4)), graph.add(Keep())
    graph.connect(source.out, sink.value)
    report = run(graph, fast)
    assert sink.values == [3, 2, 1, 0]
    assert report.nodes["countdown"].ended


@hfg.node
def raises_at_third() -> Iterator[int]:
    """A generator whose code ends the stream from below."""
    yield 1
    yield 2
    raise hfg.EndOfStream


@pytest.mark.rule("F2")
def test_a_generator_may_raise_end_of_stream(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(raises_at_third()), graph.add(Keep())
    graph.connect(source.out, sink.value)
    run(graph, fast)
    assert sink.values == [1, 2]


@hfg.node
def endless() -> int:
    """A source without rate or end."""
    return 1


@pytest.mark.rule("F2")
def test_the_check_warns_of_a_source_that_has_no_rate_never_ends_and_waits_for_nothing() -> None:
    graph = hfg.Graph()
    graph.add(endless(), name="bare")
    graph.add(endless(), name="paced", max_rate_hz=1)
    graph.add(Countdown())
    alone = [problem for problem in graph.check() if problem.check != "unconnected-graph"]
    assert [(problem.severity, problem.path) for problem in alone] == [("warning", "bare")]


@pytest.mark.rule("F2")
def test_a_node_without_a_process_function_never_fires(fast: bool) -> None:
    graph = hfg.Graph()
    source, ear = graph.add(numbers(count=2)), graph.add(Ear())
    graph.connect(source.out, ear.hear)
    report = run(graph, fast)
    assert (report.nodes["ear"].firings, report.nodes["ear"].calls) == (0, 2)


# --- F3 ---


@pytest.mark.rule("F3")
def test_a_firing_puts_one_token_on_every_edge_of_every_output() -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=4)), graph.add(split())
    sinks = [graph.add(Keep()) for _ in range(4)]
    graph.connect(source.out, node.value)
    for output, sink in zip((node.small, node.small, node.big, node.big), sinks, strict=True):
        graph.connect(output, sink.value)
    trace = traced(graph)
    for name in ("keep", "keep_2"):
        assert sent(trace, f"split.small -> {name}.value") == [1, 2, NO_MESSAGE, NO_MESSAGE, END]
    for name in ("keep_3", "keep_4"):
        assert sent(trace, f"split.big -> {name}.value") == [NO_MESSAGE, NO_MESSAGE, 3, 4, END]


@pytest.mark.rule("F3")
def test_signals_leave_when_triggered_and_outputs_together_in_order_of_declaration() -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=1)), graph.add(Fork())
    graph.connect(source.out, node.value)
    ear, second, first = graph.add(Ear()), graph.add(Keep(), name="second"), graph.add(Keep(), name="first")
    graph.connect(node.second, ear.hear)
    graph.connect(node.b, second.value)
    graph.connect(node.a, first.value)
    leaving = [event.edge for event in of_kind(traced(graph), TokenSent) if event.edge.startswith("fork")]
    assert leaving[:3] == ["fork.second -> ear.hear", "fork.a -> first.value", "fork.b -> second.value"]


class FailsLate(hfg.Node):
    """Triggers and sends, then fails."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    rang = hfg.Event(int)

    def process(self, value: int) -> None:
        self.rang.trigger(value)
        self.out.send(value)
        raise ValueError("late")


@pytest.mark.rule("F3", "X1")
def test_the_signals_of_a_failing_firing_have_left_its_outputs_have_not(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=2)), graph.add(FailsLate(), on_error="skip")
    ear, sink = graph.add(Ear()), graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(node.rang, ear.hear)
    graph.connect(node.out, sink.value)
    report = run(graph, fast)
    assert ear.heard == [1, 2]
    assert sink.values == []
    assert report.edges["fails_late.out -> keep.value"].sent == 3


class FromThread(hfg.Node):
    """Triggers from its thread."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    rang = hfg.Event(object)

    def process(self, value: int) -> int:
        for number in range(3):
            self.rang.trigger((value, number))
        self.rang.trigger(threading.current_thread().name)
        return value


@pytest.mark.rule("F3", "R1")
def test_signals_from_a_thread_leave_in_order_and_before_the_outputs() -> None:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    source, node = graph.add(numbers(count=2)), graph.add(FromThread(), group="work")
    ear, sink = graph.add(Ear()), graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(node.rang, ear.hear)
    graph.connect(node.out, sink.value)
    trace = traced(graph)
    work = "hfg group work"
    assert ear.heard == [(1, 0), (1, 1), (1, 2), work, (2, 0), (2, 1), (2, 2), work]
    order = [event.edge for event in of_kind(trace, TokenSent) if event.edge.startswith("from_thread")]
    assert order.index("from_thread.out -> keep.value") == 4
