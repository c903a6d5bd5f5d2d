"""Edges, and every reason to refuse one at once; a refusal changes nothing."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest
import reactivex
from reactivex import operators as ops

import hfg
from hfg import errors
from hfg.graph import Graph, Subgraph
from hfg.graph.structure.level import level_of


class Camera(hfg.Node):
    image = hfg.Output(str)
    count = hfg.Output(int)
    seen = hfg.Event(int)
    lost = hfg.Event()
    rate = hfg.Parameter(1.0)
    again = hfg.Parameter(trigger=True)

    def process(self) -> None: ...


class Robot(hfg.Node):
    goal = hfg.Input(int)
    speed = hfg.Input(float, optional=True)
    limit = hfg.Parameter(2.5)

    def process(self, goal: int, speed: float | None) -> None: ...

    @hfg.slot
    def look(self, at: int) -> None: ...

    @hfg.slot
    def rest(self) -> None: ...


class Box(Subgraph):
    goal = hfg.Input(int)
    done = hfg.Event(int)
    result = hfg.Output(int)
    begin = hfg.slot(type=int)
    speed = hfg.Parameter(1.0)

    def build(self, graph: Graph) -> None:
        self.robot = graph.add(Robot())
        self.camera = graph.add(Camera())


@pytest.fixture
def graph() -> Graph:
    return Graph("fetch")


@pytest.fixture
def camera(graph: Graph) -> Camera:
    return graph.add(Camera())


@pytest.fixture
def robot(graph: Graph) -> Robot:
    return graph.add(Robot())


def refused(graph: Graph, *sentence: str, call: Callable[[], Any] | None = None, **connect: Any) -> None:
    """The connect is refused with a sentence that holds all these parts, and the graph stays as it was."""
    tables = level_of(graph).connections
    before = (list(graph.edges), dict(tables.into), dict(tables.pairs))
    with pytest.raises(errors.ConnectionError) as error:
        graph.connect(**connect) if call is None else call()
    message = str(error.value)
    for part in sentence:
        assert part in message, message
    assert "\n" not in message
    assert (graph.edges, tables.into, tables.pairs) == before


# --- what is allowed ---


@pytest.mark.rule("P1")
def test_all_four_combinations_are_edges(graph: Graph, camera: Camera, robot: Robot) -> None:
    other = graph.add(Robot())
    graph.connect(camera.count, robot.goal)
    graph.connect(camera.count, robot.look)
    graph.connect(camera.seen, other.goal)
    graph.connect(camera.seen, other.look)
    assert len(graph.edges) == 4


@pytest.mark.rule("P2")
def test_outputs_events_and_slots_take_any_number_of_edges(graph: Graph, camera: Camera, robot: Robot) -> None:
    for _ in range(3):
        graph.connect(camera.count, graph.add(Robot()).goal)
        graph.connect(graph.add(Camera()).seen, robot.look)
    assert len(graph.edges) == 6


@pytest.mark.rule("P8")
def test_parameter_is_an_input_and_an_output(graph: Graph, camera: Camera, robot: Robot) -> None:
    graph.connect(camera.ports.parameters["rate"], robot.ports.parameters["limit"])
    graph.connect(camera.ports.parameters["rate"], robot.speed)
    refused(
        graph,
        '"robot.limit" takes one edge and has one from "camera.rate"',
        source=graph.add(Camera()).ports.parameters["rate"],
        target=robot.ports.parameters["limit"],
    )


@pytest.mark.rule("P8")
def test_trigger_parameter_is_a_slot_and_an_event(graph: Graph, camera: Camera) -> None:
    other = graph.add(Camera())
    graph.connect(camera.ports.events["again"], other.ports.slots["again"])
    assert "again" not in camera.ports.parameters


@pytest.mark.rule("A9")
def test_automatic_ports_are_connected_like_others(graph: Graph, camera: Camera, robot: Robot) -> None:
    camera.processed.activates(robot.activate)
    graph.connect(camera.failed, robot.disable)
    graph.connect(camera.lost, robot.rest)
    assert [edge.active for edge in graph.edges] == [True, False, False]


def test_activates_draws_the_double_line(graph: Graph, camera: Camera, robot: Robot) -> None:
    edge = camera.seen.activates(robot.look)
    assert edge.active
    assert graph.edges == [edge]
    assert camera.count.activates(robot.goal).active


@pytest.mark.rule("P5", "P9")
def test_event_edge_has_a_capacity_a_policy_and_operators(graph: Graph, camera: Camera, robot: Robot) -> None:
    debounce = ops.debounce(0.2)
    edge = graph.connect(camera.seen, robot.look, capacity=100, overflow="drop_oldest", through=[debounce])
    assert (edge.capacity, edge.overflow, edge.options.through) == (100, "drop_oldest", (debounce,))


@pytest.mark.rule("P5")
def test_latest_keeps_one(graph: Graph, camera: Camera, robot: Robot) -> None:
    assert graph.connect(camera.seen, robot.look, overflow="latest").capacity == 1
    refused(graph, "latest", "capacity=5", source=camera.seen, target=robot.rest, overflow="latest", capacity=5)


@pytest.mark.rule("P7")
def test_edges_into_inputs_carry_initial_tokens(graph: Graph, camera: Camera, robot: Robot) -> None:
    assert graph.connect(camera.count, robot.goal, initial=[1, 2]).options.initial == (1, 2)
    assert graph.connect(camera.seen, graph.add(Robot()).goal, initial=[3]).options.initial == (3,)


def test_observable_feeds_a_slot_or_an_input(graph: Graph, robot: Robot) -> None:
    feed: reactivex.Observable[int] = reactivex.of(1, 2)
    graph.connect(feed, robot.look)
    graph.connect(feed, robot.goal, overflow="drop_oldest")
    assert [edge.label for edge in graph.edges] == ["observable -> robot.look", "observable -> robot.goal"]
    refused(graph, "connected already", source=feed, target=robot.look)


def test_plain_edges_share_their_options(graph: Graph, camera: Camera, robot: Robot) -> None:
    first, second = graph.connect(camera.count, robot.goal), graph.connect(camera.seen, robot.look)
    assert first.options is second.options


# --- direction and types ---


@pytest.mark.rule("P1")
def test_edges_go_from_sources_to_targets(graph: Graph, camera: Camera, robot: Robot) -> None:
    refused(graph, '"robot.goal", which is an input', "exchange the two", source=robot.goal, target=camera.count)
    refused(graph, '"camera.seen", which is an event', source=camera.count, target=camera.seen)
    refused(graph, '"robot.look", which is a slot', source=robot.look, target=robot.goal)


@pytest.mark.rule("P1")
def test_what_is_no_port_is_refused_with_what_to_write(graph: Graph, camera: Camera, robot: Robot) -> None:
    refused(graph, 'the node "camera"', "node.out", source=camera, target=robot.goal)
    refused(graph, "the declaration in the class", "graph.add", source=Camera.count, target=robot.goal)
    refused(graph, "2.5", "node.ports.parameters", source=camera.count, target=robot.limit)
    refused(graph, "None", source=None, target=robot.goal)


@pytest.mark.rule("P3")
def test_wrong_types_name_both_ports_and_types(graph: Graph, camera: Camera, robot: Robot) -> None:
    refused(
        graph,
        '"robot.goal" expects int',
        '"camera.image" sends str',
        "a node between them",
        source=camera.image,
        target=robot.goal,
    )
    refused(graph, '"camera.lost" sends None', source=camera.lost, target=robot.look)
    graph.connect(camera.count, robot.speed)  # int to float


# --- doubles ---


@pytest.mark.rule("P2")
def test_input_takes_one_edge(graph: Graph, camera: Camera, robot: Robot) -> None:
    graph.connect(camera.count, robot.goal)
    refused(
        graph,
        '"robot.goal" takes one edge and has one from "camera.count"',
        '"camera.seen"',
        source=camera.seen,
        target=robot.goal,
    )


@pytest.mark.rule("P2")
def test_same_edge_twice_is_refused(graph: Graph, camera: Camera, robot: Robot) -> None:
    graph.connect(camera.seen, robot.look)
    graph.connect(camera.count, robot.goal)
    refused(graph, "connected already", source=camera.seen, target=robot.look)
    refused(graph, "connected already", source=camera.count, target=robot.goal)
    refused(graph, "connected already", source=camera.seen, target=robot.look, active=True)


# --- membership ---


def test_nodes_of_no_graph_are_refused(graph: Graph, camera: Camera, robot: Robot) -> None:
    refused(graph, '"robot.look" belongs to no graph', "graph.add", source=camera.seen, target=Robot().look)
    refused(graph, '"camera.seen" belongs to no graph', source=Camera().seen, target=robot.look)
    with pytest.raises(errors.UsageError, match="do not belong to a graph yet"):
        Camera().seen.activates(Robot().look)


def test_nodes_of_other_graphs_are_refused(graph: Graph, camera: Camera) -> None:
    stranger = Graph("other").add(Robot())
    refused(graph, '"robot.look" belongs to graph "other"', source=camera.seen, target=stranger.look)


@pytest.mark.rule("G3")
def test_inner_nodes_are_reached_through_the_subgraphs_ports_only(graph: Graph, camera: Camera) -> None:
    box = graph.add(Box())
    refused(
        graph, '"box/robot.look" belongs to the graph inside "box"', ".inner", source=camera.seen, target=box.robot.look
    )
    refused(box.graph, '"camera.seen" belongs to graph "fetch"', source=camera.seen, target=box.robot.look)


@pytest.mark.rule("G1")
def test_each_side_of_a_relay_belongs_to_its_own_graph(graph: Graph, camera: Camera) -> None:
    box = graph.add(Box())
    refused(graph, '"box.goal.inner" is the side inside', source=box.goal.inner, target=camera.ports.slots["again"])
    refused(box.graph, '"box.goal", which is an input', '"box.goal.inner"', source=box.goal, target=box.robot.goal)
    refused(box.graph, '"box.begin" is the side outside', source=box.camera.seen, target=box.begin)
    refused(box.graph, "graph.promote", source=box.speed, target=box.robot.speed)
    other = graph.add(Box())
    refused(box.graph, 'belongs to the graph inside "box_2"', source=other.goal.inner, target=box.robot.goal)


@pytest.mark.rule("G1")
def test_subgraph_sends_by_events_what_is_asynchronous_inside_and_by_outputs_the_rest(graph: Graph) -> None:
    box = graph.add(Box())
    refused(box.graph, "declare done as hfg.Output", source=box.camera.count, target=box.done.inner)
    refused(box.graph, "declare result as hfg.Event", source=box.camera.seen, target=box.result.inner)
    box.graph.connect(box.camera.count, box.result.inner)
    box.graph.connect(box.camera.seen, box.done.inner)
    box.graph.connect(box.begin.inner, box.done.inner)
    box.graph.connect(box.goal.inner, box.result.inner)  # they converge here, on their way into a slot


@pytest.mark.rule("P2", "G4")
def test_output_of_what_iterates_takes_one_edge_inside(graph: Graph) -> None:
    box = graph.add(Box(), iterate_over=("goal",))
    box.graph.connect(box.camera.count, box.result.inner)
    refused(box.graph, '"box.result.inner" takes one edge', source=box.goal.inner, target=box.result.inner)


# --- options ---


@pytest.mark.rule("P4")
@pytest.mark.parametrize(
    "option", [{"capacity": 4}, {"overflow": "latest"}, {"through": [ops.take(1)]}, {"capacity_limit": 20}]
)
def test_synchronous_edges_have_no_queue(graph: Graph, camera: Camera, robot: Robot, option: dict[str, Any]) -> None:
    word = next(iter(option))
    refused(graph, word, '"camera.count" is an output', "rule P4", source=camera.count, target=robot.goal, **option)
    refused(graph, word, source=camera.ports.parameters["rate"], target=robot.speed, **option)


@pytest.mark.rule("P5")
@pytest.mark.parametrize("overflow", ["drop_oldest", "drop_newest", "latest", "error"])
def test_active_edges_lose_nothing(graph: Graph, camera: Camera, robot: Robot, overflow: str) -> None:
    refused(
        graph,
        "an active edge loses nothing",
        overflow,
        source=camera.seen,
        target=robot.look,
        active=True,
        overflow=overflow,
    )


@pytest.mark.rule("P9")
def test_active_edges_have_no_operators(graph: Graph, camera: Camera, robot: Robot) -> None:
    refused(graph, "operators", source=camera.seen, target=robot.look, active=True, through=[ops.debounce(1)])
    refused(graph, "operators", source=camera.seen.pipe(ops.take(1)), target=robot.look, active=True)


@pytest.mark.rule("P5")
@pytest.mark.parametrize(
    "wrong",
    [
        {"capacity": 0},
        {"capacity": 1.5},
        {"capacity": True},
        {"overflow": "forget"},
        {"capacity_limit": 3},
        {"capacity_limit": 20, "overflow": "drop_newest"},
        {"through": [3]},
        {"active": "yes"},
    ],
)
def test_options_out_of_range_are_refused_with_both_ends(
    graph: Graph, camera: Camera, robot: Robot, wrong: dict[str, Any]
) -> None:
    refused(graph, '"camera.seen" -> "robot.look"', next(iter(wrong)), source=camera.seen, target=robot.look, **wrong)


@pytest.mark.rule("P7")
def test_initial_tokens_are_values_of_the_targets_type_on_edges_into_inputs(
    graph: Graph, camera: Camera, robot: Robot
) -> None:
    refused(graph, "edges into inputs", source=camera.count, target=robot.look, initial=[1])
    refused(graph, "of type int, got 'one'", source=camera.count, target=robot.goal, initial=["one"])
    refused(graph, "takes values", source=camera.count, target=robot.goal, initial=[hfg.Token(1)])
    refused(
        graph,
        "event edge into a parameter",
        "Robot(limit=...)",
        call=lambda: graph.connect(reactivex.of(1.0), robot.ports.parameters["limit"], initial=[1.0]),
    )


def test_refusals_are_one_sentence_without_a_machine_path(graph: Graph, camera: Camera, robot: Robot) -> None:
    with pytest.raises(errors.ConnectionError) as error:
        graph.connect(camera.image, robot.goal)  # type: ignore[misc]
    assert not re.search(r"0x[0-9a-f]+|/\w+/\w+\.py", str(error.value))
