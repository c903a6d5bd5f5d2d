"""The state diagram of a graph, written down from the rules alone: which states there are, and what leads where."""

from __future__ import annotations

import random
from typing import Any

import msgspec
import pytest

import hfg
from examples.fetch_delivery.mission import build as mission
from hfg import commands
from hfg.activity import StateMachine
from hfg.errors import UsageError
from hfg.graph.structure.membership import set_options


class State(hfg.Node):
    a, b = hfg.Event(), hfg.Event()

    @hfg.slot
    def take(self) -> None:
        """Receive activity."""

    @hfg.slot
    def send(self, first: bool) -> None:
        if first:
            self.a.trigger()
        else:
            self.b.trigger()


class Passes(State):
    """Passes activity on at once."""

    @hfg.slot
    def take(self) -> None:
        self.a.trigger()


class Works(State):
    async def do(self) -> None:
        """Is over at once."""


def graph_of(**kinds: Any) -> hfg.Graph:
    graph = hfg.Graph("states")
    for name, kind in kinds.items():
        graph.add(kind(), name=name)
    return graph


def arrows(graph: hfg.Graph) -> set[tuple[str, str, str]]:
    return {(one.source, one.event, one.target) for one in hfg.analyse_activity(graph).diagram().arrows}


def states(graph: hfg.Graph) -> list[str]:
    return [one.path for one in hfg.analyse_activity(graph).diagram().states]


@pytest.mark.rule("A5", "A10")
def test_the_diagram_begins_at_start_and_has_an_arrow_for_each_event_that_moves_activity() -> None:
    graph = graph_of(one=State, two=State)
    graph.connect("start", "one.take", active=True)
    graph.connect("one.a", "two.take", active=True)
    graph.connect("two.b", "one.take", active=True)
    assert states(graph) == ["one", "two"]
    assert arrows(graph) == {("", "start", "one"), ("one", "a", "two"), ("two", "b", "one")}


@pytest.mark.rule("A7")
def test_edges_that_are_not_active_are_no_arrows() -> None:
    graph = graph_of(one=State, two=State, idle=State)
    graph.connect("start", "one.take", active=True)
    graph.connect("one.a", "two.take", active=True)
    graph.connect("one.b", "idle.take")
    graph.connect("idle.a", "one.take", active=True)
    assert states(graph) == ["one", "two"]
    assert ("idle", "a", "one") not in arrows(graph)


@pytest.mark.rule("A12")
def test_a_time_out_is_an_event_like_others_if_there_is_a_limit() -> None:
    graph = hfg.Graph("states")
    graph.add(State(), name="one", active_for_s=2.0)
    graph.add(State(), name="two")
    graph.connect("start", "one.take", active=True)
    graph.connect("one.timeout", "two.take", active=True)
    graph.connect("two.timeout", "one.take", active=True)
    assert arrows(graph) == {("", "start", "one"), ("one", "timeout", "two")}


@pytest.mark.rule("A9", "A15")
def test_automatic_events_lead_on_except_deactivated() -> None:
    graph = graph_of(one=Works, two=State)
    graph.connect("start", "one.take", active=True)
    graph.connect("one.completed", "two.take", active=True)
    graph.connect("two.deactivated", "one.take", active=True)
    assert arrows(graph) == {("", "start", "one"), ("one", "completed", "two")}


@pytest.mark.rule("A3", "A6")
def test_a_node_that_passes_activity_on_at_once_is_no_state_to_stay_in() -> None:
    graph = graph_of(one=State, gate=Passes, two=State)
    graph.connect("start", "one.take", active=True)
    graph.connect("one.a", "gate.take", active=True)
    graph.connect("gate.a", "two.take", active=True)
    diagram = hfg.analyse_activity(graph).diagram()
    assert {one.path: one.passes_on for one in diagram.states} == {"one": False, "gate": True, "two": False}


@pytest.mark.rule("G2", "A12")
def test_a_time_out_of_a_subgraph_leads_from_the_subgraph() -> None:
    graph = graph_of(one=State, two=State, home=State)
    graph.connect("start", "one.take", active=True)
    graph.connect("one.a", "two.take", active=True)
    graph.edit(commands.Enclose(("one", "two"), "box"))
    set_options(graph["box"], msgspec.structs.replace(graph["box"]._options, active_for_s=1.0))
    graph.connect("box.timeout", "home.take", active=True)
    assert arrows(graph) == {("", "start", "box/one"), ("box/one", "a", "box/two"), ("box", "timeout", "home")}


@pytest.mark.rule("A10")
def test_an_edge_out_of_the_graph_ends_the_diagram() -> None:
    graph = graph_of(one=State)
    graph.connect("start", "one.take", active=True)
    graph.connect("one.b", "stop", active=True)
    assert arrows(graph) == {("", "start", "one"), ("one", "b", "")}


@pytest.mark.rule("A13")
@pytest.mark.parametrize("seed", range(12))
def test_a_machine_has_as_many_states_in_the_diagram_as_it_can_reach(seed: int) -> None:
    dice = random.Random(seed)
    names = [f"s{number}" for number in range(dice.randint(2, 6))]
    delta = {(one, letter): dice.choice(names) for one in names for letter in "ab"}
    moves = [(letter, one, target) for (one, letter), target in delta.items()]
    machine = StateMachine(names, moves, initial=names[0], final=names[:1])
    reached, waiting = {names[0]}, [names[0]]
    for one in waiting:
        for letter in "ab":
            if delta[one, letter] not in reached:
                reached.add(delta[one, letter])
                waiting.append(delta[one, letter])
    graph = machine.graph()
    report = hfg.analyse_activity(graph)
    known = {one.path.rpartition("/")[2] for one in report.diagram().states}
    assert len(known & set(names)) == len(reached), known


def test_the_mission_is_drawn_in_every_format() -> None:
    graph = mission()
    for kind in ("svg", "mmd", "dot"):
        drawn = graph.draw(format=kind, view="states")
        assert "retreat" in drawn
        assert "blocked" in drawn
        assert "lidar" not in drawn


def test_a_graph_without_active_edges_has_no_states_to_draw() -> None:
    with pytest.raises(UsageError, match='graph "states" has no states to draw, since no active edge carries activity'):
        graph_of(one=State).draw(view="states")


def test_the_diagram_is_data() -> None:
    graph = hfg.Graph("states")
    graph.add(State(), name="one", active_for_s=2.0)
    graph.connect("start", "one.take", active=True)
    assert hfg.analyse_activity(graph).as_data()["states"] == {
        "states": [{"path": "one", "passes_on": False}],
        "arrows": [{"source": "", "event": "start", "target": "one"}],
        "limits": {"one": 2.0},
    }
