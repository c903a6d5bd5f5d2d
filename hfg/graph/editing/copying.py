"""Copies of nodes; of a subgraph as it is now, not as its `build` would make it. Stands on `structure`."""

from __future__ import annotations

from typing import Any

from hfg.graph.graph import Graph
from hfg.graph.structure.boxes import is_box
from hfg.graph.structure.edges import Edge, is_single
from hfg.graph.structure.gates import Gate
from hfg.nodetype import Node
from hfg.ports import InnerSource, InnerTarget

__all__ = ["copy_of"]


def copy_of(node: Any, around: Graph) -> tuple[Any, Graph | None]:
    """Give a node of the same type and parameters that is in no graph, and for a subgraph a copy of its inside."""
    copies: dict[Any, Any] = {}
    first = _copy(node, copies)
    first._options = node._options
    waiting = [(node, first, around)]
    insides: list[tuple[Graph, Graph]] = []
    while waiting:  # without recursion, for subgraphs may be as deep as they like
        old, new, outer = waiting.pop()
        if not is_box(old):
            continue
        inside = Graph._inside(new, outer)
        new._graph = inside
        insides.append((old._graph, inside))
        for name, inner in old._graph.nodes.items():
            copy = _copy(inner, copies)
            copy._options = inner._options
            inside.nodes[name] = copy
            waiting.append((inner, copy, inside))
    for old_graph, new_graph in insides:
        _draw(old_graph, new_graph, copies)
    first._options = None
    copied: Graph | None = getattr(first, "_graph", None)
    if copied is not None:
        del first._graph  # whoever adds it gives it back
    return first, copied


def _copy(node: Node, copies: dict[Any, Any]) -> Any:
    copy = copies[node] = node._copy()
    return copy


def _draw(old: Graph, new: Graph, copies: dict[Any, Any]) -> None:
    """Draw the same edges, gates and promotions between the copies."""
    for edge in old.edges:
        drawn = Edge(_end(edge.source, copies), _end(edge.target, copies), edge.options)
        new.edges.append(drawn)
        if is_single(drawn.target):
            new._into[drawn.target] = drawn
        else:
            new._pairs.add((drawn.source, drawn.target))
    for gate in old.gates:
        target, by = copies.get(gate.target, gate.target), copies.get(gate.by, gate.by)
        if gate.target in copies:
            new.gates.append(Gate(target, by, gate.idle_rate_hz))
            new._root._gated.add(target)
    new._promoted = {name: [_end(port, copies) for port in ports] for name, ports in old._promoted.items()}


def _end(end: Any, copies: dict[Any, Any]) -> Any:
    if isinstance(end, InnerSource | InnerTarget):
        outer = end.outer
        return getattr(copies[outer.node].ports, f"{outer.kind}s")[outer.name].inner
    node = getattr(end, "node", None)
    if node not in copies:
        return end  # the whole graph's own ports, or an observable
    return getattr(copies[node].ports, f"{end.kind}s")[end.name]
