"""Finds what a page calls by a path: a node, a port, or an edge as it is drawn. Depends on the graph."""

from __future__ import annotations

from typing import Any, Final

from hfg.errors import GraphError
from hfg.graph import Graph
from hfg.graph.structure.level import level_of

__all__ = ["place_at"]

_ARROW: Final = " -> "


def place_at(graph: Graph, path: str) -> Any:
    """Return the node, port or drawn edge at a path; a run names only whole edges, across all borders.

    Raises:
      GraphError: there is none.
    """
    if _ARROW not in path:
        return graph[path]
    for level in level_of(graph).walk():
        for edge in level.edges:
            if edge.label == path:
                return edge
    try:
        return graph[path]  # the name of a node may have an arrow in it
    except GraphError:
        raise GraphError(f'there is no edge "{path}"') from None
