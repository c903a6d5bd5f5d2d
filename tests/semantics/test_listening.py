"""Slots that listen only while their node is active (T4)."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

import hfg
from hfg.activity import StateMachine
from hfg.errors import DeclarationError
from hfg.testing import recorder, reference_run, replay
from hfg.trace import ActivityChanged, TokenDrained, TokenSent
from tests.support.making import Allowed, random_plan

HEARD: list[tuple[str, Any]] = []


class Listening(hfg.Node):
    """Hears while it is active."""

    @hfg.slot(while_active=True)
    def hear(self, value: int) -> None:
        HEARD.append((self.place.name, value))

    @hfg.slot
    def enter(self) -> None: ...


class Speaking(hfg.Node):
    said = hfg.Event(int)
    give = hfg.Event()

    @hfg.slot
    def say(self, value: int) -> None:
        self.said.trigger(value)

    @hfg.slot
    def hand_over(self, value: int) -> None:
        """Give the activity away and speak right behind it."""
        self.give.trigger()
        self.said.trigger(value)

    @hfg.slot
    def enter(self) -> None: ...


@hfg.node
def numbers(*, count: int = 5) -> Iterator[int]:
    yield from range(count)


@pytest.fixture(autouse=True)
def _nothing_heard() -> None:
    HEARD.clear()


def pair() -> tuple[hfg.Graph, Speaking, Listening]:
    graph = hfg.Graph()
    speaking, listening = graph.add(Speaking(), name="speaking"), graph.add(Listening(), name="listening")
    graph.start.activates(speaking.enter)
    graph.connect(speaking.said, listening.hear)
    graph.connect(speaking.give, listening.enter, active=True)
    return graph, speaking, listening


@pytest.mark.rule("T4")
def test_an_inactive_node_does_not_hear_and_what_came_is_drained() -> None:
    graph, speaking, _ = pair()
    trace: list[Any] = []

    async def main() -> hfg.Report:
        async with hfg.running(graph, trace=trace.append) as run:
            await run.trigger(speaking.say, 1)
            await run.wait_quiet()
        return run.report()

    report = asyncio.run(main())
    assert HEARD == []
    assert report.edges["speaking.said -> listening.hear"].sent == 1
    assert report.nodes["listening"].calls == 0
    assert [event.token.value for event in trace if isinstance(event, TokenDrained)] == [1]


@pytest.mark.rule("T4")
def test_a_node_whose_activity_is_on_its_way_hears_what_comes_behind_it() -> None:
    graph, speaking, _ = pair()

    async def main() -> None:
        async with hfg.running(graph) as run:
            await run.trigger(speaking.hand_over, 1)
            await run.wait_quiet()
            await run.trigger(speaking.say, 2)
            await run.wait_quiet()

    asyncio.run(main())
    assert HEARD == [("listening", 1), ("listening", 2)]


@pytest.mark.rule("T4", "A6")
def test_a_modifier_that_came_to_deaf_ears_acts_and_activity_is_heard() -> None:
    graph, _, listening = pair()
    trace: list[Any] = []

    async def main() -> None:
        async with hfg.running(graph, trace=trace.append) as run:
            await run.trigger(listening.hear, 1, activity=-1)
            await run.trigger(listening.hear, 2, activity=+1)
            await run.wait_quiet()
            await run.trigger(listening.hear, 3, activity=-1)  # behind A6 it is not active any more
            await run.wait_quiet()

    asyncio.run(main())
    assert HEARD == [("listening", 2)]
    changes = [event.active for event in trace if isinstance(event, ActivityChanged) and event.node == "listening"]
    assert changes == [True, False]


@pytest.mark.slow
@pytest.mark.rule("T4", "F6")
@pytest.mark.parametrize("watched", [False, True])
def test_of_many_nodes_behind_an_output_only_the_active_one_is_called(watched: bool) -> None:
    graph = hfg.Graph()
    source = graph.add(numbers(count=400), name="source")  # so often that it would be fused
    nodes = [graph.add(Listening(), name=f"l{number}") for number in range(30)]
    for node in nodes:
        graph.connect(source.out, node.hear)
    graph.start.activates(nodes[7].enter)
    trace: list[Any] = []
    report = hfg.run(graph, trace=trace if watched else None)
    assert [("l7", number) for number in range(400)] == HEARD
    assert {edge.sent for label, edge in report.edges.items() if label.startswith("source.out")} == {401}  # with END
    assert [report.nodes[f"l{number}"].calls for number in (6, 7)] == [0, 401]  # l7: with `enter`
    if watched:
        sent = [event for event in trace if isinstance(event, TokenSent) and event.edge == "source.out -> l3.hear"]
        assert [event.token.sequence for event in sent] == list(range(1, 402))


@pytest.mark.rule("T4", "T5")
def test_numbers_go_on_when_somebody_begins_to_look() -> None:
    graph = hfg.Graph()
    letters = graph.input("letters", int)
    nodes = [graph.add(Listening(), name=f"l{number}") for number in range(10)]
    for node in nodes:
        graph.connect(letters, node.hear)
    numbers_seen: list[int] = []

    async def main() -> None:
        async with hfg.running(graph) as run, run.feed(letters) as feed:
            for number in range(3):
                await feed.send(number)
            with run.tap("letters -> l4.hear") as tap:
                await feed.send(3)
                assert tap.latest is not None
                numbers_seen.append(tap.latest.sequence)
            for number in range(2):
                await feed.send(number)
            assert run.statistics().edges["letters -> l4.hear"].sent == 6
            await run.trigger(nodes[4].enter, activity=+1)
            await run.wait_quiet()
            await feed.send(6)
            assert run.report().edges["letters -> l4.hear"].sent == 7

    asyncio.run(main())
    assert numbers_seen == [4]
    assert HEARD == [("l4", 6)]


@pytest.mark.rule("T4", "A13")
@pytest.mark.parametrize("states", [2, 5, 40])
def test_a_machine_does_the_same_whether_somebody_looks_or_not(states: int) -> None:
    names = [f"s{number}" for number in range(states)]
    steps = [("go", one, names[(number * 3 + 1) % states]) for number, one in enumerate(names)]
    steps += [("back", one, names[number // 2]) for number, one in enumerate(names)]
    machine = StateMachine(names, steps, initial="s0")
    word = ["go", "go", "back", "go", "go", "go", "back"] * 4

    async def go(**options: Any) -> tuple[list[str], dict[str, int], dict[str, int]]:
        graph = machine.graph()
        async with hfg.running(graph, **options) as run, run.feed(graph.inputs["letters"]) as feed:
            for letter in word:
                await feed.send(letter)
            await run.wait_quiet()
            report = run.report()
            sent = {label: edge.sent for label, edge in report.edges.items()}
            return run.active(), sent, {path: node.calls for path, node in report.nodes.items()}

    plain = asyncio.run(go())
    assert plain[0] == [machine.after(word)]
    assert asyncio.run(go(trace=lambda _: None)) == plain


@pytest.mark.slow
@pytest.mark.rule("T4", "A3", "A6", "P5", "F6")
@pytest.mark.parametrize("block", range(5))
def test_random_graphs_of_listening_nodes_do_what_the_oracle_permits(block: int) -> None:
    for seed in range(block * 30, (block + 1) * 30):
        plan = random_plan(seed, Allowed(max_nodes=6))
        nodes = [
            replace(node, type="Attentive") if node.type in ("Relay", "AsyncRelay") else node for node in plan.nodes
        ]
        plan = replace(plan, nodes=tuple(nodes))
        try:
            reference_run(plan.build(), seed=seed, max_moves=1500)
        except RuntimeError:
            continue  # it goes round and round
        trace = recorder()
        with contextlib.suppress(hfg.errors.RunError):
            hfg.run(plan.build(), clock="virtual", policy="random", seed=seed, trace=trace)
        replay(plan, trace)


def test_a_subgraph_only_passes_on() -> None:
    with pytest.raises(DeclarationError, match="while_active has no effect"):
        type("Box", (hfg.Subgraph,), {"go": hfg.slot(type=int, while_active=True), "build": lambda self, graph: None})
