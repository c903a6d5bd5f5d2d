"""Grouping nodes into a subgraph and dissolving one, so that nobody else can tell (rule G1).

Each edge over the border gets a port of its own, in order, so that what a node sends keeps its order. Stands on
`changes` and `structure`.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import msgspec

from hfg.errors import GraphError
from hfg.graph.editing.changes import Change, EdgeChange, GateChange, NodeChange, PromotionChange
from hfg.graph.graph import Graph
from hfg.graph.structure.edges import Edge, refuse
from hfg.graph.structure.naming import need_name
from hfg.graph.structure.options import ACTIVE, PLAIN, EdgeOptions, NodeOptions, in_group
from hfg.graph.structure.subgraph import Subgraph
from hfg.ports import Event, InnerSource, InnerTarget, Input, Output, ParameterPort, slot

__all__ = ["Enclosed", "dissolve", "enclose"]

Do = Callable[[Change], None]


class Enclosed(Subgraph):
    """A subgraph that was made by grouping nodes; its ports are those that its edges needed."""


# --- grouping ---


def enclose(do: Do, members: Sequence[Any], name: str) -> None:
    """Put nodes of one graph into a new subgraph beside them.

    Raises:
      GraphError: the nodes are not of one graph, the name is taken, or a parameter of them is promoted.
    """
    around = _common_graph(members)
    if need_name("a subgraph", name) in around.nodes and around.nodes[name] not in members:
        raise GraphError(f'the subgraph cannot be named "{name}": {around._title} has a node of this name already')
    _refuse_promoted(around, members)
    inner = set(members)
    edges = [edge for edge in around.edges if not inner.isdisjoint((_owner(edge.source), _owner(edge.target)))]
    crossing = [edge for edge in edges if not {_owner(edge.source), _owner(edge.target)} <= inner]
    ports = _Names(crossing, inner)
    kind = types.new_class("Enclosed", (Enclosed,), exec_body=lambda body: body.update(ports.declarations()))
    box: Any = kind()
    in_order = [node for node in around.nodes.values() if node in inner]
    position = list(around.nodes).index(in_order[0].place.name)
    places = [(node, node.place.name, node._options, getattr(node, "_graph", None)) for node in in_order]
    spots = {edge: around.edges.index(edge) for edge in edges}
    for edge in reversed(edges):
        do(EdgeChange.of(around, edge, added=False, for_good=False))
    for node in in_order:
        do(NodeChange.of(node, added=False))
    inside = Graph._inside(box, around)
    do(NodeChange(around, name, box, NodeOptions(), position, inside, added=True))
    for node, own_name, options, within in places:
        do(NodeChange(inside, own_name, node, options, len(inside.nodes), within, added=True))
    left = 0  # edges with both ends inside, which are no more in the way
    for edge in edges:
        half = _outer_half(edge, box, ports, inner)
        if half is None:
            left += 1
        else:
            do(EdgeChange(around, half, spots[edge] - left, added=True, for_good=False))
    for edge in edges:
        do(EdgeChange(inside, _inner_half(edge, box, ports, inner), len(inside.edges), added=True, for_good=False))


def _common_graph(members: Sequence[Any]) -> Graph:
    if not members:
        raise GraphError("a subgraph is made of at least one node, got none")
    around: Graph = members[0].place.graph
    for node in members[1:]:
        if node.place.graph is not around:
            raise GraphError(
                f'"{members[0].place.path}" and "{node.place.path}" lie in different graphs; '
                "group nodes that lie side by side"
            )
    return around


def _refuse_promoted(around: Graph, members: Sequence[Any]) -> None:
    for name, ports in around._promoted.items():
        for port in ports:
            if port.node in members:
                raise GraphError(
                    f'"{port.path}" stands behind the parameter "{name}" of "{around.path}", '
                    "so its node stays directly inside; group the others"
                )


class _Names:
    """One port of the new subgraph for each edge over its border."""

    def __init__(self, crossing: Sequence[Edge], inner: set[Any]) -> None:
        self.inner = inner
        self.of: dict[Edge, tuple[str, str, Any]] = {}  # name, kind, type
        taken: set[str] = set()
        for edge in crossing:
            inwards = _owner(edge.target) in inner
            end = edge.target if inwards else edge.source
            wanted = end.name if _is_free(end.name) else f"{end.name}_port"
            name, number = wanted, 1
            while name in taken:
                number += 1
                name = f"{wanted}_{number}"
            taken.add(name)
            if inwards:
                kind = "slot" if end.kind == "slot" else "input"
            else:
                kind = "event" if end.kind == "event" else "output"
            self.of[edge] = (name, kind, end.type)

    def declarations(self) -> dict[str, Any]:
        """What stands in the body of the subgraph's class."""
        made: dict[str, Any] = {}
        for name, kind, type_ in self.of.values():
            match kind:
                case "slot":
                    made[name] = slot(type=type_)
                case "input":
                    made[name] = Input(type_)
                case "event":
                    made[name] = Event(type_)
                case _:
                    made[name] = Output(type_)
        return made

    def port(self, edge: Edge, box: Any) -> Any:
        """Give the bound port of an edge."""
        name, kind, _ = self.of[edge]
        return getattr(box.ports, f"{kind}s")[name]


def _is_free(name: str) -> bool:
    return not hasattr(Subgraph, name) and not name.startswith("_")


def _outer_half(edge: Edge, box: Any, ports: _Names, inner: set[Any]) -> Edge | None:
    """The part outside keeps what is said about the edge, for the outermost holds (rule G1)."""
    if edge not in ports.of:
        return None
    port = ports.port(edge, box)
    if _owner(edge.target) in inner:
        return Edge(edge.source, port, msgspec.structs.replace(edge.options, initial=()))
    return Edge(port, edge.target, edge.options)


def _inner_half(edge: Edge, box: Any, ports: _Names, inner: set[Any]) -> Edge:
    """Initial tokens go to the part at the target, so that what else is led there has none."""
    if edge not in ports.of:
        return edge
    relay = ports.port(edge, box).inner
    if _owner(edge.target) in inner:
        return Edge(relay, edge.target, EdgeOptions(active=edge.active, initial=edge.options.initial))
    return Edge(edge.source, relay, ACTIVE if edge.active else PLAIN)


# --- dissolving ---


def dissolve(do: Do, box: Any, levels: Sequence[Graph]) -> None:
    """Put what is inside a subgraph in its place.

    Raises:
      GraphError: it is no subgraph, something is said about the subgraph itself, or a name inside is taken outside.
    """
    around: Graph = box.place.graph
    _refuse_dissolving(box, levels)
    inside: Graph = box._graph
    position = list(around.nodes).index(box.place.name)
    group = box._options.group
    for node in inside.nodes.values():
        if node.place.name in around.nodes and around.nodes[node.place.name] is not box:
            raise GraphError(
                f'"{box.place.path}" cannot be dissolved: {around._title} has a node "{node.place.name}" already; '
                "rename one of the two"
            )
    outer = [
        edge for edge in around.edges if _relay(edge.source, box) is not None or _relay(edge.target, box) is not None
    ]
    before = list(around.edges)
    joined = {edge: list(_through(edge, box)) for edge in outer}
    own = {edge: list(_through(edge, box)) for edge in inside.edges}
    inner_parameters = dict(inside._promoted)
    members = list(inside.nodes.values())
    gates = [(level, gate) for level in levels for gate in level.gates if level is inside]
    for edge in reversed(outer):
        do(EdgeChange.of(around, edge, added=False, for_good=False))
    for edge in reversed(list(inside.edges)):
        do(EdgeChange.of(inside, edge, added=False, for_good=False))
    for level, gate in reversed(gates):
        do(GateChange(level, gate, level.gates.index(gate), added=False))
    if around._promoted:
        opened = {
            name: [
                one for port in ports for one in (inner_parameters.get(port.name, ()) if port.node is box else (port,))
            ]
            for name, ports in around._promoted.items()
        }
        do(PromotionChange(around, dict(around._promoted), opened))
    if inside._promoted:
        do(PromotionChange(inside, inner_parameters, {}))
    moves = [(node, node.place.name, node._options, getattr(node, "_graph", None)) for node in members]
    for node in reversed(members):
        do(NodeChange.of(node, added=False))
    do(NodeChange.of(box, added=False))
    for offset, (node, name, options, within) in enumerate(moves):
        if options.group is None and group is not None:
            options = in_group(options, group)
        do(NodeChange(around, name, node, options, position + offset, within, added=True))
    at = 0
    for edge in before:
        if edge not in outer:
            at += 1
            continue
        for whole in joined.get(edge, ()):
            refuse(around, whole.source, whole.target, whole.options)
            do(EdgeChange(around, whole, at, added=True, for_good=False))
            at += 1
    for edges in own.values():
        for whole in edges:
            refuse(around, whole.source, whole.target, whole.options)
            do(EdgeChange(around, whole, len(around.edges), added=True, for_good=False))
    for _, gate in gates:
        do(GateChange(around, gate, len(around.gates), added=True))


def _refuse_dissolving(box: Any, levels: Sequence[Graph]) -> None:
    path = box.place.path
    if getattr(box, "_graph", None) is None:
        raise GraphError(f'"{path}" is no subgraph, so it cannot be dissolved; name a node that holds a graph')
    options = box._options
    fitting = msgspec.structs.replace(NodeOptions(), group=options.group)
    for name in NodeOptions.__struct_fields__:
        if getattr(options, name) != getattr(fitting, name):
            raise GraphError(
                f'"{path}" cannot be dissolved: it says {name}={getattr(options, name)!r}; take that out first'
            )
    for level in levels:
        for gate in level.gates:
            if box in (gate.target, gate.by):
                raise GraphError(f'"{path}" cannot be dissolved: a gate names it; gate the nodes inside')
    for edge in box.place.graph.edges:
        for end in (edge.source, edge.target):
            if _owner(end) is box and _relay(end, box) is None and not isinstance(end, ParameterPort):
                raise GraphError(
                    f'"{path}" cannot be dissolved: the edge {edge.label} belongs to the subgraph itself, '
                    "not to a node inside; remove it first"
                )


def _relay(end: Any, box: Any) -> Any:
    """The port of the subgraph that an end is a side of, parameters apart that lead inside by promotion."""
    outer: Any = getattr(end, "outer", end)
    owner: Any = getattr(outer, "node", None)
    if owner is not box:
        return None
    if outer.kind == "parameter":
        return outer
    return outer if outer.name in getattr(box._type, f"{outer.kind}s") else None


def _through(edge: Edge, box: Any) -> Iterator[Edge]:
    """Give the edges that one becomes when the subgraph's border is gone; what begins there is met on the way."""
    begin = _relay(edge.source, box)
    source = edge.source
    if begin is not None:
        inner = box._graph._promoted.get(begin.name, ()) if begin.kind == "parameter" else ()
        if not inner:
            return
        source = inner[0]  # of several that a parameter stands for the first sends
    stack: list[tuple[Edge, ...]] = [(edge,)]
    while stack:
        parts = stack.pop()
        relay = _relay(parts[-1].target, box)
        if relay is None:
            yield _joined(parts, source, parts[-1].target, box)
        elif relay.kind == "parameter":
            for port in box._graph._promoted.get(relay.name, ()):
                yield _joined(parts, source, port, box)
        else:
            onward = box.place.graph.edges if isinstance(parts[-1].target, InnerTarget) else box._graph.edges
            stack += [
                (*parts, one)
                for one in reversed(onward)
                if _relay(one.source, box) is relay and one.source is not parts[-1].target and one not in parts
            ]


def _joined(parts: tuple[Edge, ...], source: Any, target: Any, box: Any) -> Edge:
    if len(parts) == 1 and parts[0].source is source and parts[0].target is target:
        return parts[0]
    first_outside = next((one for one in parts if not _is_inside(one, box)), parts[0]).options
    options = EdgeOptions(
        active=all(one.active for one in parts),
        capacity=first_outside.capacity,
        overflow=first_outside.overflow,
        capacity_limit=first_outside.capacity_limit,
        through=tuple(operator for one in parts for operator in one.options.through),
        initial=tuple(value for one in reversed(parts) for value in one.options.initial),
    )
    return Edge(source, target, options)


def _is_inside(edge: Edge, box: Any) -> bool:
    return edge in box._graph.edges


def _owner(end: Any) -> Any:
    return None if isinstance(end, InnerSource | InnerTarget) else getattr(end, "node", None)
