"""Where somebody looks at a run: at a node, a port or an edge, and how that is found again when the graph was edited.

A node and its ports are the same whatever they are called; an edge is known by the ports at its ends. Stands on
`relays`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec

from hfg.engine.runtime import relays
from hfg.errors import GraphError
from hfg.graph.flat import FlatGraph
from hfg.graph.structure.edge import Edge as DrawnEdge
from hfg.graph.structure.level import level_of
from hfg.graph.structure.naming import suggest
from hfg.nodetype import Node
from hfg.ports import Port

__all__ = ["Ends", "behind", "is_gone", "labels_at", "place_of"]


class Ends(msgspec.Struct, frozen=True):
    """An edge of a run from end to end."""

    source: Any
    target: Any


def place_of(flat: FlatGraph, what: Any) -> Any:
    """Give what is meant by a node, a port, an edge or a path of one of them.

    Raises:
      GraphError: the path leads nowhere.
    """
    if isinstance(what, DrawnEdge):
        wholes = [edge for one in flat.walk() for edge in one.edges if what in edge.segments]
        return Ends(wholes[0].source.port, wholes[0].target.port) if len(wholes) == 1 else what
    if not isinstance(what, str):
        return what
    if " -> " not in what:
        return flat.graph[what]
    labels = {edge.label: edge for one in flat.walk() for edge in one.edges}
    if what not in labels:
        raise GraphError(f'there is no edge "{what}" in this run; {suggest(what, labels)}')
    return Ends(labels[what].source.port, labels[what].target.port)


def labels_at(flat: FlatGraph, place: Any) -> list[str]:
    """The edges of the run that a place is about."""
    if isinstance(place, Ends):
        return [
            edge.label
            for one in flat.walk()
            for edge in one.edges
            if edge.source.port is place.source and edge.target.port is place.target
        ]
    return [label for one in flat.walk() for label in relays.labels_of(one, place)]


def behind(place: Any, swapped: Mapping[Any, Any]) -> Any:
    """The same place when some nodes were replaced by others."""
    if isinstance(place, Ends):
        return Ends(behind(place.source, swapped), behind(place.target, swapped))
    if isinstance(place, Node):
        while place in swapped:
            place = swapped[place]
    elif isinstance(place, Port) and place.node in swapped:
        node = behind(place.node, swapped)
        return getattr(node.ports, f"{place.kind}s").get(place.name, place)
    return place


def is_gone(place: Any) -> bool:
    """Whether the node of a place was removed from the graph, alone or with a subgraph around it."""
    if isinstance(place, Ends):
        return is_gone(place.source) or is_gone(place.target)
    node: Any = place.node if isinstance(place, Port) else place
    while isinstance(node, Node) and node._place is not None:
        node = level_of(node._place.graph).owner
    return isinstance(node, Node)
