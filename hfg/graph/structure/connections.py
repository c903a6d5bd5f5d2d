"""The edges of one level, in order, and which of them leads into each input (rule P2). Judges nothing."""

from __future__ import annotations

from collections.abc import Callable

from hfg import errors
from hfg.graph.structure.edge import Edge, SourceEnd, TargetEnd, end_path, is_single

__all__ = ["Connections"]


class Connections:
    """Edges with an index, so that connecting the ten-thousandth is as fast as the first.

    Attributes:
      edges: in order of connecting.
      into: the edge into each target that takes one alone.
      pairs: the ends of all other edges.
    """

    __slots__ = ("edges", "into", "pairs")

    def __init__(self) -> None:
        self.edges: list[Edge] = []
        self.into: dict[TargetEnd, Edge] = {}
        self.pairs: set[tuple[SourceEnd, TargetEnd]] = set()

    def refuse_second(self, source: SourceEnd, target: TargetEnd) -> None:
        """Refuse an edge that there is, and a second one into what takes one.

        Raises:
          ConnectionError: naming what is in the way.
        """
        if not is_single(target):
            if (source, target) in self.pairs:
                raise errors.ConnectionError(
                    f'"{end_path(source)}" and "{target.path}" are connected already; an edge is drawn once (rule P2)'
                )
            return
        found = self.into.get(target)
        if found is None:
            return
        if found.source is source:
            raise errors.ConnectionError(
                f'"{end_path(source)}" and "{target.path}" are connected already; an edge is drawn once'
            )
        raise errors.ConnectionError(
            f'"{target.path}" takes one edge and has one from "{end_path(found.source)}", '
            f'so "{end_path(source)}" cannot lead there too; '
            "use a slot, or a node that joins the two (rule P2)"
        )

    def append(self, edge: Edge) -> None:
        """Add an edge behind all others."""
        self.edges.append(edge)
        self._note(edge)

    def insert(self, position: int, edge: Edge) -> None:
        """Add an edge at its place in the order."""
        self.edges.insert(position, edge)
        self._note(edge)

    def remove(self, position: int) -> None:
        """Take the edge at a position out."""
        self._forget(self.edges.pop(position))

    def swap(self, old: Edge, new: Edge) -> None:
        """Put an edge in the place of another."""
        self.edges[self.edges.index(old)] = new
        self._forget(old)
        self._note(new)

    def keep(self, fits: Callable[[Edge], bool]) -> None:
        """Take all others out."""
        self.edges[:] = [edge for edge in self.edges if fits(edge)]
        self.into.clear()
        self.pairs.clear()
        for edge in self.edges:
            self._note(edge)

    def _note(self, edge: Edge) -> None:
        if is_single(edge.target):
            self.into[edge.target] = edge
        else:
            self.pairs.add((edge.source, edge.target))

    def _forget(self, edge: Edge) -> None:
        if self.into.get(edge.target) is edge:
            del self.into[edge.target]
        self.pairs.discard((edge.source, edge.target))

    def check_invariants(self) -> None:
        """Fail if the index is not that of the edges; for tests."""
        assert self.into == {edge.target: edge for edge in self.edges if is_single(edge.target)}
        assert self.pairs == {(edge.source, edge.target) for edge in self.edges if not is_single(edge.target)}
