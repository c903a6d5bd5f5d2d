"""The places of the token game, as bits of whole numbers: where activity can be.

There is one bit for each node that an active edge touches: it is active. There are two for each active edge: one token
with +1 lies on it, or several. A node whose code sends more than once while other nodes work has a bit for the right of
A3, and so has an edge over which code sends -1. Depends on the flat graph.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence

from hfg.graph.flat import ROOT, FlatEdge, FlatGraph

__all__ = ["Places", "singles"]


class Places:
    """Where each place has its bits: of nodes, rights and -1 their numbers, of edges the bits themselves."""

    def __init__(
        self,
        flat: FlatGraph,
        nodes: Sequence[int],
        edges: Sequence[FlatEdge],
        rights: Iterable[int],
        away: Iterable[int],
    ) -> None:
        self._flat = flat
        self._edges = edges
        self._into: dict[int, list[int]] = {}
        for number, edge in enumerate(edges):
            self._into.setdefault(edge.target.node, []).append(number)
        place = itertools.count()
        self.node = {index: next(place) for index in nodes}
        of_edges = [(1 << next(place), 1 << next(place)) for _ in edges]
        self.one = [one for one, _ in of_edges]
        self.two = [two for _, two in of_edges]
        self.right = {index: next(place) for index in sorted(rights)}
        self.minus = {number: next(place) for number in sorted(away)}

    def own(self, end: int) -> int:
        """Return the bit of A(v) as a mask; none for a subgraph."""
        return 1 << self.node[end] if end in self.node else 0

    def added(self, state: int, number: int) -> int:
        """Return the state with one more +1 on an edge."""
        one = self.one[number]
        return state | self.two[number] if state & one else state | one

    def taken(self, state: int, number: int) -> tuple[int, ...]:
        """Return the possible states with one +1 less on an edge; "several" may still be several."""
        two = self.two[number]
        return (state & ~two, state) if state & two else (state & ~self.one[number],)

    def mask_of(self, end: int) -> int:
        """The bits of a node, or of a subgraph with the tokens inside (rule G2)."""
        inside = set(self._flat.members(end))
        mask = sum(1 << self.node[one] for one in inside if one in self.node)
        if end < ROOT:
            for number, edge in enumerate(self._edges):
                if edge.source.node in inside and edge.target.node in inside:
                    mask |= self.one[number] | self.two[number]
        return mask

    def counting(self, nodes: Iterable[int]) -> int:
        """The bits that say that some nodes are active, or that activity is in transit to them."""
        mask = 0
        for index in nodes:
            if index in self.node:
                mask |= 1 << self.node[index]
            for number in self._into.get(index, ()):
                mask |= self.one[number] | self.two[number]
        return mask

    def around(self, nodes: frozenset[int]) -> int:
        """The bits of all places that activity of some nodes may be in."""
        mask = self.counting(nodes)
        for number, edge in enumerate(self._edges):
            sources = self._flat.members(edge.source.node) if edge.source.node != ROOT else ()
            if not nodes.isdisjoint(sources):
                mask |= self.one[number] | self.two[number]  # also those that lead out of the graph
        return mask

    # --- reading states

    def active_in(self, state: int) -> list[str]:
        """The paths of the active nodes."""
        return [self._flat.nodes[index].path for index, bit in self.node.items() if state >> bit & 1]

    def under_way_in(self, state: int) -> list[str]:
        """The edges on which activity lies."""
        return [
            f"{edge.label} (twice or more)" if state & self.two[number] else edge.label
            for number, edge in enumerate(self._edges)
            if state & self.one[number]
        ]


def singles(mask: int) -> Iterator[int]:
    """Yield each bit of a mask as a number of its own, the lowest first."""
    while mask:
        low = mask & -mask
        yield low
        mask ^= low
