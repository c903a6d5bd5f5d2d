"""Edges between processes that may lose signals, and have: the run still ends, and knows how many (L2, P5)."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest

import hfg
from hfg.engine.runtime import engine
from hfg.parts.model.agreement import Account, Agreement, Answer, Question, Rest
from hfg.parts.processes import launching
from hfg.trace import TokenSent, TraceEvent
from hfg_transports.memory import Faults, Network
from tests.parts.test_deaths import LastWord
from tests.semantics.nodes import Ringing

EDGE = "ticker.tick -> show.value"


class Ticker(hfg.Node):
    """Triggers for each value that comes."""

    value = hfg.Input(int)
    tick = hfg.Event(int)

    def process(self, value: int) -> None:
        self.tick.trigger(value)


@hfg.node
async def numbers(*, count: int = 30, pause_s: float = 0.01) -> AsyncIterator[int]:
    for number in range(count):
        yield number
        await asyncio.sleep(pause_s)


@hfg.node
def show(value: int) -> int:
    return value


@hfg.node
def both(value: int, other: int) -> int:
    return value + other


@pytest.fixture
def over(monkeypatch: pytest.MonkeyPatch) -> Callable[[Network], None]:
    """Have the parts of the next run speak over a network."""

    def use(network: Network) -> None:
        class Made(launching.LoopLauncher):
            def __init__(self) -> None:
                super().__init__(network=network)

        monkeypatch.setattr(launching, "LoopLauncher", Made)

    return use


def ticking(**options: Any) -> hfg.Graph:
    graph = hfg.Graph("ticking")
    graph.group("far", process=True)
    source, ticker, last = graph.add(numbers()), graph.add(Ticker()), graph.add(show(), group="far")
    graph.connect(source.out, ticker.value)
    graph.connect(ticker.tick, last.value, **options)
    graph.connect(last.out, graph.output("out", int))
    return graph


@pytest.mark.rule("L2", "P5", "R5")
@pytest.mark.parametrize("seed", range(10))
def test_signals_that_were_lost_on_the_way_are_counted_and_the_run_ends(over: Any, seed: int) -> None:
    network = Network(Faults(loss=0.4, delay_s=(0.0, 0.004), repetition=0.2), seed=seed)
    over(network)

    def be_kind_in_the_end(event: TraceEvent) -> None:
        """Or END would be lost too, and sent and counted again."""
        if isinstance(event, TokenSent) and event.edge == EDGE and event.token.value == 29:
            asyncio.get_running_loop().call_later(0.001, setattr, network, "faults", Faults())

    report = hfg.run(ticking(overflow="drop_oldest"), clock="virtual", trace=be_kind_in_the_end)
    found = report.outputs["out"]
    assert found == sorted(set(found))
    assert 0 < len(found) < 30
    edge = report.edges[EDGE]
    assert (edge.sent, edge.dropped, edge.untaken) == (31, 30 - len(found), 0)


@pytest.mark.rule("F13", "L2")
@pytest.mark.parametrize("seed", range(10))
def test_that_nothing_more_comes_is_never_lost(over: Any, seed: int) -> None:
    over(Network(Faults(loss=0.6, delay_s=(0.0, 0.004)), seed=seed))
    graph = hfg.Graph()
    graph.group("far", process=True)
    source, ticker, last = graph.add(numbers(count=3)), graph.add(Ticker()), graph.add(LastWord(), group="far")
    graph.connect(source.out, ticker.value)
    graph.connect(ticker.tick, last.value, overflow="drop_oldest")
    graph.connect(last.out, graph.output("out", int))
    assert hfg.run(graph, clock="virtual").outputs["out"][-1] == -1


@pytest.mark.rule("L2", "P5", "R5")
def test_signals_all_of_which_are_lost_are_counted_too(over: Any) -> None:
    network = Network()
    over(network)
    put = network.put

    lost: list[Any] = []

    def lose_signals(sender: Any, key: str, message: Any) -> None:
        if key.endswith("/edge/1/tokens") and len(lost) < 30:
            lost.append(message)
        else:
            put(sender, key, message)

    network.put = lose_signals  # type: ignore[method-assign]
    report = hfg.run(ticking(overflow="latest"), clock="virtual")
    assert report.outputs == {"out": []}
    assert report.edges[EDGE].dropped == 30


@pytest.mark.rule("P5")
def test_more_signals_at_once_than_a_queue_holds_are_dropped_by_its_own_policy(over: Any) -> None:
    over(Network())
    graph = ticking(overflow="drop_newest", capacity=20)
    graph["numbers"].pause_s = 0.0
    report = hfg.run(graph, clock="virtual")
    assert report.outputs["out"][:20] == list(range(20))


@pytest.mark.slow
@pytest.mark.rule("P5")
def test_a_flood_of_signals_does_not_wait_until_the_loop_has_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "_SHORT_SLICE_S", 0.0)  # else it were for the machine to say how many leave
    monkeypatch.setattr(launching, "ProcessLauncher", lambda: launching.LoopLauncher(network=Network()))
    graph = hfg.Graph()
    graph.group("far", process=True)
    last = graph.add(show(), group="far")
    graph.connect(graph.add(Ringing(count=2000)).rang, last.value, overflow="latest")
    graph.connect(last.out, graph.output("out", int))
    found = hfg.run(graph).outputs["out"]
    assert found == sorted(set(found))
    assert len(found) > 20  # the clock is looked at after every 64 steps
    assert found[-1] == 2000


@pytest.mark.rule("R5", "P5")
def test_signals_that_nobody_can_take_are_named_though_they_may_be_lost(over: Any) -> None:
    over(Network())
    graph = hfg.Graph()
    graph.group("far", process=True)
    source, ticker, last = graph.add(numbers(count=3)), graph.add(Ticker()), graph.add(both(), group="far")
    graph.connect(source.out, ticker.value)
    graph.connect(ticker.tick, last.value, overflow="drop_oldest")
    graph.connect(graph.add(numbers(count=1), name="one", group="far").out, last.other)
    graph.connect(last.out, graph.output("out", int))
    assert hfg.run(graph, clock="virtual").outputs == {"out": [0]}


class Parts:
    """Two parts with an edge between them, as an agreement sees them."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, Question]] = []
        self.waits = 0
        self.rests = 0
        self.agreement = Agreement(
            ["a", "b"], lambda part, question: self.asked.append((part, question)), lossy=["e"], wait=self._wait
        )

    def _wait(self) -> None:
        self.waits += 1

    def rest(self, sent: Account, came: Account) -> None:
        self.rests += 1
        self.agreement.leave("b")
        self.agreement.rest(Rest("a", self.rests, {"e": sent}, {}))
        self.agreement.rest(Rest("b", self.rests, {}, {"e": came}))

    def answer(self, *, moved: bool = False) -> set[str]:
        """Answer all that is asked; gives which steps that were."""
        asked, self.asked = self.asked, []
        for part, question in asked:
            self.agreement.hear(Answer(part, question.step, question.rest, moved=moved))
        return {question.step for _, question in asked}


@pytest.mark.rule("L2", "R5")
def test_what_is_missing_is_lost_when_nothing_has_moved_between_two_looks() -> None:
    parts = Parts()
    parts.rest((5, 5, "open", True), (3, 3, "open", True))
    assert parts.answer() == {"missing"}
    assert (parts.waits, parts.asked) == (1, [])
    parts.agreement.look_again()
    assert parts.answer() == {"missing"}
    assert [question.value for _, question in parts.asked] == [{"e": 5}, {"e": 5}]
    assert parts.answer() == {"lose"}
    parts.rest((5, 5, "open", True), (5, 5, "open", True))
    assert parts.answer() == {"rests"}


@pytest.mark.rule("L2", "R5")
def test_what_comes_while_it_is_waited_for_is_not_lost() -> None:
    parts = Parts()
    parts.rest((5, 5, "open", True), (3, 3, "open", True))
    assert parts.answer() == {"missing"}
    parts.rest((5, 5, "open", True), (4, 4, "open", True))
    parts.agreement.look_again()
    assert parts.answer() == {"missing"}
    parts.rest((5, 5, "open", True), (5, 5, "open", True))
    assert {question.step for _, question in parts.asked} == {"rests"}


@pytest.mark.rule("L2", "R5")
def test_a_part_that_has_moved_breaks_off_the_look_for_what_is_missing() -> None:
    parts = Parts()
    parts.rest((5, 5, "open", True), (3, 3, "open", True))
    assert parts.answer(moved=True) == {"missing"}
    assert parts.waits == 0
