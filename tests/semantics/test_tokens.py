"""Tokens: immutable, silent, marked, stamped, numbered (rules T1-T5)."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator

import pytest

import hfg
from hfg import END, NO_MESSAGE
from hfg.trace import TokenDrained, TokenTaken
from tests.semantics.nodes import (
    Countdown,
    Ear,
    Keep,
    KeepTokens,
    Ringing,
    Send,
    add,
    forward,
    gaps,
    modifiers,
    numbers,
    of_kind,
    only_odd,
    run,
    sent,
    slow_numbers,
    tokens,
    traced,
)


@pytest.mark.rule("T1")
def test_a_token_cannot_be_changed() -> None:
    token = hfg.Token(1)
    with pytest.raises(AttributeError):
        token.value = 2  # type: ignore[misc]


@hfg.node
def make_lists() -> Iterator[list[int]]:
    """One list, then the end."""
    yield [1]


@pytest.mark.rule("T1")
def test_fan_out_shares_the_value(fast: bool) -> None:
    graph = hfg.Graph()
    source = graph.add(make_lists())
    sinks = [graph.add(Keep()) for _ in range(3)]
    for sink in sinks:
        graph.connect(source.out, sink.value)
    run(graph, fast)
    first, second, third = (sink.values[0] for sink in sinks)
    assert first is second is third


@pytest.mark.rule("T1")
def test_an_edge_that_is_not_active_delivers_without_modifier(fast: bool) -> None:
    graph = hfg.Graph()
    source = graph.add(numbers(count=1))
    send = graph.add(Send(modifier=1))
    plain, double = graph.add(KeepTokens()), graph.add(KeepTokens())
    graph.connect(source.out, send.value)
    graph.connect(send.out, plain.value)
    graph.connect(send.out, double.value, active=True)
    run(graph, fast)
    assert [token.activity for token in plain.tokens] == [0]
    assert [token.activity for token in double.tokens] == [1]


@pytest.mark.rule("T2")
def test_none_returned_or_sent_is_silence() -> None:
    graph = hfg.Graph()
    source = graph.add(numbers(count=3))
    odd = graph.add(only_odd())
    send = graph.add(SendNone())
    sinks = [graph.add(Keep()) for _ in range(2)]
    graph.connect(source.out, odd.value)
    graph.connect(odd.out, sinks[0].value)
    graph.connect(source.out, send.value)
    graph.connect(send.out, sinks[1].value)
    trace = traced(graph)
    assert sent(trace, "only_odd.out -> keep.value") == [1, NO_MESSAGE, 3, END]
    assert sent(trace, "send_none.out -> keep_2.value") == [NO_MESSAGE, NO_MESSAGE, NO_MESSAGE, END]
    assert sinks[0].values == [1, 3]
    assert sinks[1].values == []


class SendNone(hfg.Node):
    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> None:
        self.out.send(None)


@pytest.mark.rule("T2")
def test_a_generator_that_yields_none_is_silent_once(fast: bool) -> None:
    graph = hfg.Graph()
    source = graph.add(gaps(count=4))
    sink = graph.add(Keep())
    graph.connect(source.out, sink.value)
    report = run(graph, fast)
    assert sink.values == [1, 3]
    assert report.nodes["keep"].silent == 2


@pytest.mark.rule("T2")
def test_a_signal_without_a_value_is_delivered_as_none_to_slot_and_input(fast: bool) -> None:
    graph = hfg.Graph()
    ear = graph.add(Ear())
    slot, sink = graph.add(Ear(), name="slot"), graph.add(Keep())
    graph.connect(graph.start, ear.poke)
    graph.connect(ear.poked, slot.hear)
    graph.connect(ear.poked, sink.value)
    run(graph, fast)
    assert slot.heard == [None]
    assert sink.values == [None]


@pytest.mark.rule("T3")
def test_no_message_carries_nothing_even_from_an_active_node() -> None:
    graph = hfg.Graph()
    source = graph.add(numbers(count=2))
    odd = graph.add(OddWithSlot())
    sink = graph.add(KeepTokens())
    graph.connect(source.out, odd.value)
    graph.start.activates(odd.begin)
    graph.connect(odd.out, sink.value, active=True)
    trace = traced(graph)
    assert sent(trace, "odd_with_slot.out -> keep_tokens.value") == [NO_MESSAGE, 2, END]
    assert modifiers(trace, "odd_with_slot.out -> keep_tokens.value") == [0, 1, 0]


class OddWithSlot(hfg.Node):
    """Silent for odd values; can be made active."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int | None:
        return None if value % 2 else value

    @hfg.slot
    def begin(self) -> None:
        pass


@pytest.mark.rule("T3")
def test_events_never_carry_no_message() -> None:
    graph = hfg.Graph()
    source = graph.add(gaps(count=4))
    send = graph.add(Send())
    ear = graph.add(Ear())
    graph.connect(source.out, send.value)
    graph.connect(send.rang, ear.hear)
    trace = traced(graph)
    assert sent(trace, "send.rang -> ear.hear") == [1, 3]
    assert NO_MESSAGE not in ear.heard


@pytest.mark.rule("T4")
def test_end_is_the_last_token_on_all_outputs_of_a_node_that_ends() -> None:
    graph = hfg.Graph()
    source = graph.add(numbers(count=2))
    sinks = [graph.add(Keep()) for _ in range(2)]
    for sink in sinks:
        graph.connect(source.out, sink.value)
    trace = traced(graph)
    for name in ("keep", "keep_2"):
        assert sent(trace, f"numbers.out -> {name}.value") == [1, 2, END]


@pytest.mark.rule("T4", "A3")
def test_end_carries_activity_over_an_active_edge_like_any_value(fast: bool) -> None:
    graph = hfg.Graph()
    node, sink = graph.add(EndWithSlot()), graph.add(Ear())
    source = graph.add(numbers(count=1))
    graph.connect(source.out, node.value)
    graph.start.activates(node.begin)
    graph.connect(node.out, sink.hear, active=True)
    report = run(graph, fast)
    assert report.nodes["end_with_slot"].active is False
    assert report.nodes["ear"].active is True
    assert sink.heard == []


class EndWithSlot(hfg.Node):
    """Never writes anything; can be made active."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> None:
        return None

    @hfg.slot
    def begin(self) -> None:
        pass


@pytest.mark.rule("T4")
def test_events_of_an_ended_node_carry_no_end_to_slots() -> None:
    graph = hfg.Graph()
    source = graph.add(Ringing(count=2))
    ear = graph.add(Ear())
    graph.connect(source.rang, ear.hear)
    trace = traced(graph)
    assert sent(trace, "ringing.rang -> ear.hear") == [1, 2]


@pytest.mark.rule("T4")
def test_markers_into_a_slot_are_processed_at_once_without_a_call(fast: bool) -> None:
    graph = hfg.Graph()
    source = graph.add(gaps(count=4))
    ear = graph.add(Ear())
    graph.connect(source.out, ear.hear)
    report = run(graph, fast)
    assert ear.heard == [1, 3]
    assert report.nodes["ear"].calls == 2


@pytest.mark.rule("T4")
def test_markers_into_a_slot_are_traced_as_drained() -> None:
    graph = hfg.Graph()
    source = graph.add(gaps(count=2))
    ear = graph.add(Ear())
    graph.connect(source.out, ear.hear)
    trace = traced(graph)
    assert [event.token.value for event in of_kind(trace, TokenDrained)] == [NO_MESSAGE, END]
    assert [event.token.value for event in of_kind(trace, TokenTaken)] == [1]


@pytest.mark.rule("T5")
def test_a_source_stamps_with_the_start_of_its_firing(fast: bool) -> None:
    graph = hfg.Graph()
    source = graph.add(slow_numbers(count=3, pause_s=2))
    sink = graph.add(KeepTokens())
    graph.connect(source.out, sink.value)
    run(graph, fast)
    assert [token.stamp for token in sink.tokens] == [0, 2, 4]


@pytest.mark.rule("T5")
def test_others_stamp_with_the_newest_value_they_took(fast: bool) -> None:
    graph = hfg.Graph()
    early, late = graph.add(Countdown(count=1)), graph.add(slow_numbers(count=1, pause_s=1))
    later = graph.add(Delayed())
    sum_, sink = graph.add(add()), graph.add(KeepTokens())
    graph.connect(early.out, sum_.a)
    graph.connect(late.out, later.value)
    graph.connect(later.out, sum_.b)
    graph.connect(sum_.out, sink.value)
    run(graph, fast)
    assert [token.stamp for token in sink.tokens] == [0.5]


class Delayed(hfg.Node):
    """Sets the stamp itself."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    rang = hfg.Event(int)

    def process(self, value: int) -> None:
        self.rang.trigger(value, stamp=7.5)
        self.out.send(value, stamp=0.5)


@pytest.mark.rule("T5")
def test_a_node_may_set_the_stamp_of_values_and_signals(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=1)), graph.add(Delayed())
    by_output, by_event = graph.add(KeepTokens()), graph.add(KeepTokens())
    graph.connect(source.out, node.value)
    graph.connect(node.out, by_output.value)
    graph.connect(node.rang, by_event.value)
    run(graph, fast)
    assert [token.stamp for token in by_output.tokens] == [0.5]
    assert [token.stamp for token in by_event.tokens] == [7.5]


@pytest.mark.rule("T5")
def test_silence_is_stamped_by_the_markers_if_no_value_was_taken() -> None:
    graph = hfg.Graph()
    source, first, second = graph.add(slow_gaps()), graph.add(forward()), graph.add(forward())
    sink = graph.add(Keep())
    graph.connect(source.out, first.value)
    graph.connect(first.out, second.value)
    graph.connect(second.out, sink.value)
    trace = traced(graph)
    sent, last = tokens(trace, "slow_gaps.out -> forward.value")[0], tokens(trace, "forward_2.out -> keep.value")[0]
    assert (last.value, last.stamp) == (NO_MESSAGE, sent.stamp)


@hfg.node
async def slow_gaps() -> AsyncIterator[int | None]:
    """Silence after a second."""
    await asyncio.sleep(1)
    yield None


@pytest.mark.rule("T5")
def test_automatic_signals_are_stamped_now(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=1)), graph.add(forward_after())
    sink = graph.add(KeepTokens())
    graph.connect(source.out, node.value)
    graph.connect(node.processed, sink.value)
    run(graph, fast)
    assert [token.stamp for token in sink.tokens] == [3]


@hfg.node
async def forward_after(value: int) -> int:
    """After three seconds."""
    await asyncio.sleep(3)
    return value


@pytest.mark.rule("T5")
def test_every_token_on_an_edge_takes_the_next_number_markers_too() -> None:
    graph = hfg.Graph()
    source, sink = graph.add(gaps(count=3)), graph.add(Keep())
    graph.connect(source.out, sink.value)
    trace = traced(graph)
    assert [token.sequence for token in tokens(trace, "gaps.out -> keep.value")] == [1, 2, 3, 4]


@pytest.mark.rule("T5", "P5")
def test_a_dropped_token_leaves_a_gap_in_the_numbers(fast: bool) -> None:
    graph = hfg.Graph()
    source = graph.add(Ringing(count=1, burst=5))
    sink = graph.add(KeepTokens())
    graph.connect(source.rang, sink.value, capacity=2, overflow="drop_oldest")
    run(graph, fast)
    assert [token.sequence for token in sink.tokens] == [4, 5]


@pytest.mark.rule("T5", "P5")
def test_a_token_that_is_not_sent_takes_no_number(fast: bool) -> None:
    graph = hfg.Graph()
    source = graph.add(TriesAgain())
    sink = graph.add(KeepTokens())
    graph.connect(source.rang, sink.value, capacity=1, overflow="error")
    run(graph, fast)
    assert [(token.value, token.sequence) for token in sink.tokens] == [(1, 1), (4, 2)]


class TriesAgain(hfg.Node):
    """Triggers twice in each firing, which one place does not hold."""

    rang = hfg.Event(int)
    count = hfg.State(0)

    def process(self) -> None:
        if self.count == 2:
            raise hfg.EndOfStream
        self.count += 1
        self.rang.trigger(3 * self.count - 2)
        with pytest.raises(hfg.errors.QueueOverflow):
            self.rang.trigger(3 * self.count - 1)
