"""Where nodes and edges come in the order of a whole graph: depth first, in order of adding and of connecting.

Stands on `level`.
"""

from __future__ import annotations

from hfg.graph.structure.edge import Edge
from hfg.graph.structure.level import HasLevel, Level, level_of
from hfg.graph.structure.subgraph import iterated
from hfg.nodetypes.node import Node

__all__ = ["edge_place", "home_of", "node_place", "side_of"]


def node_place(node: Node) -> tuple[float, ...]:
    """Give what tells where a node or subgraph comes in depth-first order of adding."""
    place: list[float] = []
    one: Node | None = node
    while one is not None:
        level = level_of(one.place.graph)
        place.append(level.members.order.label(one))
        one = level.owner
    return tuple(reversed(place))


def edge_place(level: Level, edge: Edge) -> tuple[tuple[float, ...], float]:
    """Give what tells where the edges that begin with a declared one come in the order of the plan."""
    around = () if level.owner is None else node_place(level.owner)
    return around, level.connections.order.label(edge)


def home_of(edge: Edge, graph: HasLevel) -> Level:
    """Give the level at which an edge is declared; ports of the whole may be named anywhere."""
    for end in (edge.target, edge.source):
        level: Level | None = getattr(getattr(end, "graph", None), "_level", None)
        if level is not None and edge in level.connections.order:
            return level
    return level_of(graph)


def side_of(level: Level) -> Level:
    """Give what a level is part of without a border: the inside of the nearest subgraph that iterates, or the whole.

    Neither gates nor signals nor activity cross the border of what iterates (rule G4).
    """
    while level.owner is not None and not iterated(level.owner):
        around = level.around
        if around is None:
            break
        level = around
    return level
