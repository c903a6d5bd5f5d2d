"""Finds the parts of a plan that an edit touches, without a search (rule R4).

It is made when a run is first edited. That one edit costs more in a larger graph; every edit then updates the index.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable

from hfg.engine.model import Core, RunningNode
from hfg.graph.structure.edge import Edge
from hfg.graph.structure.sequence import Sequence
from hfg.nodetypes.node import Node
from hfg.ports.edges import AnyEdge, EventEdge

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
        self.by_node: dict[Node, RunningNode] = {
            worker.node: worker for worker in core.workers if worker.node is not None
        }
        self.leaves = Sequence(worker for worker in core.workers if worker.node is not None and worker.scope is None)
        self.scopes = Sequence(scope.worker for scope in core.scopes if scope.worker is not None)
        self.edges: Sequence[AnyEdge] = Sequence(edge for edge in core.edges if edge.segments)
        self.passing: dict[Edge, list[AnyEdge]] = {}
        self.labels: dict[str, AnyEdge] = {}
        for edge in self.edges.items:
            self.note(edge)
            self.labels[edge.label] = edge
            edge.renumber(self.edges.label(edge))
        self.order = TopologicalOrder(self)

    def note(self, edge: AnyEdge) -> None:
        """Add an edge under its segments."""
        for segment in edge.segments:
            self.passing.setdefault(segment, []).append(edge)

    def forget(self, edge: AnyEdge) -> None:
        """Remove an edge from under its segments."""
        for segment in edge.segments:
            passing = self.passing[segment]
            passing.remove(edge)
            if not passing:
                del self.passing[segment]

    def block(self, begin: Edge) -> list[AnyEdge]:
        """Return the running edges that begin with a declared one, in order."""
        return [edge for edge in self.passing.get(begin, ()) if edge.segments[0] is begin]


class TopologicalOrder:
    """Keeps nodes in an order along synchronous edges without a delay, so that an edge that closes a cycle shows (P7).

    A new edge against the order moves only nodes between its ends: those after its target or those before its source,
    whichever are fewer (the two-way search of Alpern and others, 1990).
    """

    def __init__(self, index: PlanIndex) -> None:
        self._index = index
        self._nodes: Sequence[Node] | None = None  # made at the first question
        self._come: dict[Node, list[Node]] = {}  # of the current edit: the nodes that wait for a node, and
        self._waits: dict[Node, list[Node]] = {}  # the nodes that a node waits for
        self._lost: set[AnyEdge] = set()

    def closes_a_ring(self, new: Iterable[tuple[Node, Node]], lost: Iterable[AnyEdge]) -> bool:
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

    def forget(self, node: Node) -> None:
        """Remove a node."""
        if self._nodes is not None and node in self._nodes:
            self._nodes.remove(node)

    def swap(self, old: Node, new: Node) -> None:
        """Put a node in the place of another."""
        if self._nodes is not None and old in self._nodes:
            self.forget(new)
            self._nodes.replace(old, new)

    def _take_in(self, nodes: Sequence[Node], source: Node, target: Node) -> bool:
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

    def _move(self, nodes: Sequence[Node], moved: set[Node], beside: Node, offset: int) -> None:
        """Put nodes directly after or before another, in their present order."""
        in_order = sorted(moved, key=nodes.label)
        for node in in_order:
            nodes.remove(node)
        position = nodes.position(beside) + offset
        for number, node in enumerate(in_order):
            nodes.insert(position + number, node)

    def _behind(self, node: Node) -> list[Node]:
        worker = self._index.by_node.get(node)
        found = [] if worker is None else [edge for edges in worker.wired_out for edge in edges]
        return [edge.target.node for edge in self._joining(found)] + self._come.get(node, [])

    def _before(self, node: Node) -> list[Node]:
        worker = self._index.by_node.get(node)
        return [edge.source.node for edge in self._joining(worker.in_edges if worker else ())] + self._waits.get(
            node, []
        )

    def _joining(self, edges: Iterable[AnyEdge]) -> list[AnyEdge]:
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

    def _all(self) -> Sequence[Node]:
        if self._nodes is None:
            self._nodes = Sequence(self._sorted())
        return self._nodes

    def _sorted(self) -> list[Node]:
        """Return all nodes, each after those whose outputs it takes (Kahn, 1962)."""
        left = {worker.node: len(self._before(worker.node)) for worker in self._index.leaves.items}
        ready = deque(node for node, count in left.items() if not count)
        found: list[Node] = []
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

    def __init__(self, begin: Node, onward: Callable[[Node], list[Node]], may: Callable[[Node], bool]) -> None:
        self.found = {begin}
        self.waiting = [begin]
        self._onward = onward
        self._may = may

    def goes_on(self) -> bool:
        """Return whether there is more to visit."""
        return bool(self.waiting)

    def step(self, wanted: Node) -> bool:
        """Visit one node; return whether an edge leads from it to the wanted one."""
        for node in self._onward(self.waiting.pop()):
            if node is wanted:
                return True
            if node not in self.found and self._may(node):
                self.found.add(node)
                self.waiting.append(node)
        return False
