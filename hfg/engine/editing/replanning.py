"""What an edit does to the plan of a run: which workers and edges go, come, stay (rules R4, G1).

What stays is told by identity: a node by its object, an edge by the ports at its ends, so that grouping nodes into a
subgraph moves no token. A change of single edges between plain nodes is found without looking at the rest. Decides
only; `reforming` does it. Stands on `plan`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec

from hfg.engine.editing.rerouting import reroute
from hfg.engine.model.core import Core
from hfg.engine.model.worker import Worker
from hfg.errors import UsageError
from hfg.graph.editing.changes import (
    Change,
    EdgeChange,
    NodeChange,
    NodeSwap,
    OptionsChange,
    ParameterChange,
    Renaming,
)
from hfg.graph.flat import End, FlatEdge, FlatGraph, FlatNode, flatten
from hfg.graph.structure.level import Level, level_of
from hfg.graph.structure.naming import path_of
from hfg.graph.structure.subgraph import iterated

__all__ = ["Replan", "closes_a_ring", "replan"]


_JOINED = ("input", "parameter")


class Replan(msgspec.Struct, eq=False):
    """What is to be done to a plan.

    Attributes:
      flat: the flat graph as it will be; only of a `whole` replan, else the present one with its edges exchanged.
      whole: everything was looked at.
      edges: running edges that stay, each with what is said about it from now on.
      lost: running edges that go.
      new: edges that come.
      nodes: workers that stay, each with what is said about it from now on; only of a whole replan.
      gone: workers that go.
      come: nodes that come.
      swapped: workers that get another node.
      touched: workers that must not fire while it is done.
      spots: of a replan that is not whole: where in the order each new edge comes.
    """

    flat: FlatGraph
    whole: bool
    edges: list[tuple[Any, FlatEdge]] = []
    lost: list[Any] = []
    new: list[FlatEdge] = []
    nodes: list[tuple[Worker, FlatNode]] = []
    gone: list[Worker] = []
    come: list[FlatNode] = []
    swapped: list[tuple[Worker, Any]] = []
    touched: list[Worker] = []
    spots: list[int] = []


def replan(core: Core, flat: FlatGraph, changes: Sequence[Change]) -> Replan:
    """Find out what changes of the drawn graph mean to the plan of its run.

    Args:
      core: the run; nothing of it is changed.
      flat: the flat graph it was planned from.
      changes: have been made to the drawn graph.

    Raises:
      UsageError: a change is one that no run can follow: inside a subgraph that iterates.
    """
    for change in changes:
        _refuse_iterating(change)
    few = reroute(core, flat, changes)
    if few is None:
        found = _whole(core, flat, changes)
    else:
        found = Replan(flat, whole=False, edges=few.edges, lost=few.lost, new=few.new, spots=few.spots)
    for edge, said in found.edges:
        if edge.active != said.active:
            found.touched += [edge.source, edge.target]
    touched = dict.fromkeys(found.touched)
    for edge in found.lost:
        touched |= dict.fromkeys((edge.source, edge.target))
    by_node = {worker.node: worker for worker in core.workers} if found.new or changes else {}
    for new in found.new:
        for end in (new.source, new.target):
            worker = by_node.get(getattr(end.port, "node", None))
            if worker is not None:
                touched[worker] = None
    for change in changes:
        if isinstance(change, OptionsChange | ParameterChange) and change.node in by_node:
            touched[by_node[change.node]] = None
    touched |= dict.fromkeys((*found.gone, *(worker for worker, _ in found.swapped)))
    found.touched = [worker for worker in touched if worker.node is not None and worker.scope is None]
    return found


# --- the whole ---


def _whole(core: Core, flat: FlatGraph, changes: Sequence[Change]) -> Replan:
    """Plan afresh and compare."""
    after = flatten(flat.graph)
    found = Replan(after, whole=True)
    by_node = {worker.node: worker for worker in core.workers if worker.node is not None}
    swapped: dict[Worker, Any] = {}
    for change in changes:
        if isinstance(change, NodeSwap) and change.old in by_node:
            worker = by_node.pop(change.old)
            by_node[change.new] = worker
            swapped[worker] = change.new
    stays = {scope.subgraph for scope in after.scopes}
    for node in after.nodes:
        worker_found = by_node.get(node.node)
        if worker_found is None:
            found.come.append(node)
            if node.iteration is not None:
                raise _cannot_iterate(node.path)
        else:
            stays.add(node.node)
            found.nodes.append((worker_found, node))
    found.swapped = [(worker, node) for worker, node in swapped.items() if node in stays and worker.node is not node]
    found.gone = [worker for node, worker in by_node.items() if node not in stays]
    for worker in found.gone:
        if worker.iteration is not None:
            raise _cannot_iterate(worker.path)
    _compare_edges(core, flat, after, changes, by_node, found)
    for worker, node in found.nodes:
        if worker.path != node.path or worker.options.group != node.options.group:
            found.touched.append(worker)
    return found


def _compare_edges(
    core: Core,
    before: FlatGraph,
    after: FlatGraph,
    changes: Sequence[Change],
    by_node: dict[Any, Worker],
    found: Replan,
) -> None:
    """Edges with the same ends are the same, unless somebody rubbed them out for good."""
    rubbed_out = {
        change.edge for change in changes if isinstance(change, EdgeChange) and not change.added and change.for_good
    }
    present: dict[Any, list[Any]] = {}
    for edge, old in zip(core.edges, before.edges, strict=False):
        if rubbed_out.isdisjoint(old.segments):
            present.setdefault(_ends_of(old, edge.source, edge.target), []).append(edge)
    kept = set()
    for new in after.edges:
        source, target = by_node.get(_node_of(new.source)), by_node.get(_node_of(new.target))
        same = present.get(_ends_of(new, source or _outside(new.source), target or _outside(new.target)))
        if same:
            edge = same.pop(0)
            kept.add(edge)
            found.edges.append((edge, new))
        else:
            found.new.append(new)
    found.lost = [edge for edge, _ in zip(core.edges, before.edges, strict=False) if edge not in kept]


def _node_of(end: End) -> Any:
    return getattr(end.port, "node", None)


def _outside(end: End) -> Any:
    return end.port if end.kind == "observable" else None


def _ends_of(flat: FlatEdge, source: Any, target: Any) -> tuple[Any, ...]:
    """What makes an edge the same: workers and names of ports; the graph's own ports and observables are themselves."""
    begin = source if getattr(source, "node", None) is not None else flat.source.port
    end = target if getattr(target, "node", None) is not None else flat.target.port
    roomy = bool(flat.initial or flat.buffer) and not flat.is_event_edge  # another kind of edge
    return (begin, flat.source.kind, flat.source.name, end, flat.target.kind, flat.target.name, roomy)


# --- refusals ---


def _refuse_iterating(change: Change) -> None:
    around: Level | None = getattr(change, "level", None)
    if around is None:
        place = getattr(getattr(change, "node", None) or getattr(change, "new", None), "_place", None)
        around = None if place is None else level_of(place.graph)
    if isinstance(change, ParameterChange):
        return
    while around is not None and around.owner is not None:
        if iterated(around.owner) and not isinstance(change, Renaming):
            raise _cannot_iterate(path_of(around.owner))
        around = around.around
    if isinstance(change, NodeChange) and change.options.iterate_over:
        raise _cannot_iterate(change.name)


def _cannot_iterate(path: str) -> UsageError:
    return UsageError(
        f'"{path}" iterates over collections, and what iterates is not added, removed or changed inside while the '
        "graph runs: stop the run, then graph.edit(...)"
    )


def closes_a_ring(core: Core, new: Sequence[FlatEdge]) -> bool:
    """Whether new synchronous edges make a ring without a delay (rule P7); looks only as far as they lead."""
    added: dict[Any, list[Any]] = {}
    for edge in new:
        if not edge.is_event_edge and not edge.initial and edge.target.kind in _JOINED:
            added.setdefault(edge.source.port.node, []).append(edge.target.port.node)
    by_node = {worker.node: worker for worker in core.workers} if added else {}
    for begin, targets in added.items():
        seen = set(targets)
        waiting = list(targets)
        while waiting:
            node = waiting.pop()
            if node is begin:
                return True
            onward = list(added.get(node, ()))
            worker = by_node.get(node)
            if worker is not None:
                for edges in worker.wired_out:
                    onward += [
                        edge.target.node
                        for edge in edges
                        if not getattr(edge, "initial", ()) and edge.target_kind in _JOINED
                    ]
            for one in onward:
                if one is not None and one not in seen:
                    seen.add(one)
                    waiting.append(one)
    return False
