"""Flattening: what a graph is once its subgraphs are dissolved."""

from __future__ import annotations

from typing import Any

import pytest
import reactivex
from reactivex import operators as ops

import hfg
from hfg.graph import Graph, Subgraph
from hfg.graph.flat import ROOT, flatten, scope_end


class Unit(hfg.Node):
    a = hfg.Input(int, optional=True)
    b = hfg.Input(int, optional=True)
    out = hfg.Output(int)
    seen = hfg.Event(int)
    gain = hfg.Parameter(1)

    def process(self, a: int | None, b: int | None) -> int: ...

    @hfg.slot
    def look(self, at: int) -> None: ...


class Box(Subgraph):
    """One unit with all its ports led out."""

    a = hfg.Input(int)
    look = hfg.slot(type=int)
    out = hfg.Output(int)
    seen = hfg.Event(int)
    gain = hfg.Parameter(2)

    def build(self, graph: Graph) -> None:
        self.unit = graph.add(Unit())
        graph.connect(self.a.inner, self.unit.a)
        graph.connect(self.look.inner, self.unit.look)
        graph.connect(self.unit.out, self.out.inner)
        graph.connect(self.unit.seen, self.seen.inner)
        graph.promote(self.gain, self.unit.ports.parameters["gain"])


class Deep(Subgraph):
    """A box in a box."""

    a = hfg.Input(int)
    out = hfg.Output(int)
    gain = hfg.Parameter(3)

    def build(self, graph: Graph) -> None:
        self.before = graph.add(Unit())
        self.box = graph.add(Box())
        graph.connect(self.a.inner, self.box.a)
        graph.connect(self.box.out, self.out.inner)
        graph.promote(self.gain, self.box.gain)
        graph.promote(self.gain, self.before.ports.parameters["gain"])


@pytest.fixture
def graph() -> Graph:
    return Graph("fetch")


def labels(graph: Graph) -> list[str]:
    return [edge.label for edge in flatten(graph).edges]


@pytest.mark.rule("G1", "G3")
def test_nodes_come_in_depth_first_order_with_their_scopes(graph: Graph) -> None:
    graph.add(Unit(), name="first")
    graph.add(Deep())
    graph.add(Unit(), name="last")
    flat = flatten(graph)
    assert [(node.index, node.path, node.scopes) for node in flat.nodes] == [
        (0, "first", ()),
        (1, "deep/unit", (0,)),
        (2, "deep/box/unit", (0, 1)),
        (3, "last", ()),
    ]
    assert [(scope.path, scope.parent, scope.members) for scope in flat.scopes] == [
        ("deep", None, [1, 2]),
        ("deep/box", 0, [2]),
    ]


@pytest.mark.rule("G1")
def test_edges_through_relays_are_one_edge(graph: Graph) -> None:
    first, deep, last = graph.add(Unit(), name="first"), graph.add(Deep()), graph.add(Unit(), name="last")
    graph.connect(first.out, deep.a)
    graph.connect(deep.out, last.a)
    flat = flatten(graph)
    assert [(edge.label, edge.via) for edge in flat.edges] == [
        ("first.out -> deep/box/unit.a", (0, 1)),
        ("deep/box/unit.out -> last.a", (1, 0)),
    ]
    assert [edge.index for edge in flat.edges] == [0, 1]
    ends = [(edge.source.node, edge.source.kind, edge.target.node, edge.target.kind) for edge in flat.edges]
    assert ends == [(0, "output", 2, "input"), (2, "output", 3, "input")]
    assert flat.edges[0].source.port is first.out
    assert flat.edges[0].segments[0] is graph.edges[0]


@pytest.mark.rule("G1")
def test_relay_without_an_edge_on_one_side_is_no_edge(graph: Graph) -> None:
    graph.add(Deep())
    assert labels(graph) == []


@pytest.mark.rule("G1")
def test_what_passes_through_a_subgraph_without_a_node_is_an_edge_too(graph: Graph) -> None:
    class Pass(Subgraph):
        a = hfg.Input(int)
        out = hfg.Output(int)

        def build(self, graph: Graph) -> None:
            graph.connect(self.a.inner, self.out.inner)

    first, last = graph.add(Unit(), name="first"), graph.add(Unit(), name="last")
    one, two = graph.add(Pass()), graph.add(Pass())
    graph.connect(first.seen, one.a)
    graph.connect(one.out, two.a)
    graph.connect(two.out, last.a)
    flat = flatten(graph)
    assert [(edge.label, edge.via, edge.is_event_edge) for edge in flat.edges] == [
        ("first.seen -> last.a", (0, 0, 1, 1), True)
    ]


@pytest.mark.rule("G1")
def test_joined_edge_is_active_if_all_parts_are(graph: Graph) -> None:
    class Half(Subgraph):
        hot = hfg.slot(type=int)
        cold = hfg.slot(type=int)

        def build(self, graph: Graph) -> None:
            unit = graph.add(Unit())
            graph.connect(self.hot.inner, unit.look, active=True)
            graph.connect(self.cold.inner, graph.add(Unit()).look)

    half, unit = graph.add(Half()), graph.add(Unit(), name="first")
    unit.seen.activates(half.hot)
    unit.seen.activates(half.cold)
    graph.connect(unit.out, half.hot)
    active = [(edge.label, edge.active) for edge in flatten(graph).edges]
    assert active == [
        ("first.seen -> half/unit.look", True),
        ("first.seen -> half/unit_2.look", False),
        ("first.out -> half/unit.look", False),
    ]


@pytest.mark.rule("G1", "P9")
def test_outer_queue_holds_operators_follow_each_other_and_initial_tokens_add_up(graph: Graph) -> None:
    first, second, third = ops.take(1), ops.take(2), ops.take(3)

    class Queue(Subgraph):
        a = hfg.Input(int)
        seen = hfg.Event(int)

        def build(self, graph: Graph) -> None:
            unit = graph.add(Unit())
            graph.connect(self.a.inner, unit.a, capacity=3, through=[third], initial=[1, 2])
            graph.connect(unit.seen, self.seen.inner, overflow="drop_newest", through=[first])

    one, two = graph.add(Queue()), graph.add(Queue())
    graph.connect(one.seen, two.a, capacity=7, overflow="drop_oldest", through=[second], initial=[3])
    (edge,) = flatten(graph).edges
    assert edge.label == "queue/unit.seen -> queue_2/unit.a"
    assert (edge.options.capacity, edge.options.overflow, edge.options.through) == (
        7,
        "drop_oldest",
        (first, second, third),
    )
    assert edge.options.initial == (1, 2, 3)  # nearest to the consumer is taken first


@pytest.mark.rule("G2")
def test_automatic_ports_of_a_subgraph_remain(graph: Graph) -> None:
    box, unit = graph.add(Box()), graph.add(Unit())
    graph.connect(box.activated, unit.enable)
    graph.connect(unit.seen, box.disable)
    flat = flatten(graph)
    assert [edge.label for edge in flat.edges] == ["box.activated -> unit.enable", "unit.seen -> box.disable"]
    assert [edge.source.node for edge in flat.edges] == [scope_end(0), 1]
    assert scope_end(scope_end(5)) == 5
    assert [edge.via for edge in flat.edges] == [(), ()]


@pytest.mark.rule("A10", "P10")
def test_ports_of_the_whole_are_at_the_root(graph: Graph) -> None:
    box = graph.add(Box())
    graph.connect(graph.input("keys", int), box.a)
    graph.connect(box.out, graph.output("poses", int))
    graph.connect(graph.start, box.enable)
    graph.connect(box.seen, graph.stop)
    box.graph.connect(box.unit.failed, graph.abort)
    flat = flatten(graph)
    assert [edge.label for edge in flat.edges] == [
        "keys -> box/unit.a",
        "start -> box.enable",
        "box/unit.out -> poses",
        "box/unit.seen -> stop",
        "box/unit.failed -> abort",
    ]
    root = [(end.kind, end.name) for edge in flat.edges for end in (edge.source, edge.target) if end.node == ROOT]
    assert root == [("output", "keys"), ("event", "start"), ("input", "poses"), ("slot", "stop"), ("slot", "abort")]


@pytest.mark.rule("P8", "G3")
def test_edges_to_promoted_parameters_lead_to_all_they_stand_for(graph: Graph) -> None:
    deep, unit = graph.add(Deep()), graph.add(Unit(), name="first")
    graph.connect(unit.out, deep.gain)
    graph.connect(unit.seen, graph.add(Box()).gain)
    graph.connect(graph.add(Deep()).gain, unit.a)
    flat = flatten(graph)
    assert [edge.label for edge in flat.edges] == [
        "first.out -> deep/box/unit.gain",
        "first.out -> deep/unit.gain",
        "first.seen -> box/unit.gain",
        "deep_2/box/unit.gain -> first.a",
    ]
    assert [edge.target.kind for edge in flat.edges] == ["parameter", "parameter", "parameter", "input"]
    assert [edge.via for edge in flat.edges] == [(0, 1), (0,), (2,), (3, 4)]


def test_observables_have_no_node(graph: Graph) -> None:
    box = graph.add(Box())
    feed: reactivex.Observable[int] = reactivex.of(1)
    graph.connect(feed, box.a)
    (edge,) = flatten(graph).edges
    assert (edge.label, edge.source.node, edge.source.kind, edge.source.port) == (
        "observable -> box/unit.a",
        ROOT,
        "observable",
        feed,
    )
    assert edge.is_event_edge


def test_labels_are_one_of_a_kind(graph: Graph) -> None:
    first, second = graph.add(Unit()), graph.add(Unit())
    graph.connect(reactivex.of(1), first.look)
    graph.connect(reactivex.of(2), first.look)
    graph.connect(reactivex.of(2), second.look)
    assert labels(graph) == ["observable -> unit.look", "observable -> unit.look #2", "observable -> unit_2.look"]


def test_group_is_inherited_from_the_subgraph_around(graph: Graph) -> None:
    class Mixed(Subgraph):
        def build(self, graph: Graph) -> None:
            graph.add(Unit(), group="arm")
            graph.add(Unit())
            graph.add(Box())

    graph.add(Mixed(), group="vision")
    graph.add(Unit())
    groups = {node.path: node.options.group for node in flatten(graph).nodes}
    assert groups == {"mixed/unit": "arm", "mixed/unit_2": "vision", "mixed/box/unit": "vision", "unit": "loop"}


@pytest.mark.rule("A11")
def test_gates_name_nodes_and_scopes(graph: Graph) -> None:
    unit, box = graph.add(Unit()), graph.add(Box())
    graph.gate(unit, by=box, idle_rate_hz=2.0)
    graph.gate(box, by=unit)
    gates = [(gate.target, gate.by, gate.idle_rate_hz) for gate in flatten(graph).gates]
    assert gates == [(0, scope_end(0), 2.0), (scope_end(0), 0, None)]


@pytest.mark.rule("G4")
def test_iterating_subgraph_stays_one_node_with_a_flat_graph_inside(graph: Graph) -> None:
    class Each(Deep):
        iterate_over = ("a",)

    class Around(Subgraph):
        def build(self, graph: Graph) -> None:
            graph.add(Each(), name="each")

    graph.add(Unit())
    graph.add(Around())
    flat = flatten(graph)
    assert [(node.path, node.scopes) for node in flat.nodes] == [("unit", ()), ("around/each", (0,))]
    inside = flat.nodes[1].iteration
    assert inside is not None
    assert [(node.path, node.scopes) for node in inside.nodes] == [
        ("around/each/unit", ()),
        ("around/each/box/unit", (0,)),
    ]
    assert [edge.label for edge in inside.edges] == [
        "around/each.a -> around/each/box/unit.a",
        "around/each/box/unit.out -> around/each.out",
    ]
    assert [(edge.source.node, edge.source.kind, edge.source.name) for edge in inside.edges] == [
        (ROOT, "output", "a"),
        (1, "output", "out"),
    ]
    assert [one.graph for one in flat.walk()] == [graph, graph["around/each"].graph]


def test_flattening_changes_nothing_in_the_graph(graph: Graph) -> None:
    unit, deep = graph.add(Unit()), graph.add(Deep())
    graph.connect(unit.out, deep.a)
    before = (list(graph.edges), dict(graph.nodes), unit._options)
    first, second = flatten(graph), flatten(graph)
    assert (list(graph.edges), dict(graph.nodes), unit._options) == before
    assert [edge.label for edge in first.edges] == [edge.label for edge in second.edges]


@pytest.mark.rule("G3")
def test_deep_nesting_does_not_recurse(graph: Graph) -> None:
    """The boxes are put together by hand: only `build` of users recurses, not ours."""
    depth = 1_200

    class Shell(Subgraph):
        a = hfg.Input(int)

    around: Any = graph
    outer: Any = graph.input("keys", int)
    for _ in range(depth):
        shell = around.add(Shell())
        around.connect(outer, shell.a)
        around, outer = shell.graph, shell.a.inner
    around.connect(outer, around.add(Unit()).a)
    flat = flatten(graph)
    assert len(flat.scopes) == depth
    (edge,) = flat.edges
    assert len(edge.segments) == depth + 1
    assert edge.label.endswith("shell/unit.a")
