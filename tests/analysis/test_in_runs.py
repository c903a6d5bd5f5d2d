"""Runs stay inside the game: each state of activity that a run passes through is one that the analysis reached."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings

import hfg
from examples.fetch_delivery.mission import build
from hfg import trace
from hfg.activity import StateMachine
from tests.analysis.exhaustive import Fires, draw
from tests.semantics.test_state_machines import machines


class Watched:
    """Follows the activity of the nodes of a graph in a trace, and notes its state after each firing and call."""

    def __init__(self, graph: hfg.Graph) -> None:
        self.report = hfg.analyse_activity(graph, max_states=2_000)
        self.nodes = {path for region in self.report.regions for path in region.nodes}
        self.edges = {edge for _, edges in self.report.states() for edge in map(_label, edges)}
        self.active: set[str] = set()
        self.lying: dict[str, int] = {}
        self.seen: set[tuple[frozenset[str], frozenset[str]]] = set()
        self.left = 3_000
        self.stop: Callable[[], object] = lambda: None

    def see(self, event: trace.TraceEvent) -> None:
        self.left -= 1
        if not self.left:
            self.stop()  # in a ring of nodes that pass it on, activity never rests
        if isinstance(event, trace.ActivityChanged):
            if event.node in self.nodes:
                (self.active.add if event.active else self.active.discard)(event.node)
        elif isinstance(event, trace.TokenSent | trace.TokenTaken | trace.TokenDrained | trace.TokenDropped):
            if event.edge in self.edges and event.token.activity == 1:
                change = 1 if isinstance(event, trace.TokenSent) else -1
                self.lying[event.edge] = self.lying.get(event.edge, 0) + change
        elif isinstance(event, trace.FiringEnded | trace.CallEnded):
            lying = frozenset(edge for edge, count in self.lying.items() if count)
            self.seen.add((frozenset(self.active), lying))

    def outside(self) -> set[tuple[frozenset[str], frozenset[str]]]:
        """Return the states that the analysis says are impossible."""
        known = {(frozenset(active), frozenset(map(_label, edges))) for active, edges in self.report.states()}
        return self.seen - known


def _label(edge: str) -> str:
    return edge.removesuffix(" (twice or more)")


@pytest.mark.slow
def test_a_run_of_the_mission_passes_only_through_states_of_the_game() -> None:
    graph = build()
    watched = Watched(graph)
    hfg.run(graph, clock="virtual", until_s=60, trace=watched.see)
    assert watched.report.regions[0].is_complete
    assert not watched.outside()
    assert len(watched.seen) > 15, "the run shows next to nothing"


def test_runs_of_random_graphs_pass_only_through_states_of_the_game() -> None:
    """With commands in haste, so that signals wait and nodes work between those of one firing."""

    async def play(graph: hfg.Graph, watched: Watched, dice: random.Random) -> None:
        playing = asyncio.create_task(play_on(graph, watched, dice))
        watched.stop = playing.cancel
        await asyncio.wait([playing])
        assert playing.cancelled() or playing.exception() is None

    async def play_on(graph: hfg.Graph, watched: Watched, dice: random.Random) -> None:
        async with hfg.running(graph, trace=watched.see, policy="random", seed=dice.randrange(1000)) as run:
            commands = list(graph.inputs.values())
            async with asyncio.TaskGroup() as group:
                for port in commands:
                    group.create_task(feed(run, port, dice))

    async def feed(run: hfg.Run, port: Any, dice: random.Random) -> None:
        async with run.feed(port) as sender:
            for _ in range(6):
                await sender.send(dice.randrange(3))
                await asyncio.sleep(dice.choice([0, 0, 0, 0.3, 1.1]))

    checked = 0
    for seed in range(40):
        graph = draw(seed).graph
        if any(isinstance(node, Fires) for node in graph.nodes.values()):
            continue  # a feed waits until it has fired
        watched = Watched(graph)
        if len(watched.report.regions) != 1 or not watched.report.regions[0].is_complete:
            continue
        with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
            runner.run(play(graph, watched, random.Random(seed)))
        assert not watched.outside(), seed
        checked += len(watched.seen)
    assert checked > 40


@pytest.mark.rule("A13")
@settings(max_examples=60, deadline=None)
@given(machines())
def test_the_graph_of_a_machine_has_as_many_reachable_states_as_the_machine(machine: StateMachine) -> None:
    """A letter that no state knows leads to the dead state, unless it is ignored."""
    reached, waiting = {machine.initial}, [machine.initial]
    for state in waiting:
        for one in machine.transitions:
            if one.source == state and one.target not in reached:
                reached.add(one.target)
                waiting.append(one.target)
    expected = reached | ({"dead"} if machine.missing == "dead" else set())
    report = hfg.analyse_activity(machine.graph())
    (region,) = report.regions
    assert region.exactly_one.holds
    assert {active for active, _ in report.states() if active} == {(state,) for state in expected}
