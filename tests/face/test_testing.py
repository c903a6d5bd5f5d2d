"""Tests of a user's own nodes and graphs, as the face shows them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest
from hypothesis import given, settings

import hfg

# --- as written ---
from hfg.testing import explore, fire, graphs, reference_run, schedules


class Pose(NamedTuple):
    x: float


class MapLookup(hfg.Node):
    key = hfg.Input(int)
    map = hfg.Input(dict[int, Pose], optional=True)
    pose = hfg.Output(Pose)
    unknown = hfg.Event(int)

    def process(self, key: int, map: dict[int, Pose] | None) -> Pose | None:  # noqa: A002
        if map and key in map:
            return map[key]
        self.unknown.trigger(key)
        return None


@hfg.node
def numbers(*, count: int = 3) -> Iterator[int]:
    yield from range(count)


@hfg.node
def drive(goal: Pose) -> None: ...


class First(hfg.Node):
    """Leans on the order in which two sources fire, which nobody promised."""

    first: hfg.State[str | None] = hfg.State(None)

    @hfg.slot
    def left(self, value: int) -> None:
        self.see("left")

    @hfg.slot
    def right(self, value: int) -> None:
        self.see("right")

    def see(self, side: str) -> None:
        if self.first is None:
            self.first = side
            assert side == "left"


def build_graph() -> hfg.Graph:
    graph = hfg.Graph()
    lookup = graph.add(MapLookup())
    graph.connect(graph.add(numbers()).out, lookup.key)
    graph.connect(lookup.pose, graph.add(drive()).goal)
    return graph


def build_hasty_graph() -> hfg.Graph:
    graph = hfg.Graph()
    first = graph.add(First())
    graph.connect(graph.add(numbers()).out, first.left)
    graph.connect(graph.add(numbers()).out, first.right)
    return graph


def test_fire_runs_one_node_without_a_graph() -> None:
    firing = fire(MapLookup(), key=3)
    assert firing.outputs == {}
    assert firing.events == [("unknown", 3)]
    assert fire(MapLookup(), key=3, map={3: Pose(1.0)}).outputs == {"pose": Pose(1.0)}


@pytest.mark.slow
def test_explore_takes_the_function_that_builds_the_graph() -> None:
    explore(build_graph)


@pytest.mark.slow
def test_explore_gives_the_smallest_failure_of_a_graph_that_leans_on_an_order() -> None:
    with pytest.raises(AssertionError) as error:
        explore(build_hasty_graph)
    assert "first" in str(error.value)


def test_reference_run_agrees_with_the_engine() -> None:
    reference, report = reference_run(build_graph()), hfg.run(build_graph(), clock="virtual")
    assert reference.outcome == report.outcome
    assert reference.values("numbers.out -> map_lookup.key") == [0, 1, 2, hfg.END]
    assert len(reference.values("map_lookup.pose -> drive.goal")) == report.edges["map_lookup.pose -> drive.goal"].sent


@settings(max_examples=10, deadline=None)
@given(graphs(), schedules())
def test_strategies_give_graphs_and_schedules(graph: Any, schedule: Any) -> None:
    assert graph is not None
    assert schedule is not None
