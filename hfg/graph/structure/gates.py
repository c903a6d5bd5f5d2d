"""Gates: work coupled to activity without touching the node (rule A11). Stands on nodes and naming."""

from __future__ import annotations

from typing import Any

import msgspec

from hfg.errors import GraphError
from hfg.graph.structure.naming import path_of
from hfg.nodetype import Node

__all__ = ["Gate", "refuse_gate"]


class Gate(msgspec.Struct, frozen=True, eq=False):
    """While `by` is inactive, `target` rests, or does `idle_rate_hz` firings a second."""

    target: Node
    by: Node
    idle_rate_hz: float | None = None


def refuse_gate(graph: Any, target: Any, by: Any, idle_rate_hz: Any) -> None:
    """Raise if the gate cannot be; changes nothing.

    Raises:
      GraphError: what is given is no node of this graph, or is gated already; or the rate is none.
    """
    for node in (target, by):
        if not isinstance(node, Node):
            raise GraphError(
                f"a gate couples nodes, got {node!r}; give the node itself, as in graph.gate(detector, by=fetch)"
            )
        if node._place is None or node._place.graph._root is not graph._root:
            raise GraphError(
                f'a gate couples nodes of one graph, but "{path_of(node)}" is not in {graph._title}; add it first'
            )
    name = path_of(target)
    if target in graph._root._gated:
        raise GraphError(f'"{name}" has a gate already; put what both gates mean into one state node or subgraph')
    is_number = isinstance(idle_rate_hz, int | float) and type(idle_rate_hz) is not bool
    if idle_rate_hz is not None and not (is_number and idle_rate_hz > 0):
        raise GraphError(
            f'the gate of "{name}": idle_rate_hz must be a number above 0, or None to rest, got {idle_rate_hz!r}'
        )
