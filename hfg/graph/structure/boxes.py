"""Which nodes hold a graph, for modules that must know before `Subgraph` is defined. Stands on ports."""

from __future__ import annotations

from typing import Any, Protocol, TypeGuard

from hfg.graph.structure.options import NodeOptions
from hfg.nodetype import NodeType
from hfg.ports import Relaying

__all__ = ["Box", "is_box", "iterated"]


class Box(Protocol):
    """A subgraph that is in a graph; before it is built, `_graph` is not there."""

    _graph: Any
    _options: NodeOptions | None
    _place: Any
    _type: NodeType


def is_box(node: object) -> TypeGuard[Box]:
    """Say whether a node is a subgraph."""
    return isinstance(node, Relaying)


def iterated(node: object) -> tuple[str, ...]:
    """Give the names of the inputs that a subgraph iterates over (rule G4); none for other nodes."""
    if not is_box(node) or node._options is None:
        return ()
    return node._options.iterate_over
