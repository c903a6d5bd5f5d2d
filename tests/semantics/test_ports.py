"""Ports and edges: what an edge holds, drops and delays; parameters as ports (rules P1-P8)."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator

import pytest
from reactivex import operators

import hfg
from hfg import END, NO_MESSAGE
from hfg.trace import ParameterSet, TokenDropped, TokenSent
from tests.semantics.nodes import (
    Burst,
    Ear,
    Keep,
    KeepTokens,
    Ringing,
    Send,
    add,
    add_optional,
    forward,
    forward_later,
    gaps,
    merge,
    numbers,
    of_kind,
    only_odd,
    run,
    scale,
    sent,
    slow_numbers,
    tokens,
    traced,
)

# --- P1, P2, P3 ---


@pytest.mark.rule("P1")
@pytest.mark.parametrize("source", ["out", "rang"])
@pytest.mark.parametrize("target", ["value", "hear"])
def test_all_four_kinds_of_edge_deliver_all_values_in_order(source: str, target: str, fast: bool) -> None:
    graph = hfg.Graph()
    origin, send = graph.add(numbers(count=50)), graph.add(Send())
    sink: Keep | Ear = graph.add(Keep() if target == "value" else Ear())
    graph.connect(origin.out, send.value)
    graph.connect(getattr(send, source), getattr(sink, target))
    run(graph, fast)
    assert (sink.values if isinstance(sink, Keep) else sink.heard) == list(range(1, 51))


@pytest.mark.rule("P2")
def test_an_input_takes_one_edge_and_the_rest_any_number(fast: bool) -> None:
    graph = hfg.Graph()
    first, second = graph.add(Ringing(count=1)), graph.add(Ringing(count=1))
    keep, others = graph.add(Keep()), [graph.add(Ear()) for _ in range(2)]
    graph.connect(first.rang, keep.value)
    with pytest.raises(hfg.errors.ConnectionError, match="takes one edge"):
        graph.connect(second.rang, keep.value)
    for ear in others:
        graph.connect(first.rang, ear.hear)
        graph.connect(second.rang, ear.hear)
    with pytest.raises(hfg.errors.ConnectionError, match="connected already"):
        graph.connect(first.rang, others[0].hear)
    run(graph, fast)
    assert keep.values == [1]
    assert [ear.heard for ear in others] == [[1, 1], [1, 1]]


@hfg.node
def words() -> Iterator[str]:
    """One word."""
    yield "one"


@pytest.mark.rule("P3")
def test_types_that_do_not_fit_are_refused_and_both_ports_named() -> None:
    graph = hfg.Graph()
    source, sink = graph.add(words()), graph.add(forward())
    with pytest.raises(hfg.errors.ConnectionError, match=r'"forward.value" expects int, "words.out" sends str'):
        graph.connect(source.out, sink.value)
    assert graph.edges == []


# --- P4, P5 ---


@pytest.mark.rule("P4", "F1")
def test_a_synchronous_edge_holds_one_token_so_the_producer_waits_for_the_consumer() -> None:
    graph = hfg.Graph()
    source, slow = graph.add(numbers(count=3)), graph.add(forward_later())
    graph.connect(source.out, slow.value)
    trace = traced(graph)
    assert [token.stamp for token in tokens(trace, "numbers.out -> forward_later.value")][:3] == [0, 1, 2]


@pytest.mark.rule("P4")
def test_a_queue_or_policy_on_a_synchronous_edge_is_refused() -> None:
    graph = hfg.Graph()
    source, sink = graph.add(numbers()), graph.add(Keep())
    for options in ({"capacity": 3}, {"overflow": "drop_oldest"}, {"capacity_limit": 20}):
        with pytest.raises(hfg.errors.ConnectionError, match="hold one token and no queue"):
            graph.connect(source.out, sink.value, **options)


@pytest.mark.rule("P5")
@pytest.mark.parametrize(
    ("overflow", "kept"),
    [("wait", [1, 2, 3, 4, 5]), ("drop_oldest", [4, 5]), ("drop_newest", [1, 2]), ("latest", [5])],
)
@pytest.mark.parametrize("into", ["input", "slot"])
def test_every_overflow_policy_keeps_what_it_says(overflow: str, kept: list[int], into: str, fast: bool) -> None:
    graph = hfg.Graph()
    burst, sink, ear = graph.add(Burst(count=5)), graph.add(Keep()), graph.add(Ear())
    target = sink.value if into == "input" else ear.hear
    capacity = 16 if overflow == "latest" else 2
    edge = graph.connect(burst.rang, target, overflow=overflow, capacity=capacity)  # type: ignore[call-overload]
    report = run(graph, fast)
    assert (sink.values if into == "input" else ear.heard) == kept
    assert report.edges[edge.label].dropped == 5 - len(kept)
    assert report.edges[edge.label].sent == 5 + (into == "input")


@pytest.mark.rule("P5")
def test_the_default_capacity_is_16_untaken_tokens(fast: bool) -> None:
    graph = hfg.Graph()
    burst, sink = graph.add(Burst(count=20)), graph.add(Keep())
    graph.connect(burst.rang, sink.value, overflow="drop_newest")
    run(graph, fast)
    assert sink.values == list(range(1, 17))


@pytest.mark.rule("P5")
def test_policy_error_is_raised_in_the_trigger_before_anything_of_it_is_sent(fast: bool) -> None:
    graph = hfg.Graph()
    burst, sink, ear = graph.add(Burst(count=3)), graph.add(Keep()), graph.add(Ear())
    graph.connect(burst.rang, ear.hear)
    graph.connect(burst.rang, sink.value, capacity=2, overflow="error")
    with pytest.raises(hfg.errors.NodeError, match=r'node "burst" failed in firing 1: QueueOverflow') as raised:
        run(graph, fast)
    assert isinstance(raised.value.__cause__, hfg.errors.QueueOverflow)
    assert raised.value.report.edges["burst.rang -> ear.hear"].sent == 2  # type: ignore[attr-defined]


@pytest.mark.rule("P5")
def test_a_dropped_token_is_traced() -> None:
    graph = hfg.Graph()
    burst, sink = graph.add(Burst(count=3)), graph.add(Keep())
    graph.connect(burst.rang, sink.value, overflow="latest")
    dropped = of_kind(traced(graph), TokenDropped)
    assert [(event.token.value, event.reason) for event in dropped] == [(1, "overflow"), (2, "overflow")]


@pytest.mark.rule("P5", "P9")
def test_an_active_edge_is_always_lossless() -> None:
    graph = hfg.Graph()
    burst, ear = graph.add(Burst()), graph.add(Ear())
    with pytest.raises(hfg.errors.ConnectionError, match="an active edge loses nothing"):
        graph.connect(burst.rang, ear.hear, active=True, overflow="latest")
    with pytest.raises(hfg.errors.ConnectionError, match="operators"):
        graph.connect(burst.rang, ear.hear, active=True, through=[operators.take(1)])


# --- P6 ---


@pytest.mark.rule("P6")
def test_a_connected_optional_input_is_waited_for(fast: bool) -> None:
    graph = hfg.Graph()
    source, late = graph.add(numbers(count=2)), graph.add(slow_numbers(count=2, pause_s=5))
    node, sink = graph.add(add_optional()), graph.add(Keep())
    graph.connect(source.out, node.a)
    graph.connect(late.out, node.b)
    graph.connect(node.out, sink.value)
    report = run(graph, fast)
    assert sink.values == [2, 4]
    assert report.duration_s == 10


@pytest.mark.rule("P6")
def test_silence_on_an_optional_input_lets_the_node_fire_with_the_default(fast: bool) -> None:
    graph = hfg.Graph()
    source, some = graph.add(numbers(count=3)), graph.add(gaps(count=3))
    node, sink = graph.add(add_optional()), graph.add(Keep())
    graph.connect(source.out, node.a)
    graph.connect(some.out, node.b)
    graph.connect(node.out, sink.value)
    run(graph, fast)
    assert sink.values == [2, 102, 6]


@pytest.mark.rule("P6")
def test_an_unconnected_optional_input_is_absent(fast: bool) -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(numbers(count=2)), graph.add(add_optional()), graph.add(Keep())
    graph.connect(source.out, node.a)
    graph.connect(node.out, sink.value)
    run(graph, fast)
    assert sink.values == [101, 102]


@hfg.node
def only_even(value: int) -> int | None:
    """Even values, silence for the others."""
    return None if value % 2 else value


@pytest.mark.rule("P6")
def test_a_multiplexer_of_optional_inputs_works(fast: bool) -> None:
    graph = hfg.Graph()
    source, odd, even = graph.add(numbers(count=4)), graph.add(only_odd()), graph.add(only_even())
    node, sink = graph.add(merge()), graph.add(Keep())
    graph.connect(source.out, odd.value)
    graph.connect(source.out, even.value)
    graph.connect(odd.out, node.a)
    graph.connect(even.out, node.b)
    graph.connect(node.out, sink.value)
    run(graph, fast)
    assert sink.values == [(1, None), (None, 2), (3, None), (None, 4)]


# --- P7 ---


@pytest.mark.rule("P7")
@pytest.mark.parametrize("release", ["sequential", "pipelined"])
def test_a_cycle_with_an_initial_token_counts(release: str, fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(numbers(count=4)), graph.add(Keep())
    node = graph.add(add(), release=release)  # type: ignore[arg-type]
    graph.connect(source.out, node.a)
    graph.connect(node.out, node.b, initial=[10])
    graph.connect(node.out, sink.value)
    run(graph, fast)
    assert sink.values == [11, 13, 16, 20]


@pytest.mark.rule("P7")
def test_initial_tokens_have_no_modifier_no_number_and_the_stamp_of_the_start(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(slow_numbers(count=1, pause_s=3)), graph.add(KeepTokens())
    graph.connect(source.out, sink.value, initial=[7, 8])
    run(graph, fast)
    first, second, third = sink.tokens
    assert (first.value, first.activity, first.sequence, first.stamp) == (7, 0, 0, 0)
    assert (second.value, second.sequence) == (8, 0)
    assert (third.value, third.sequence) == (1, 1)


@pytest.mark.rule("P7")
def test_initial_tokens_on_an_event_edge_come_first(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(Ringing(count=2)), graph.add(Keep())
    graph.connect(source.rang, sink.value, initial=[7, 8])
    run(graph, fast)
    assert sink.values == [7, 8, 1, 2]


@pytest.mark.rule("P7")
def test_a_delay_ends_the_wave_so_the_producer_goes_on_with_d_tokens_untaken() -> None:
    graph = hfg.Graph()
    source, slow = graph.add(numbers(count=3)), graph.add(forward_later(), release="sequential")
    edge = graph.connect(source.out, slow.value, initial=[5])
    times = [event.time for event in of_kind(traced(graph), TokenSent) if event.edge == edge.label]
    assert times == [0, 0, 1, 2]  # one may lie untaken behind the one that is worked on, so it is always a token ahead


@pytest.mark.rule("P7")
def test_a_cycle_without_initial_token_is_refused_by_name() -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers()), graph.add(add())
    graph.connect(source.out, node.a)
    graph.connect(node.out, node.b)
    with pytest.raises(hfg.errors.CheckFailed, match=r"ring of synchronous edges without initial tokens: add -> add"):
        run(graph)


@pytest.mark.rule("P7")
def test_a_cycle_that_needs_its_own_signal_is_a_warning() -> None:
    graph = hfg.Graph()
    node = graph.add(Send())
    graph.connect(node.rang, node.value)
    assert [problem.severity for problem in graph.check()] == ["warning"]


# --- P8 ---


@pytest.mark.rule("P8")
def test_a_token_sets_the_parameter_before_the_function_runs(fast: bool) -> None:
    graph = hfg.Graph()
    source, factors = graph.add(numbers(count=3)), graph.add(numbers(count=3))
    node, sink = graph.add(scale(factor=100)), graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(factors.out, node.ports.parameters["factor"])
    graph.connect(node.out, sink.value)
    run(graph, fast)
    assert sink.values == [1, 4, 9]


@hfg.node
def set_once() -> Iterator[int | None]:
    """A value in the second firing only."""
    yield None
    yield 3
    yield None


@pytest.mark.rule("P8")
def test_a_silent_firing_sets_the_parameter_too(fast: bool) -> None:
    graph = hfg.Graph()
    source, factors = graph.add(gaps(count=3)), graph.add(set_once())
    node, sink = graph.add(scale(factor=100)), graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(factors.out, node.ports.parameters["factor"])
    graph.connect(node.out, sink.value)
    run(graph, fast)
    assert sink.values == [100, 9]


@pytest.mark.rule("P8")
def test_a_connected_parameter_sends_its_value_with_each_firing_that_is_not_silent() -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(gaps(count=3)), graph.add(scale(factor=5)), graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(node.ports.parameters["factor"], sink.value)
    assert sent(traced(graph), "scale.factor -> keep.value") == [5, NO_MESSAGE, 5, END]


@pytest.mark.rule("P8")
def test_an_event_edge_into_a_parameter_takes_no_part_in_the_join(fast: bool) -> None:
    graph = hfg.Graph()
    source, rings = graph.add(slow_numbers(count=3, pause_s=1)), graph.add(Ringing(count=2))
    node, sink = graph.add(scale(factor=100)), graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(rings.rang, node.ports.parameters["factor"])
    graph.connect(node.out, sink.value)
    run(graph, fast)
    assert sink.values == [2, 4, 6]


@pytest.mark.rule("P8", "R7")
def test_setting_a_parameter_by_a_token_is_traced() -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=2)), graph.add(scale())
    factors = graph.add(numbers(count=2))
    graph.connect(source.out, node.value)
    graph.connect(factors.out, node.ports.parameters["factor"])
    events = of_kind(traced(graph), ParameterSet)
    assert [(one.node, one.parameter, one.value) for one in events] == [("scale", "factor", 1), ("scale", "factor", 2)]


class WithTrigger(hfg.Node):
    """A trigger parameter is a slot and an event."""

    go = hfg.Parameter(trigger=True)


@pytest.mark.rule("P8")
def test_a_trigger_parameter_is_a_slot_and_an_event(fast: bool) -> None:
    graph = hfg.Graph()
    node, ear = graph.add(WithTrigger()), graph.add(Ear())
    graph.connect(graph.start, node.ports.slots["go"])
    graph.connect(node.ports.events["go"], ear.hear)
    run(graph, fast)
    assert ear.heard == [None]


@pytest.mark.rule("P8")
def test_a_parameter_is_set_from_outside_between_firings(fast: bool) -> None:
    from tests.semantics.nodes import drive

    async def main() -> list[object]:
        graph = hfg.Graph()
        node, sink = graph.add(scale(factor=1)), graph.add(Keep())
        graph.connect(graph.input("in", int), node.value)
        graph.connect(node.out, sink.value)
        async with hfg.running(graph, fast=fast) as run, run.feed("in") as feed:
            await feed.send(1)
            run.set(node.ports.parameters["factor"], 7)
            await feed.send(1)
            with pytest.raises(ValueError, match="must be of type int"):
                run.set(node.ports.parameters["factor"], "seven")
            await feed.send(2)
            await asyncio.sleep(0)
        return sink.values

    assert drive(main) == [1, 7, 14]
