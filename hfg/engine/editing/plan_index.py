"""Finds the parts of a plan that an edit touches, without a search (rule R4).

It is made when a run is first edited. That one edit costs more in a larger graph; every edit then updates the index.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

from hfg.engine.model import Core, RunningNode
from hfg.graph.structure.sequence import Sequence
from hfg.ports.edges import EventEdge

__all__ = ["PlanIndex", "TopologicalOrder"]

_JOINED = ("input", "parameter")


class PlanIndex:
    """Where nodes and edges are in the plan of one run.

    Attributes:
      by_node: the worker of each node, and of each subgraph that is dissolved.
      leaves: the workers of nodes in the order of the plan; the first part of `core.workers`.
      scopes: the workers of subgraphs in that order; the next part.
      edges: the edges between nodes; the first part of `core.edges`.
      passing: the running edges that each declared edge is part of.
      labels: each edge by its label.
      order: an order of the nodes along synchronous edges.
    """

    def __init__(self, core: Core) -> None:
        self.by_node: dict[Any, RunningNode] = {
            worker.node: worker for worker in core.workers if worker.node is not None
        }
        self.leaves = Sequence(worker for worker in core.workers if worker.node is not None and worker.scope is None)
        self.scopes = Sequence(scope.worker for scope in core.scopes if scope.worker is not None)
        self.edges: Sequence[Any] = Sequence(edge for edge in core.edges if edge.segments)
        self.passing: dict[Any, list[Any]] = {}
        self.labels: dict[str, Any] = {}
        for edge in self.edges.items:
            self.note(edge)
            self.labels[edge.label] = edge
            edge.renumber(self.edges.label(edge))
        self.order = TopologicalOrder(self)

    def note(self, edge: Any) -> None:
        """Add an edge under its segments."""
        for segment in edge.segments:
            self.passing.setdefault(segment, []).append(edge)

    def forget(self, edge: Any) -> None:
        """Remove an edge from under its segments."""
        for segment in edge.segments:
            passing = self.passing[segment]
            passing.remove(edge)
            if not passing:
                del self.passing[segment]

    def block(self, begin: Any) -> list[Any]:
        """Return the running edges that begin with a declared one, in order."""
        return [edge for edge in self.passing.get(begin, ()) if edge.segments[0] is begin]


class TopologicalOrder:
    """Keeps nodes in an order along synchronous edges without a delay, so that an edge that closes a cycle shows (P7).

    A new edge against the order moves only nodes between its ends: those after its target or those before its source,
    whichever are fewer (the two-way search of Alpern and others, 1990).
    """

    def __init__(self, index: PlanIndex) -> None:
        self._index = index
        self._nodes: Sequence[Any] | None = None  # made at the first question
        self._come: dict[Any, list[Any]] = {}  # of the current edit: the nodes that wait for a node, and
        self._waits: dict[Any, list[Any]] = {}  # the nodes that a node waits for
        self._lost: set[Any] = set()

    def closes_a_ring(self, new: Iterable[tuple[Any, Any]], lost: Iterable[Any]) -> bool:
        """Add new edges, as pairs of nodes, while others go; return whether they close a cycle."""
        pairs = list(new)
        if not pairs:
            return False
        nodes = self._all()
        self._come, self._waits, self._lost = {}, {}, set(lost)
        try:
            for source, target in pairs:
                for node in (source, target):
                    if node not in nodes:
                        nodes.insert(len(nodes.items), node)
                if not self._take_in(nodes, source, target):
                    self._nodes = None
                    return True
                self._come.setdefault(source, []).append(target)
                self._waits.setdefault(target, []).append(source)
        finally:
            self._come, self._waits, self._lost = {}, {}, set()
        return False

    def forget(self, node: Any) -> None:
        """Remove a node."""
        if self._nodes is not None and node in self._nodes:
            self._nodes.remove(node)

    def swap(self, old: Any, new: Any) -> None:
        """Put a node in the place of another."""
        if self._nodes is not None and old in self._nodes:
            self.forget(new)
            self._nodes.replace(old, new)

    def _take_in(self, nodes: Sequence[Any], source: Any, target: Any) -> bool:
        """Let a node come before another; return whether that is possible."""
        if source is target:
            return False
        last, first = nodes.label(source), nodes.label(target)
        if last < first:
            return True
        behind = _Search(target, self._behind, lambda node: nodes.label(node) <= last)
        before = _Search(source, self._before, lambda node: nodes.label(node) >= first)
        while behind.goes_on() and before.goes_on():
            if behind.step(source) or before.step(target):
                return False
        if not behind.waiting:
            self._move(nodes, behind.found, source, 1)
        else:
            self._move(nodes, before.found, target, 0)
        return True

    def _move(self, nodes: Sequence[Any], moved: set[Any], beside: Any, offset: int) -> None:
        """Put nodes directly after or before another, in their present order."""
        in_order = sorted(moved, key=nodes.label)
        for node in in_order:
            nodes.remove(node)
        position = nodes.position(beside) + offset
        for number, node in enumerate(in_order):
            nodes.insert(position + number, node)

    def _behind(self, node: Any) -> list[Any]:
        worker = self._index.by_node.get(node)
        found = [] if worker is None else [edge for edges in worker.wired_out for edge in edges]
        return [edge.target.node for edge in self._joining(found)] + self._come.get(node, [])

    def _before(self, node: Any) -> list[Any]:
        worker = self._index.by_node.get(node)
        return [edge.source.node for edge in self._joining(worker.in_edges if worker else ())] + self._waits.get(
            node, []
        )

    def _joining(self, edges: Iterable[Any]) -> list[Any]:
        return [
            edge
            for edge in edges
            if type(edge) is not EventEdge
            and not getattr(edge, "initial", ())
            and edge.target_kind in _JOINED
            and edge not in self._lost
            and edge.source.node is not None
            and edge.target.node is not None
        ]

    def _all(self) -> Sequence[Any]:
        if self._nodes is None:
            self._nodes = Sequence(self._sorted())
        return self._nodes

    def _sorted(self) -> list[Any]:
        """Return all nodes, each after those whose outputs it takes (Kahn, 1962)."""
        left = {worker.node: len(self._before(worker.node)) for worker in self._index.leaves.items}
        ready = deque(node for node, count in left.items() if not count)
        found: list[Any] = []
        while ready:
            node = ready.popleft()
            found.append(node)
            for onward in self._behind(node):
                left[onward] -= 1
                if not left[onward]:
                    ready.append(onward)
        return found


class _Search:
    """Visits nodes along edges, within a limit."""

    def __init__(self, begin: Any, onward: Callable[[Any], list[Any]], may: Callable[[Any], bool]) -> None:
        self.found = {begin}
        self.waiting = [begin]
        self._onward = onward
        self._may = may

    def goes_on(self) -> bool:
        """Return whether there is more to visit."""
        return bool(self.waiting)

    def step(self, wanted: Any) -> bool:
        """Visit one node; return whether an edge leads from it to the wanted one."""
        for node in self._onward(self.waiting.pop()):
            if node is wanted:
                return True
            if node not in self.found and self._may(node):
                self.found.add(node)
                self.waiting.append(node)
        return False
