"""Deadlines of ways through a graph: what nodes, edges and groups declare, and what follows for the nodes before.

All count from the stamp that the source gave (rule T5). Depends on `flat_graph`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from hfg.graph.flat.flat_graph import FlatEdge, FlatGraph, FlatNode

Deadline = tuple[float, str]
"""Seconds, and who declares them: "" for the node itself, the label of an edge, or 'group "loop"'."""


def declared_deadlines(flat: FlatGraph, node: FlatNode, edges: Iterable[FlatEdge], *, ends: bool) -> Iterator[Deadline]:
    """Yield what is declared for what comes to a node over these edges.

    Args:
      flat: the graph.
      node: the node.
      edges: those into the node that count.
      ends: no way leads on from the node.
    """
    found = [(edge.options.deadline_s, edge.label) for edge in edges]
    found.append((node.options.deadline_s, ""))
    if ends and not any(seconds for seconds, _ in found):
        names = dict.fromkeys((node.options.group or "loop", "loop"))
        found = [(spec.deadline_s, f'group "{name}"') for name in names if (spec := flat.groups.get(name))]
    for seconds, by in found:
        if seconds is not None:
            yield seconds, by
            if by.startswith("group "):
                return


def deadlines(flat: FlatGraph) -> dict[int, Deadline]:
    """Return the earliest deadline that is declared for each node, by index."""
    into, senders = _edges(flat)
    found = {}
    for node in flat.nodes:
        declared = declared_deadlines(flat, node, into.get(node.index, ()), ends=node.index not in senders)
        if (earliest := min(declared, default=None)) is not None:
            found[node.index] = earliest
    return found


def urgencies(flat: FlatGraph) -> dict[int, float]:
    """Return by which time after its source each node should be done, by index, where that is limited.

    A node for which nothing is declared must be done before those that it leads to: it has the earliest of their
    deadlines (Chetto, Silly and Bouchentouf 1990, without the work that is still to come).
    """
    into, _ = _edges(flat)
    found = {index: seconds for index, (seconds, _) in deadlines(flat).items()}
    for index in sorted(found, key=found.__getitem__):  # so the first that comes to a node is the earliest
        waiting = [index]
        while waiting:
            for edge in into.get(waiting.pop(), ()):
                before = edge.source.node
                if before >= 0 and before not in found:
                    found[before] = found[index]
                    waiting.append(before)
    return found


def _edges(flat: FlatGraph) -> tuple[dict[int, list[FlatEdge]], set[int]]:
    """Return the edges into each node, and the nodes from which a way leads on."""
    into: dict[int, list[FlatEdge]] = {}
    senders = set()
    for edge in flat.edges:
        if edge.target.node >= 0:
            into.setdefault(edge.target.node, []).append(edge)
            senders.add(edge.source.node)
    return into, senders
