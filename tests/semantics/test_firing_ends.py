"""Silence and the end of nodes, and when a token counts as processed (rules F4-F6)."""

from __future__ import annotations

import asyncio

import pytest

import hfg
from hfg import END
from hfg.trace import EventTriggered, FiringEnded, TokenDropped, TokenProcessed, TokenSent
from tests.semantics.nodes import (
    Hooks,
    Keep,
    KeepTokens,
    Ringing,
    Send,
    Total,
    add,
    add_optional,
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
    traced,
)

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
def test_pipelined_a_token_is_processed_when_it_is_taken() -> None:
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
