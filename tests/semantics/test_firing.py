"""When a node fires, what a firing takes and gives, when it ends (rules F1-F6)."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator

import pytest

import hfg
from hfg import END, NO_MESSAGE
from hfg.trace import EventTriggered, FiringEnded, TokenDropped, TokenProcessed, TokenSent
from tests.semantics.nodes import (
    Countdown,
    Ear,
    Fork,
    Hooks,
    Keep,
    KeepTokens,
    Ringing,
    Send,
    Total,
    add,
    add_optional,
    drive,
    fail_on,
    firings,
    forward,
    forward_later,
    gaps,
    merge,
    numbers,
    of_kind,
    only_odd,
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


@pytest.mark.rule("F2")
def test_only_a_source_can_end_its_stream(fast: bool) -> None:
    @hfg.node
    def give_up(value: int) -> int:
        raise hfg.EndOfStream

    graph = hfg.Graph()
    source, node = graph.add(numbers(count=1)), graph.add(give_up())
    graph.connect(source.out, node.value)
    with pytest.raises(hfg.errors.NodeError, match="only a source can end its stream"):
        run(graph, fast)


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


# --- F4 ---


@pytest.mark.rule("F4")
def test_silence_on_a_mandatory_input_makes_a_silent_firing(fast: bool) -> None:
    graph = hfg.Graph()
    source, other = graph.add(gaps(count=3)), graph.add(numbers(count=3))
    node, sink = graph.add(add()), graph.add(Keep())
    graph.connect(source.out, node.a)
    graph.connect(other.out, node.b)
    graph.connect(node.out, sink.value)
    report = run(graph, fast)
    assert sink.values == [2, 6]
    assert (report.nodes["add"].silent, report.nodes["keep"].silent) == (1, 1)


@pytest.mark.rule("F4")
def test_without_mandatory_inputs_a_node_is_silent_if_no_input_holds_a_value() -> None:
    graph = hfg.Graph()
    a, b = graph.add(gaps(count=2)), graph.add(gaps(count=2))
    node = graph.add(merge())
    graph.connect(a.out, node.a)
    graph.connect(b.out, node.b)
    assert firings(traced(graph), "merge") == ["process", "silent", "end"]


@pytest.mark.rule("F4")
def test_end_on_a_mandatory_input_ends_the_node_and_drops_the_values_taken_with_it() -> None:
    graph = hfg.Graph()
    short, long = graph.add(numbers(count=1)), graph.add(numbers(count=3))
    node, sink = graph.add(add()), graph.add(Keep())
    graph.connect(short.out, node.a)
    graph.connect(long.out, node.b)
    graph.connect(node.out, sink.value)
    trace = traced(graph)
    assert sink.values == [2]
    assert firings(trace, "add") == ["process", "end"]
    assert [(event.token.value, event.reason) for event in of_kind(trace, TokenDropped)] == [(2, "ended")]


@pytest.mark.rule("F4")
def test_what_end_writes_goes_out_as_one_full_firing_and_end_follows(fast: bool) -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(numbers(count=3)), graph.add(Total()), graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    report = run(graph, fast)
    assert sink.values == [6]
    assert report.edges["total.out -> keep.value"].sent == 5  # three silences, the total, END


@pytest.mark.rule("F4")
def test_an_end_hook_that_writes_nothing_sends_end_alone() -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(numbers(count=1)), graph.add(Hooks()), graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    trace = traced(graph)
    assert node.story == ["setup", 1, "end", "teardown"]
    assert sent(trace, "hooks.out -> keep.value") == [1, END]


@pytest.mark.rule("F4")
def test_end_waits_until_the_outputs_are_free() -> None:
    graph = hfg.Graph()
    source, node, slow = graph.add(numbers(count=2)), graph.add(Total()), graph.add(forward_later())
    graph.connect(source.out, node.value)
    graph.connect(node.out, slow.value)
    edge = "total.out -> forward_later.value"
    times = [(event.token.value, event.time) for event in of_kind(traced(graph), TokenSent) if event.edge == edge]
    assert times[-2:] == [(3, 0), (END, 1)]


@pytest.mark.rule("F4", "P6")
def test_end_on_an_optional_input_means_absent_from_now_on(fast: bool) -> None:
    graph = hfg.Graph()
    long, short = graph.add(numbers(count=4)), graph.add(numbers(count=2))
    node, sink = graph.add(add_optional()), graph.add(Keep())
    graph.connect(long.out, node.a)
    graph.connect(short.out, node.b)
    graph.connect(node.out, sink.value)
    run(graph, fast)
    assert sink.values == [2, 4, 103, 104]


@pytest.mark.rule("F4")
def test_a_node_ends_when_all_its_optional_inputs_have(fast: bool) -> None:
    graph = hfg.Graph()
    long, short = graph.add(numbers(count=3)), graph.add(numbers(count=1))
    node, sink = graph.add(merge()), graph.add(Keep())
    graph.connect(long.out, node.a)
    graph.connect(short.out, node.b)
    graph.connect(node.out, sink.value)
    report = run(graph, fast)
    assert sink.values == [(1, 1), (2, None), (3, None)]
    assert report.nodes["merge"].ended


@pytest.mark.rule("F4", "P7")
def test_edges_with_initial_tokens_do_not_count_for_the_end(fast: bool) -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(numbers(count=2)), graph.add(merge_first()), graph.add(Keep())
    graph.connect(source.out, node.a)
    graph.connect(node.out, node.b, initial=[0])
    graph.connect(node.out, sink.value)
    report = run(graph, fast)
    assert sink.values == [1, 3]
    assert report.nodes["merge_first"].ended


@hfg.node
def merge_first(a: int | None = None, b: int | None = None) -> int:
    """The sum of what is there."""
    return (a or 0) + (b or 0)


# --- F5 ---


def released(release: str, **options: object) -> list[tuple[str, float]]:
    """When the token of a source before a quick node counts as processed, with a slow one behind."""
    graph = hfg.Graph()
    source, quick = graph.add(numbers(count=1)), graph.add(forward(), release=release)  # type: ignore[arg-type]
    slow = graph.add(forward_later())
    graph.connect(source.out, quick.value)
    graph.connect(quick.out, slow.value)
    return [(event.edge, event.time) for event in of_kind(traced(graph), TokenProcessed)][:2]


@pytest.mark.rule("F5")
def test_sequential_a_token_is_processed_when_all_it_led_to_is() -> None:
    expected = [("forward.out -> forward_later.value", 1), ("numbers.out -> forward.value", 1)]
    assert released("sequential") == expected
    assert released("auto") == expected  # one group


@pytest.mark.rule("F5")
def test_pipelined_a_token_is_processed_when_the_firing_is_over() -> None:
    assert released("pipelined")[0] == ("numbers.out -> forward.value", 0)


@pytest.mark.rule("F5")
def test_auto_is_pipelined_where_the_edge_crosses_groups() -> None:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    source, node = graph.add(numbers(count=1)), graph.add(forward(), group="work")
    slow = graph.add(forward_later())
    graph.connect(source.out, node.value)
    graph.connect(node.out, slow.value)
    first = of_kind(traced(graph), TokenProcessed)[0]
    assert (first.edge, first.time) == ("numbers.out -> forward.value", 0)


@pytest.mark.rule("F5")
def test_signals_do_not_count_for_processed() -> None:
    graph = hfg.Graph()
    source, send, slow = graph.add(numbers(count=1)), graph.add(Send()), graph.add(forward_later())
    graph.connect(source.out, send.value)
    graph.connect(send.rang, slow.value)
    first = of_kind(traced(graph), TokenProcessed)[0]
    assert (first.edge, first.time) == ("numbers.out -> send.value", 0)


@pytest.mark.rule("F5")
def test_a_source_waits_for_the_slowest_branch_of_a_wave(fast: bool) -> None:
    graph = hfg.Graph()
    source, a, b = graph.add(numbers(count=2)), graph.add(forward()), graph.add(forward_later())
    node, sink = graph.add(add()), graph.add(KeepTokens())
    graph.connect(source.out, a.value)
    graph.connect(source.out, b.value)
    graph.connect(a.out, node.a)
    graph.connect(b.out, node.b)
    graph.connect(node.out, sink.value)
    run(graph, fast)
    assert [(token.value, token.stamp) for token in sink.tokens] == [(2, 0), (4, 1)]


# --- F6 ---


class SlowSlot(hfg.Node):
    """A call takes a second."""

    heard = hfg.State(factory=list)
    passed = hfg.Event(int)

    @hfg.slot
    async def hear(self, value: int) -> None:
        await asyncio.sleep(1)
        self.heard.append((value, hfg.now()))
        self.passed.trigger(value)


@pytest.mark.rule("F6")
def test_an_output_into_a_slot_waits_for_the_call_but_not_for_its_signals(fast: bool) -> None:
    graph = hfg.Graph()
    source, slot, last = graph.add(numbers(count=3)), graph.add(SlowSlot()), graph.add(SlowSlot())
    graph.connect(source.out, slot.hear)
    graph.connect(slot.passed, last.hear)
    run(graph, fast)
    assert slot.heard == [(1, 1), (2, 2), (3, 3)]
    assert last.heard == [(1, 2), (2, 3), (3, 4)]


@pytest.mark.rule("F6")
def test_signals_into_an_input_wait_for_the_join_and_are_never_overwritten(fast: bool) -> None:
    graph = hfg.Graph()
    rings, late = graph.add(Ringing(count=3)), graph.add(slow_numbers(count=3, pause_s=10))
    node, sink = graph.add(add()), graph.add(Keep())
    graph.connect(rings.rang, node.a)
    graph.connect(late.out, node.b)
    graph.connect(node.out, sink.value)
    run(graph, fast)
    assert sink.values == [2, 4, 6]


@pytest.mark.rule("F3")
def test_the_outcome_of_every_firing_is_traced() -> None:
    graph = hfg.Graph()
    source, node, odd = graph.add(numbers(count=3)), graph.add(fail_on(), on_error="skip"), graph.add(only_odd())
    graph.connect(source.out, node.value)
    graph.connect(node.out, odd.value)
    trace = traced(graph)
    ended = [(event.node, event.outcome) for event in of_kind(trace, FiringEnded)]
    assert [outcome for name, outcome in ended if name == "fail_on"] == ["done", "failed", "done", "ended"]
    assert [outcome for name, outcome in ended if name == "only_odd"] == ["done", "silent", "done", "ended"]
    assert of_kind(trace, EventTriggered) == []
