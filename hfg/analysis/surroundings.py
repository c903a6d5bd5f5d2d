"""What the structure of a graph says of its nodes and edges: which may end, not be live, or wait for something.

Depends on the flat graph.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

from hfg.graph.flat import ROOT, FlatEdge, FlatGraph
from hfg.nodetypes.description import NodeType

__all__ = ["ending", "first_calls", "fragile", "gates_by_node"]


def ending(flat: FlatGraph) -> set[int]:
    """Return the nodes that may end while the graph still works: sources, what feeds bring, and what follows them."""
    found: set[int] = set()
    waiting = [node.index for node in flat.nodes if node.node._type.is_source or node.iteration is not None]
    after: dict[int, list[int]] = {}
    for edge in flat.edges:
        if not edge.is_event_edge and edge.target.kind in ("input", "parameter") and edge.target.node > ROOT:
            after.setdefault(edge.source.node, []).append(edge.target.node)
    waiting += after.get(ROOT, [])
    waiting += [node.index for node in flat.nodes if _ends_itself(node.node._type)]
    while waiting:
        index = waiting.pop()
        if index not in found:
            found.add(index)
            waiting += after.get(index, [])
    return found


@functools.lru_cache(maxsize=4096)
def _ends_itself(kind: NodeType) -> bool:
    """Whether its code may raise `EndOfStream` (rule F2)."""
    origin = kind.origin
    functions = [getattr(origin, "function", None)]
    if isinstance(origin, type):
        functions = [getattr(value, "handler", value) for owner in origin.__mro__ for value in vars(owner).values()]
    codes = [getattr(function, "__code__", None) for function in functions]
    return any("EndOfStream" in code.co_names for code in codes if code is not None)


def fragile(flat: FlatGraph, edges: Sequence[FlatEdge]) -> set[int]:
    """Return the numbers of edges that may not be live at times, or whose tokens may be discarded (rules A8, F10)."""
    shut: set[int] = set()
    for edge in flat.edges:
        if edge.target.kind == "slot" and edge.target.name == "disable" and edge.target.node != ROOT:
            shut.update(flat.members(edge.target.node))
    shut |= {node.index for node in flat.nodes if node.options.on_error == "disable"}
    shut |= {node.index for node in flat.nodes if not node.options.enabled}
    shut |= {one for scope in flat.scopes if not scope.options.enabled for one in scope.members}
    return {
        number
        for number, edge in enumerate(edges)
        if edge.target.node in shut or (edge.source.node in shut and edge.source.kind != "event")
    }


def first_calls(flat: FlatGraph, edges: Sequence[FlatEdge], start: Sequence[int]) -> dict[int, tuple[int, ...]]:
    """Return for each node the edges from `start` into its slots: nothing calls it before (rules A10, F9).

    Only the hook `setup` may send earlier.
    """
    if any("setup" in node.node._type.hooks for node in flat.nodes):
        return {}
    found: dict[int, tuple[int, ...]] = {}
    for number in start:
        target = edges[number].target
        if target.kind == "slot":
            found[target.node] = (*found.get(target.node, ()), number)
    return found


def gates_by_node(flat: FlatGraph) -> dict[int, tuple[int, ...]]:
    """Return for each node what has to be active for it to work (rule A11); one that may work at a rate is left out."""
    found: dict[int, tuple[int, ...]] = {}
    for gate in flat.gates:
        if gate.idle_rate_hz is None:
            for member in flat.members(gate.target):
                found[member] = (*found.get(member, ()), gate.by)
    return found
