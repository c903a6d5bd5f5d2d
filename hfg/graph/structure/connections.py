"""The edges of one level, in order, and which of them leads into each input (rule P2). Judges nothing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from hfg import errors
from hfg.graph.structure.edge import Edge, SourceEnd, TargetEnd, end_path, is_single
from hfg.graph.structure.sequence import Sequence


class Connections:
    """Edges with an index, so that connecting the ten-thousandth is as fast as the first.

    Attributes:
      edges: in order of connecting.
      into: the edge into each target that takes only one.
      pairs: the ends of all other edges, and how many have them: more than one during an edit that will be refused.
    """

    __slots__ = ("_at", "_order", "edges", "into", "pairs")

    def __init__(self) -> None:
        self.edges: list[Edge] = []
        self.into: dict[TargetEnd, Edge] = {}
        self.pairs: Counter[tuple[SourceEnd, TargetEnd]] = Counter()
        self._order: Sequence[Edge] | None = None  # from the first edit on, which is to cost what it touches
        self._at: dict[object, dict[Edge, None]] = {}  # by the nodes at their ends, once there is an order

    def refuse_second(self, source: SourceEnd, target: TargetEnd) -> None:
        """Refuse an edge that there is, and a second one into what takes one.

        Raises:
          ConnectionError: naming what is in the way.
        """
        if not is_single(target):
            if (source, target) in self.pairs:
                raise errors.ConnectionError(_again(source, target))
            return
        found = self.into.get(target)
        if found is None:
            return
        if found.source is source:
            raise errors.ConnectionError(_again(source, target))
        raise errors.ConnectionError(
            f'"{target.path}" takes one edge and has one from "{end_path(found.source)}", '
            f'so "{end_path(source)}" cannot lead there too; '
            "use a slot, or a node that joins the two (rule P2)"
        )

    def append(self, edge: Edge) -> None:
        """Add an edge after all others."""
        self.edges.append(edge)
        self._note(edge)
        if self._order is not None:
            self._place(len(self.edges) - 1, edge)

    def insert(self, position: int, edge: Edge) -> None:
        """Add an edge at its place in the order."""
        self.edges.insert(position, edge)
        self._note(edge)
        if self._order is not None:
            self._place(position, edge)

    def remove(self, position: int) -> None:
        """Take the edge at a position out."""
        edge = self.edges.pop(position)
        self._forget(edge)
        if self._order is not None:
            self._displace(edge)

    def swap(self, old: Edge, new: Edge) -> None:
        """Put an edge in the place of another."""
        position = self.position(old)
        self.edges[position] = new
        self._forget(old)
        self._note(new)
        self._displace(old)
        self._place(position, new)

    def keep(self, fits: Callable[[Edge], bool]) -> None:
        """Take all others out."""
        self.edges[:] = [edge for edge in self.edges if fits(edge)]
        self.into.clear()
        self.pairs.clear()
        self._order, self._at = None, {}
        for edge in self.edges:
            self._note(edge)

    # --- finding without a search ---

    @property
    def order(self) -> Sequence[Edge]:
        """The edges in order, so that places are found without counting."""
        if self._order is None:
            self._order = Sequence()
            for position, edge in enumerate(self.edges):
                self._place(position, edge)
        return self._order

    def position(self, edge: Edge) -> int:
        """Return the place of an edge in the order."""
        return self.order.position(edge)

    def at(self, *nodes: object) -> list[Edge]:
        """Return the edges that begin or end at ports of some nodes, or at inner sides of them; in order."""
        order = self.order
        return sorted({edge: None for node in nodes for edge in self._at.get(node, ())}, key=order.label)

    def _place(self, position: int, edge: Edge) -> None:
        self.order.insert(position, edge)
        for end in (edge.source, edge.target):
            self._at.setdefault(getattr(end, "node", None), {})[edge] = None

    def _displace(self, edge: Edge) -> None:
        self.order.remove(edge)
        for end in (edge.source, edge.target):
            node = getattr(end, "node", None)
            there = self._at.get(node, {})
            there.pop(edge, None)
            if not there:
                self._at.pop(node, None)

    def _note(self, edge: Edge) -> None:
        if is_single(edge.target):
            self.into[edge.target] = edge
        else:
            self.pairs[edge.source, edge.target] += 1

    def _forget(self, edge: Edge) -> None:
        if self.into.get(edge.target) is edge:
            del self.into[edge.target]
        pair = edge.source, edge.target
        if self.pairs[pair] > 1:
            self.pairs[pair] -= 1
        else:
            del self.pairs[pair]

    def check_invariants(self) -> None:
        """Fail if the index is not that of the edges; for tests."""
        assert self.into == {edge.target: edge for edge in self.edges if is_single(edge.target)}
        assert self.pairs == Counter((edge.source, edge.target) for edge in self.edges if not is_single(edge.target))
        if self._order is not None:
            assert self._order.items == self.edges
            assert set().union(*self._at.values()) == set(self.edges)


def _again(source: SourceEnd, target: TargetEnd) -> str:
    pair = f'"{end_path(source)}" and "{target.path}"'
    return (
        f"{pair} are connected already; an edge is drawn once (rule P2): leave the second one out, or give its options "
        "to the first"
    )
