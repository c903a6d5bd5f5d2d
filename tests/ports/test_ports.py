"""What all ports share: directions, names, paths, inner sides, and connecting by `>>` and `activates`."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

import hfg
from hfg.errors import DeclarationError, NotRunning, UsageError
from hfg.nodetypes.node import Place
from hfg.ports import EventPort, InnerSource, InnerTarget, Relaying, Source, Target


class Camera(hfg.Node):
    image = hfg.Output(bytes)

    def process(self) -> None: ...


class Detector(hfg.Node):
    image = hfg.Input(bytes)
    mask = hfg.Input(bytes, optional=True, default=b"")
    found = hfg.Output(int)
    lost = hfg.Event(int)
    speed = hfg.Parameter(1.0)

    def process(self, image, mask): ...  # type: ignore[no-untyped-def]

    @hfg.slot
    def look(self, where: int) -> int:
        return where + 1


class Show(hfg.Node):
    def process(self, value: object) -> None: ...


class Box(hfg.Node, Relaying):
    goal = hfg.Input(int)
    pose = hfg.Output(int)
    done = hfg.Event()
    begin = hfg.slot(type=int)
    speed = hfg.Parameter(2.5)


class FakeGraph:
    """Remembers what it was asked to connect."""

    def __init__(self) -> None:
        self._place = None
        self.edges: list[Any] = []

    def add(self, node: Any, path: str) -> Any:
        node._place = Place(self, path.rpartition("/")[2], path)
        return node

    def connect(self, source: Any, target: Any, *, active: bool = False) -> Any:
        self.edges.append(SimpleNamespace(source=source, target=target, active=active))
        return self.edges[-1]

    def _is_taken(self, port: Any) -> bool:
        return port.kind == "input" and any(edge.target is port for edge in self.edges)


def test_kinds_are_told_by_name() -> None:
    ports = Detector().ports
    every = [*ports.inputs.values(), *ports.outputs.values(), *ports.events.values()]
    every += [*ports.slots.values(), *ports.parameters.values()]
    assert [(port.kind, port.name, port.type) for port in every] == [
        ("input", "image", bytes),
        ("input", "mask", bytes),
        ("output", "found", int),
        ("event", "lost", int),
        ("slot", "look", int),
        ("parameter", "speed", float),
    ]


def test_directions_are_classes() -> None:
    node, box = Detector(), Box()
    sources = [node.found, node.lost, node.ports.parameters["speed"], box.goal.inner, box.begin.inner]
    targets = [node.image, node.look, node.ports.parameters["speed"], box.pose.inner, box.done.inner]
    assert all(isinstance(port, Source) for port in sources)
    assert all(isinstance(port, Target) for port in targets)
    assert not any(isinstance(port, Source) for port in (node.image, node.look, box.pose.inner))
    assert not any(isinstance(port, Target) for port in (node.found, node.lost, box.goal.inner))


def test_on_the_class_a_port_is_the_plain_declaration_on_the_node_the_bound_port() -> None:
    assert isinstance(Detector.image, hfg.Input)
    assert isinstance(Detector.lost, hfg.Event)
    node = Detector()
    assert node.image is node.image is node.ports.inputs["image"]
    assert node.image is not Detector().image


def test_a_port_asked_for_once_is_a_plain_attribute() -> None:
    node = Detector()
    assert node.__dict__ == {}
    port = node.lost
    assert node.__dict__ == {"lost": port}


@pytest.mark.rule("G3")
def test_a_path_is_the_types_name_first_and_the_nodes_place_later() -> None:
    node = Detector()
    assert node.found.path == "detector.found"
    FakeGraph().add(node, "vision/detector_2")
    assert node.found.path == "vision/detector_2.found"
    assert repr(node.found) == "<output vision/detector_2.found>"


def test_ports_of_a_graph_stand_without_a_dot() -> None:
    graph = FakeGraph()
    assert EventPort(graph, "start").path == "start"


def test_sending_outside_a_run_says_what_to_do() -> None:
    with pytest.raises(NotRunning, match=r'"detector\.found" cannot send outside a run'):
        Detector().found.send(3)


def test_a_send_hands_value_modifier_and_stamp_to_the_runner() -> None:
    calls: list[Any] = []
    port = Detector().found
    port._emit = lambda *call: calls.append(call)
    port.send(3)
    port.send(None, activity=-1, stamp=2.0)
    assert calls == [(3, None, None), (None, -1, 2.0)]


def test_an_unknown_port_is_named_with_those_that_exist() -> None:
    with pytest.raises(KeyError) as caught:
        Detector().ports.inputs["picture"]
    assert str(caught.value) == 'node type detector has no input "picture"; its inputs are "image", "mask"'
    assert "picture" not in Detector().ports.inputs
    assert Detector().ports.outputs.get("picture") is None


@pytest.mark.rule("A9")
def test_automatic_ports_are_there_without_being_declared() -> None:
    node = Detector()
    assert list(node.ports.events) == ["lost"]
    assert list(node.ports.slots) == ["look"]
    for name in ("activated", "deactivated", "processed", "failed", "timeout"):
        assert node.ports.events[name] is getattr(node, name)
    for name in ("enable", "disable", "activate", "deactivate", "reset"):
        assert node.ports.slots[name] is getattr(node, name)
    assert node.failed.type is hfg.Failure


@pytest.mark.rule("A9")
def test_an_automatic_slot_cannot_be_called() -> None:
    with pytest.raises(UsageError, match=r'"detector\.enable" has no handler to call'):
        Detector().enable()


@pytest.mark.rule("G2")
def test_a_subgraph_has_only_the_automatic_ports_that_make_sense() -> None:
    box = Box()
    assert [box.activated.name, box.timeout.name, box.enable.name, box.reset.name]
    with pytest.raises(UsageError, match=r'subgraph "box" has no slot "activate" because it does not fire itself'):
        _ = box.activate
    with pytest.raises(UsageError, match='has no event "processed"'):
        _ = box.processed
    with pytest.raises(KeyError):
        box.ports.slots["activate"]


@pytest.mark.rule("G1")
def test_the_inner_side_of_a_port_turns_its_direction() -> None:
    box = Box()
    assert isinstance(box.goal.inner, InnerSource)
    assert isinstance(box.begin.inner, InnerSource)
    assert isinstance(box.pose.inner, InnerTarget)
    assert isinstance(box.done.inner, InnerTarget)
    assert box.goal.inner is box.goal.inner
    inner = box.goal.inner
    assert (inner.outer, inner.node, inner.name, inner.type, inner.kind) == (box.goal, box, "goal", int, "input")
    assert inner.path == "box.goal.inner"
    assert repr(inner) == "<inner input box.goal.inner>"


@pytest.mark.rule("G1")
@pytest.mark.parametrize("name", ["image", "found", "lost", "look"])
def test_a_node_that_is_no_subgraph_has_no_inner_side(name: str) -> None:
    with pytest.raises(UsageError, match=rf'"detector\.{name}" has no inner side'):
        _ = getattr(Detector(), name).inner
    with pytest.raises(UsageError, match='node "detector" has no inner side'):
        _ = Detector().inner


@pytest.mark.rule("G3")
def test_a_parameter_is_a_value_on_a_node_and_a_port_on_a_subgraph() -> None:
    node, box = Detector(), Box(speed=3.0)
    assert node.speed == 1.0
    assert box.speed.kind == "parameter"
    assert box.speed.value == 3.0
    assert box.speed is box.ports.parameters["speed"]


@pytest.mark.rule("A1")
def test_activates_draws_an_active_edge() -> None:
    graph = FakeGraph()
    detector = graph.add(Detector(), "detector")
    edge = detector.lost.activates(detector.look)
    assert edge.active
    assert graph.edges == [edge]


def test_connecting_what_is_in_no_graph_says_so() -> None:
    with pytest.raises(UsageError, match=r'"camera\.image" and "detector\.image" do not belong to a graph yet'):
        _ = Camera().image >> Detector().image


def test_nodes_connect_by_their_only_ports_and_chains_read_from_left_to_right() -> None:
    graph = FakeGraph()
    camera, show = graph.add(Camera(), "camera"), graph.add(Show(), "show")
    assert camera >> show is show
    assert camera.image >> show is show
    assert camera >> show.value is show.value
    assert [(edge.source, edge.target) for edge in graph.edges] == [(camera.image, show.value)] * 3


def test_what_is_ambiguous_is_refused_and_both_are_named() -> None:
    graph = FakeGraph()
    camera, detector, show = (graph.add(node, node._type.name) for node in (Camera(), Detector(), Show()))
    with pytest.raises(UsageError, match=r'output "detector\.found" and event "detector\.lost"'):
        _ = detector >> show
    with pytest.raises(UsageError, match=r'input "detector\.image" and input "detector\.mask" and slot'):
        _ = camera >> detector
    graph.connect(camera.image, detector.image)
    graph.connect(camera.image, detector.mask)
    _ = camera >> detector  # the slot alone is free now
    assert graph.edges[-1].target is detector.look


def test_a_node_without_a_port_for_it_is_refused() -> None:
    graph = FakeGraph()
    camera, show = graph.add(Camera(), "camera"), graph.add(Show(), "show")
    with pytest.raises(UsageError, match='node "show" has no output or event for >>'):
        _ = show >> camera
    with pytest.raises(UsageError, match='node "camera" has no free input or slot for >>'):
        _ = camera >> camera
    with pytest.raises(TypeError, match="unsupported operand"):
        _ = camera >> 3


def test_a_default_needs_an_optional_input() -> None:
    with pytest.raises(DeclarationError, match="optional=True"):
        hfg.Input(int, default=3)


def test_writing_over_a_port_is_found_out() -> None:
    node = Detector()
    node.found = 3  # type: ignore[assignment]
    with pytest.raises(
        UsageError, match=r'"detector\.found" is a port, but .* wrote 3 over it; write self\.found\.send'
    ):
        node.ports.outputs["found"]
