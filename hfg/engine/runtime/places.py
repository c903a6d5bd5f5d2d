"""Places in a run that are observed: a node, a port or an edge; and how to find them again after an edit.

A node and its ports stay the same whatever they are called; an edge is identified by the ports at its ends.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from typing import TYPE_CHECKING, Any, Final

import msgspec

from hfg.engine.runtime import relays
from hfg.errors import GraphError
from hfg.graph.structure.edge import Edge as DrawnEdge
from hfg.graph.structure.level import level_of
from hfg.graph.structure.naming import suggest
from hfg.nodetypes.node import Node
from hfg.ports import Port
from hfg.ports.edges import AnyEdge

if TYPE_CHECKING:
    from hfg.engine.runtime.engine import Engine

__all__ = ["Ends", "behind", "edges_at", "is_gone", "is_near", "place_of"]

_ARROW: Final = " -> "


class Ends(msgspec.Struct, frozen=True):
    """An edge of a run from end to end."""

    source: Any
    target: Any


def place_of(engine: Engine, what: Any) -> Any:
    """Return the node, port or edge that is meant, by itself or by its path.

    Raises:
      GraphError: the path does not exist.
    """
    if isinstance(what, DrawnEdge):
        wholes = [edge for edge in _edges(engine) if what in edge.segments]
        return Ends(wholes[0].source_port, wholes[0].target_port) if len(wholes) == 1 else what
    if not isinstance(what, str):
        return what
    labels = {edge.label: edge for edge in _edges(engine)} if _ARROW in what else {}
    if what in labels:
        return Ends(labels[what].source_port, labels[what].target_port)
    try:
        return engine.graph[what]  # a node's name may have an arrow in it
    except GraphError:
        if _ARROW not in what:
            raise
        raise GraphError(f'there is no edge "{what}" in this run; {suggest(what, labels)}') from None


def edges_at(engine: Engine, place: Any) -> list[AnyEdge]:
    """Return the edges of the run, between nodes, at a place."""
    if isinstance(place, Ends):
        return [
            edge for edge in _edges(engine) if edge.source_port is place.source and edge.target_port is place.target
        ]
    return [edge for edge in _edges(engine) if relays.is_at(edge.segments, place)]


def _edges(engine: Engine) -> Iterator[AnyEdge]:
    return (edge for edge in engine.core.edges if edge.segments)


def is_near(place: Any, nodes: Set[Any]) -> bool:
    """Return whether a place is at one of some nodes and subgraphs."""
    if isinstance(place, Ends | DrawnEdge):
        return is_near(place.source, nodes) or is_near(place.target, nodes)
    return place in nodes or getattr(place, "node", None) in nodes


def behind(place: Any, swapped: Mapping[Any, Any]) -> Any:
    """Return the same place after some nodes were replaced by others."""
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
    """Return whether the node of a place was removed from the graph, by itself or with a subgraph around it."""
    if isinstance(place, Ends):
        return is_gone(place.source) or is_gone(place.target)
    node: Any = place.node if isinstance(place, Port) else place
    while isinstance(node, Node) and node._place is not None:
        node = level_of(node._place.graph).owner
    return isinstance(node, Node)
