"""The first stage of the token game: where activity may come at all, without order and without counting.

It is a fixed point over active edges, linear in the size of the graph, and contains all states of the game. Anything
that is not certain counts as possible. Depends on the flat graph and `moves`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from hfg.analysis.moves import Moves
from hfg.graph.flat import ROOT, FlatEdge, FlatGraph, scope_end

__all__ = ["Spread"]


class Spread:
    """The nodes and edges to which activity may come.

    Nodes and subgraphs are named as in `End.node`.

    Attributes:
      flat: the graph.
      moves: what each node may do.
      active: for each node, whether it may ever become active.
      reached: the numbers of the active edges on which activity may lie.

    Args:
      flat: the graph.
      moves: what each node may do.
      edges: the active edges.
      first: the numbers of those that bring activity from outside.
    """

    def __init__(self, flat: FlatGraph, moves: Moves, edges: Sequence[FlatEdge], first: Iterable[int]) -> None:
        self.flat = flat
        self.moves = moves
        self.active = [False] * len(flat.nodes)
        self.reached = set(first)
        self._from: dict[int, list[int]] = {}  # active edges by their source
        for number, edge in enumerate(edges):
            self._from.setdefault(edge.source.node, []).append(number)
        self._edges = edges
        self._waiting: list[int] = []
        self._begin()
        while self._waiting:
            index = self._waiting.pop()
            for end in (index, *(scope_end(scope) for scope in flat.nodes[index].scopes)):
                for number in self._from.get(end, ()):
                    if number not in self.reached and self._may_carry(edges[number]):
                        self._reach(number)

    def may_be_active(self, end: int) -> bool:
        """Return whether a node or subgraph may become active. A subgraph is active while a node inside is (G2)."""
        return any(self.active[member] for member in self.flat.members(end))

    def _may_carry(self, edge: FlatEdge) -> bool:
        """Whether a token with +1 may leave over an active edge of a node or subgraph (A3, A4)."""
        end, name = edge.source.node, edge.source.name
        if end < ROOT:
            return name in self.moves.ports_of(end) and self.may_be_active(end)
        doing = self.moves.of(self.flat.nodes[end])
        return name in doing.makes or (self.active[end] and name in doing.carries)

    def _begin(self) -> None:
        """Put activity where it does not come from a node that is active already."""
        for number in list(self.reached):
            self._reach(number)
        for node in self.flat.nodes:
            # Activity that it makes comes back where it is discarded (A8). Nothing is known of an iteration.
            if node.iteration is not None or (node.index in self._from and self.moves.of(node).makes):
                self._activate(node.index)
        for edge in self.flat.edges:
            if edge.target.kind == "slot" and edge.target.name == "activate" and edge.target.node > ROOT:
                self._activate(edge.target.node)

    def _activate(self, index: int) -> None:
        if not self.active[index]:
            self.active[index] = True
            self._waiting.append(index)

    def _reach(self, number: int) -> None:
        """Activity may lie on an edge: its target takes it, unless that is a subgraph's own slot, or takes nothing."""
        self.reached.add(number)
        target = self._edges[number].target
        if target.node <= ROOT or (target.kind == "slot" and target.name == "deactivate"):
            return
        if target.kind == "slot" or target.node not in self.moves.still:
            self._activate(target.node)
