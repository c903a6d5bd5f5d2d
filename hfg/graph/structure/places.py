"""Where nodes and edges are in a whole graph, and where they come in its order: depth first, as they were added."""

from __future__ import annotations

from hfg.graph.structure.edge import Edge
from hfg.graph.structure.level import HasLevel, Level, inside, level_of
from hfg.graph.structure.options import NodeOptions, in_group
from hfg.graph.structure.subgraph import iterated
from hfg.nodetypes.node import Node


def node_place(node: Node) -> tuple[float, ...]:
    """Return the place of a node or subgraph in depth-first order of adding, for comparisons."""
    place: list[float] = []
    one: Node | None = node
    while one is not None:
        level = level_of(one.place.graph)
        place.append(level.members.order.label(one))
        one = level.owner
    return tuple(reversed(place))


def edge_place(level: Level, edge: Edge) -> tuple[tuple[float, ...], float]:
    """Return the place in the order of the plan of the edges that begin with a declared one, for comparisons."""
    around = () if level.owner is None else node_place(level.owner)
    return around, level.connections.order.label(edge)


def home_of(edge: Edge, graph: HasLevel) -> Level:
    """Return the level at which an edge is declared: ports of the whole graph can be named anywhere."""
    for end in (edge.target, edge.source):
        level: Level | None = getattr(getattr(end, "graph", None), "_level", None)
        if level is not None and edge in level.connections.order:
            return level
    return level_of(graph)


def side_of(level: Level) -> Level:
    """Return the inside of the nearest subgraph that iterates around a level, or the whole graph.

    Gates, signals and activity do not cross the boundary of a subgraph that iterates (rule G4).
    """
    while level.owner is not None and not iterated(level.owner):
        around = level.around
        if around is None:
            break
        level = around
    return level


def is_in(node: Node, graph: HasLevel) -> bool:
    """Return whether a node is in a whole graph now, perhaps inside subgraphs."""
    return node._place is not None and is_attached(level_of(node._place.graph), graph)


def is_attached(level: Level, graph: HasLevel) -> bool:
    """Return whether a level is part of a whole graph now."""
    root, one = level_of(graph), level
    while one is not root:
        around = one.around
        if one.owner is None or inside(one.owner) is not one or around is None:
            return False
        one = around
    return True


def effective_options(node: Node) -> NodeOptions:
    """Return the options of a node, with the group in which it really runs."""
    own: NodeOptions = node._options
    group, level = own.group, level_of(node.place.graph)
    while group is None and level.owner is not None:
        group = level.owner._options.group
        level = level_of(level.owner.place.graph)
    return own if own.group is not None else in_group(own, group or "loop")
