"""Full queues, graphs that stall, and listeners that raise."""

from __future__ import annotations

from typing import Any

import pytest

import hfg
from tests.bad_input.graphs import one, sentence
from tests.semantics.nodes import Ear, Keep, Ringing, drive, forward, numbers, run, value_of

# --- queues ---


class Bursts(hfg.Node):
    """Many signals in one firing."""

    value = hfg.Input(int)
    rang = hfg.Event(int)

    def process(self, value: int) -> None:
        for number in range(5):
            self.rang.trigger(number)


@pytest.mark.rule("P5")
def test_queue_overflow_names_the_edge_and_the_remedy(fast: bool) -> None:
    graph = one(Bursts())
    graph.connect(graph["node"].rang, graph.add(Ear()).hear, capacity=2, overflow="error")
    said = sentence(graph, fast)
    assert 'failed in firing 1: QueueOverflow: queue of "node.rang -> ear.hear" is full' in said
    assert "raise capacity= or choose another overflow=" in said


class PingPong(hfg.Node):
    """Two signals for each one."""

    rang = hfg.Event(int)

    @hfg.slot
    def hear(self, value: int) -> None:
        self.rang.trigger(value)
        self.rang.trigger(value)


@pytest.mark.rule("F8")
def test_queue_limit_names_the_edge_and_the_remedy(fast: bool) -> None:
    graph = hfg.Graph()
    first, second = graph.add(PingPong(), name="first"), graph.add(PingPong(), name="second")
    graph.connect(graph.add(Ringing(count=1)).rang, first.hear)
    graph.connect(first.rang, second.hear, capacity=2, capacity_limit=6)
    graph.connect(second.rang, first.hear, capacity=2, capacity_limit=6)
    with pytest.raises(
        hfg.errors.QueueLimit, match=r'queue of "first.rang -> second.hear" .* capacity_limit = 6'
    ) as raised:
        run(graph, fast)
    assert "raise the limit or let the consumer take more" in str(raised.value)


# --- stalls ---


def _unfed(graph: hfg.Graph) -> None:
    graph.connect(graph.add(numbers(count=1)).out, graph.add(Two()).a)


class Two(hfg.Node):
    a = hfg.Input(int)
    b = hfg.Input(int)

    def process(self, a: int, b: int) -> None:
        pass


def _never_triggered(graph: hfg.Graph) -> None:
    node = graph.add(Two())
    graph.connect(graph.add(numbers(count=1)).out, node.a)
    graph.connect(graph.add(Silent()).out, node.b)


class Silent(hfg.Node):
    """Nothing comes in, so nothing goes out."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        return value


def _not_ready(graph: hfg.Graph) -> None:
    graph.connect(graph.add(numbers(count=1)).out, graph.add(NotReady()).value)


class NotReady(hfg.Node):
    value = hfg.Input(int)

    def ready(self) -> bool:
        return False

    def process(self, value: int) -> None:
        pass


def _source_not_ready(graph: hfg.Graph) -> None:
    graph.add(Shy())


class Shy(hfg.Node):
    def ready(self) -> bool:
        return False

    def process(self) -> None:
        pass


def _signals_left(graph: hfg.Graph) -> None:
    node = graph.add(Two())
    graph.connect(graph.add(Ringing(count=3)).rang, node.a)


@pytest.mark.parametrize(
    ("build", "said"),
    [
        (_unfed, '"two" waits for its unconnected input "b", while tokens lie on "numbers.out -> two.a"'),
        (_never_triggered, '"two" waits for "b", while tokens lie on "numbers.out -> two.a"'),
        (
            _never_triggered,
            'source "numbers" has not ended and waits until its token is processed on "numbers.out -> two.a"',
        ),
        (_not_ready, '"not_ready" says by ready() that it is not ready, while tokens lie on "numbers.out -> not_ready'),
        (_source_not_ready, 'source "shy" has not ended and says by ready() that it is not ready'),
        (_signals_left, '"two" waits for its unconnected input "b", while tokens lie on "ringing.rang -> two.a"'),
    ],
)
def test_a_stall_says_which_node_waits_for_what_and_what_to_do(build: Any, said: str, fast: bool) -> None:
    graph = hfg.Graph()
    build(graph)
    with pytest.raises(hfg.errors.Stalled) as raised:
        run(graph, fast)
    assert said in str(raised.value)
    assert "run with allow_idle=True" in str(raised.value)
    assert raised.value.report.outcome == "stalled"  # type: ignore[attr-defined]


def test_a_graph_output_that_nobody_reads_is_a_stall_that_says_so(fast: bool) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        graph.connect(graph.add(numbers(count=3)).out, graph.output("out", int))
        async with hfg.running(graph, fast=fast) as run:
            await run.wait_finished()

    with pytest.raises(hfg.errors.Stalled, match='graph output "out" is not read'):
        drive(main)


# --- subscribers, operators, consumers ---


@pytest.mark.rule("P9")
def test_a_subscriber_that_raises_is_logged_with_the_path_and_dropped(
    caplog: pytest.LogCaptureFixture, fast: bool
) -> None:
    graph = hfg.Graph()
    source, ear = graph.add(Ringing(count=3)), graph.add(Ear())
    graph.connect(source.rang, ear.hear)
    calls: list[int] = []
    others: list[int] = []

    def bad(token: hfg.Token[int]) -> None:
        calls.append(token.value)
        raise ValueError("mine")

    source.rang.subscribe(bad)
    source.rang.subscribe(lambda token: others.append(token.value))
    assert run(graph, fast).outcome == "done"
    assert (calls, others, ear.heard) == ([1], [1, 2, 3], [1, 2, 3])
    assert [record.getMessage() for record in caplog.records] == [
        'a subscriber of "ringing.rang" failed and was dropped'
    ]


@pytest.mark.rule("P9")
def test_an_operator_that_raises_is_an_error_of_the_edge_by_the_consumers_policy(fast: bool) -> None:
    from reactivex import operators

    def build(on_error: Any) -> tuple[hfg.Graph, Keep]:
        graph = hfg.Graph()
        source, sink = graph.add(Ringing(count=3)), graph.add(Keep(), on_error=on_error)
        graph.connect(source.rang, sink.value, through=[operators.map(lambda token: 1 // (value_of(token) - 2))])
        return graph, sink

    graph, _ = build("stop")
    said = sentence(graph, fast)
    assert said == (
        'node "keep" failed in an operator on edge "ringing.rang -> keep.value": '
        "ZeroDivisionError: integer division or modulo by zero"
    )
    graph, sink = build("skip")
    report = run(graph, fast)
    assert sink.values == [-1]  # Rx: an operator that has failed is over
    assert len(report.errors) == 1


@pytest.mark.rule("R7")
def test_a_trace_consumer_that_raises_is_logged_and_removed(caplog: pytest.LogCaptureFixture, fast: bool) -> None:
    calls: list[Any] = []

    def bad(event: Any) -> None:
        calls.append(event)
        raise ValueError("mine")

    graph = one(forward())
    assert run(graph, fast, trace=bad).outcome == "done"
    assert len(calls) == 1
    assert graph["keep"].values == [1, 2, 3]
    assert [record.getMessage() for record in caplog.records] == ["a consumer of the trace failed and was removed"]


def test_an_observable_that_fails_ends_the_run_and_names_the_edge(fast: bool) -> None:
    import reactivex

    graph = hfg.Graph()
    graph.connect(reactivex.throw(ValueError("mine")), graph.add(Ear()).hear)
    assert 'the observable that feeds "observable -> ear.hear": ValueError: mine' in sentence(graph, fast)
