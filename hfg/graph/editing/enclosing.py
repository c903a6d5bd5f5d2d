"""Grouping nodes into a subgraph and dissolving one, without any effect on other nodes (rule G1).

Each edge over the border gets a port of its own, in order, so that what a node sends keeps its order. Depends on
`changes`, `queue_conflicts` and levels.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeAlias

from hfg.errors import GraphError
from hfg.graph.editing.boxes import DECLARED, is_free
from hfg.graph.editing.changes import Change, EdgeChange, GateChange, NodeChange, PromotionChange
from hfg.graph.editing.queue_conflicts import refuse_other_queues
from hfg.graph.structure.connecting import refuse
from hfg.graph.structure.edge import Edge, SourceEnd, TargetEnd, owner_of
from hfg.graph.structure.joining import inner_part, joined, outer_part
from hfg.graph.structure.level import Level, inside, level_of
from hfg.graph.structure.naming import need_name
from hfg.graph.structure.options import PLAIN_NODE, EdgeOptions, in_group
from hfg.graph.structure.subgraph import Box
from hfg.nodetypes.node import Node
from hfg.ports import InnerSource, InnerTarget, ParameterPort, Port

Do: TypeAlias = Callable[[Change], None]
End: TypeAlias = SourceEnd | TargetEnd


# --- grouping ---


def enclose(do: Do, members: Sequence[Node], name: str) -> None:
    """Put nodes of one graph into a new subgraph of this graph.

    Raises:
      GraphError: the nodes are not of one graph, the name is taken, a parameter of them is promoted, or an edge would
        have another queue.
    """
    around = _common_level(members)
    if need_name("a subgraph", name) in around.nodes and around.nodes[name] not in members:
        raise GraphError(f'the subgraph cannot be named "{name}": {around.title} has a node of this name already')
    _refuse_promoted(around, members)
    inner = set(members)
    near = around.connections.at(*members)
    edges = [edge for edge in near if not inner.isdisjoint((owner_of(edge.source), owner_of(edge.target)))]
    crossing = [edge for edge in edges if not {owner_of(edge.source), owner_of(edge.target)} <= inner]
    outwards = ((edge, edge.options) for edge in crossing if owner_of(edge.source) in inner)
    refuse_other_queues(around, outwards, crossing.__contains__, "grouping")
    kind = around.whole.box_type
    ports = _Names(crossing, inner, kind)
    body = {port: DECLARED[f"{kind}s"](type_) for port, kind, type_ in ports.of.values()}
    box: Box = types.new_class(kind.__name__, (kind,), exec_body=lambda names: names.update(body))()
    halves = [(edge, around.connections.position(edge), _outer_half(edge, box, ports, inner)) for edge in edges]
    for edge in reversed(edges):
        do(EdgeChange.of(around, edge, added=False, for_good=False))
    within = _take_in(do, around, box, name, sorted(inner, key=around.members.order.label))
    left = 0  # edges with both ends inside, which are no more in the way
    for _, spot, half in halves:
        if half is None:
            left += 1
        else:
            do(EdgeChange(around, half, spot - left, added=True, for_good=False))
    for edge in edges:
        do(EdgeChange(within, _inner_half(edge, box, ports, inner), len(within.edges), added=True, for_good=False))


def _take_in(do: Do, around: Level, box: Box, name: str, members: Sequence[Node]) -> Level:
    """Let a new subgraph stand where the first of some nodes stood, and the nodes inside it."""
    position = around.members.position(members[0].place.name)
    places = [(node, node.place.name, node._options, inside(node)) for node in members]
    for node in members:
        do(NodeChange.of(node, added=False))
    within = around.make_inside(box)
    do(NodeChange(around, name, box, PLAIN_NODE, position, within, added=True))
    for node, own_name, options, own_inside in places:
        do(NodeChange(within, own_name, node, options, len(within.nodes), own_inside, added=True))
    return within


def _common_level(members: Sequence[Node]) -> Level:
    if not members:
        raise GraphError("a subgraph is made of at least one node, got none")
    around = level_of(members[0].place.graph)
    for node in members[1:]:
        if level_of(node.place.graph) is not around:
            raise GraphError(
                f'"{members[0].place.path}" and "{node.place.path}" lie in different graphs; '
                "group nodes that lie side by side"
            )
    return around


def _refuse_promoted(around: Level, members: Sequence[Node]) -> None:
    for name, ports in around.promotions.by_name.items():
        for port in ports:
            if port.node in members:
                raise GraphError(
                    f'"{port.path}" is set by the parameter "{name}" of "{around.path}", '
                    "so its node stays directly inside; group the others"
                )


class _Names:
    """One port of the new subgraph for each edge over its border."""

    def __init__(self, crossing: Sequence[Edge], inner: set[Node], box_type: type[Box]) -> None:
        self.inner = inner
        self.of: dict[Edge, tuple[str, str, Any]] = {}  # name, kind, type
        taken: set[str] = set()
        for edge in crossing:
            inwards = owner_of(edge.target) in inner
            end = edge.target if inwards else edge.source
            # each port of a vector is a port of its own here, and so is the event of an output
            plain = end.name.replace("[", "_").replace("]", "").replace(".", "_")
            wanted = plain if is_free(plain, box_type) else f"{plain}_port"
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

    def port(self, edge: Edge, box: Box) -> Any:  # noqa: ANN401 - of the kind that the edge needs
        """Return the bound port of an edge."""
        name, kind, _ = self.of[edge]
        return getattr(box.ports, f"{kind}s")[name]


def _outer_half(edge: Edge, box: Box, ports: _Names, inner: set[Node]) -> Edge | None:
    """The part outside keeps the options of the edge, because those of the outermost part hold (rule G1)."""
    if edge not in ports.of:
        return None
    port = ports.port(edge, box)
    if owner_of(edge.target) in inner:
        return Edge(edge.source, port, outer_part(edge.options))
    return Edge(port, edge.target, edge.options)


def _inner_half(edge: Edge, box: Box, ports: _Names, inner: set[Node]) -> Edge:
    """Initial tokens go to the part at the target, so that what else is led there has none."""
    if edge not in ports.of:
        return edge
    relay = ports.port(edge, box).inner
    if owner_of(edge.target) in inner:
        return Edge(relay, edge.target, inner_part(edge.options, has_target=True))
    return Edge(edge.source, relay, inner_part(edge.options, has_target=False))


# --- dissolving ---


def dissolve(do: Do, box: Node, levels: Sequence[Level]) -> None:
    """Put what is inside a subgraph in its place.

    Raises:
      GraphError: it is not a subgraph, it has options of its own, a name inside is taken outside, or an edge would
        have another queue.
    """
    around, within = level_of(box.place.graph), _need_dissolvable(box, levels)
    border = _Border(box, around, within)
    refuse_other_queues(within, border.outwards(), border.is_at, "dissolving")
    joined = {edge: border.through(edge) for edge in around.connections.at(box) if border.is_at(edge)}
    spots = [around.connections.position(edge) for edge in joined]
    own = [whole for edge in within.edges for whole in border.through(edge)]
    gates = list(within.gates)
    for edge in reversed(joined):
        do(EdgeChange.of(around, edge, added=False, for_good=False))
    for edge in reversed(list(within.edges)):
        do(EdgeChange.of(within, edge, added=False, for_good=False))
    for gate in reversed(gates):
        do(GateChange(within, gate, within.gates.listed.index(gate), added=False))
    _open_promotions(do, box, around, within)
    _let_out(do, box, around, within)
    more = 0  # than there were
    for number, (spot, wholes) in enumerate(zip(spots, joined.values(), strict=True)):
        for whole in wholes:
            refuse(around, whole.source, whole.target, whole.options)
            do(EdgeChange(around, whole, spot - number + more, added=True, for_good=False))
            more += 1
    for whole in own:
        refuse(around, whole.source, whole.target, whole.options)
        do(EdgeChange(around, whole, len(around.edges), added=True, for_good=False))
    for gate in gates:
        do(GateChange(around, gate, len(around.gates.listed), added=True))


def _open_promotions(do: Do, box: Node, around: Level, within: Level) -> None:
    """Let what stood for a parameter of the subgraph stand for what that stood for."""
    inner = within.promotions.copied()
    if around.promotions.by_name:
        outer = around.promotions.copied()
        opened = {
            name: [one for port in ports for one in (inner.get(port.name, ()) if port.node is box else (port,))]
            for name, ports in outer.items()
        }
        do(PromotionChange(around, outer, opened))
    if inner:
        do(PromotionChange(within, inner, {}))


def _let_out(do: Do, box: Node, around: Level, within: Level) -> None:
    """Put the nodes of a subgraph in its place; those without a group get the group of the subgraph."""
    position, group = around.members.position(box.place.name), box._options.group
    moves = [(node, node.place.name, node._options, inside(node)) for node in within.nodes.values()]
    for node in reversed(list(within.nodes.values())):
        do(NodeChange.of(node, added=False))
    do(NodeChange.of(box, added=False))
    for offset, (node, name, options, own_inside) in enumerate(moves):
        if options.group is None and group is not None:
            options = in_group(options, group)
        do(NodeChange(around, name, node, options, position + offset, own_inside, added=True))


def _need_dissolvable(box: Node, levels: Sequence[Level]) -> Level:
    """Return what is inside a subgraph that can be dissolved."""
    path, within = box.place.path, inside(box)
    if within is None:
        raise GraphError(f'"{path}" is not a subgraph, so it cannot be dissolved; name a node that holds a graph')
    _refuse_if_named(box, levels)
    around = level_of(box.place.graph)
    for node in within.nodes.values():
        if node.place.name in around.nodes and around.nodes[node.place.name] is not box:
            raise GraphError(
                f'"{path}" cannot be dissolved: {around.title} has a node "{node.place.name}" already; '
                "rename one of the two"
            )
    return within


def _refuse_if_named(box: Node, levels: Sequence[Level]) -> None:
    """Refuse if the subgraph itself has options, which would be lost."""
    path = box.place.path
    for name, value in box._options.said().items():
        if name != "group":  # which the nodes inside get
            raise GraphError(f'"{path}" cannot be dissolved: it says {name}={value!r}; take that out first')
    for level in levels:
        for gate in level.gates:
            if box in (gate.target, gate.by):
                raise GraphError(f'"{path}" cannot be dissolved: a gate names it; gate the nodes inside')
    for edge in level_of(box.place.graph).connections.at(box):
        for end in (edge.source, edge.target):
            if owner_of(end) is box and _relay(end, box) is None and not isinstance(end, ParameterPort):
                raise GraphError(
                    f'"{path}" cannot be dissolved: the edge {edge.label} belongs to the subgraph itself, '
                    "not to a node inside; remove it first"
                )


def _relay(end: End, box: Node) -> Port | None:
    """The port of the subgraph that an end is a side of, parameters apart that lead inside by promotion."""
    outer = end.outer if isinstance(end, InnerSource | InnerTarget) else end
    if not isinstance(outer, Port) or outer.node is not box:
        return None
    if outer.kind == "parameter":
        return outer
    return outer if outer.name in getattr(box._type, f"{outer.kind}s") else None


class _Border:
    """The border of a subgraph that is being dissolved, and the edges that meet at its ports."""

    def __init__(self, box: Node, around: Level, within: Level) -> None:
        self.box = box
        self.around = around.connections.at(box)
        self.within = list(within.edges)
        self.promotions = within.promotions

    def is_at(self, edge: Edge) -> bool:
        """Return whether an edge begins or ends at a port of the subgraph."""
        return _relay(edge.source, self.box) is not None or _relay(edge.target, self.box) is not None

    def outwards(self) -> Iterator[tuple[Edge, EdgeOptions]]:
        """Yield the edges inside that go on outside, and the options that hold there."""
        outside = [(port, one.options) for one in self.around if (port := _relay(one.source, self.box)) is not None]
        for edge in self.within if outside else ():
            relay = _relay(edge.target, self.box)
            yield from ((edge, options) for port, options in outside if port is relay)

    def through(self, edge: Edge) -> list[Edge]:
        """Return the edges that one becomes when the border is gone; what begins there is met on the way."""
        begin, source = _relay(edge.source, self.box), edge.source
        if begin is not None:
            inner = self.promotions.of(begin.name) if begin.kind == "parameter" else ()
            if not inner:
                return []
            source = inner[0]  # of several that a parameter stands for the first sends
        found: list[Edge] = []
        stack: list[tuple[Edge, ...]] = [(edge,)]
        while stack:
            parts = stack.pop()
            target = parts[-1].target
            relay = _relay(target, self.box)
            if relay is None:
                found.append(self._joined(parts, source, target))
            elif relay.kind == "parameter":
                found += [self._joined(parts, source, port) for port in self.promotions.of(relay.name)]
            else:
                onward = self.around if isinstance(target, InnerTarget) else self.within
                stack += [
                    (*parts, one)
                    for one in reversed(onward)
                    if _relay(one.source, self.box) is relay and one.source is not target and one not in parts
                ]
        return found

    def _joined(self, parts: tuple[Edge, ...], source: SourceEnd, target: TargetEnd) -> Edge:
        """Return the one edge that several in a row are; the outermost says how its queue is (rule G1)."""
        if len(parts) == 1 and parts[0].source is source and parts[0].target is target:
            return parts[0]
        outside = next((one for one in parts if one not in self.within), parts[0]).options
        return Edge(source, target, joined([one.options for one in parts], outside))
