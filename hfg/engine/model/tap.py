"""Observers of the tokens on an edge (rule R7), and how a fused region serves them.

A tap is called with each token. In a fused region there are no tokens, so a tap that does not need each one at once
receives a whole wave, which costs a fraction.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeAlias

from hfg.base.token import Token
from hfg.ports.edges import AnyEdge

__all__ = ["BatchTap", "FirstLiveTap", "TokenTap", "tap_inside"]

TokenTap: TypeAlias = Callable[[Token[Any]], None]


class BatchTap(partial[None]):
    """A tap that can receive all that has passed in a wave at its end; otherwise it is called with each token.

    Attributes:
      place: what it observes, for its own use.
      batch: called with five entries for each token, in order: the place, the value (None: NO_MESSAGE), the stamp, the
        number on its edge, and when it passed, on the clock of the run. These tokens have activity 0.
    """

    place: object
    batch: Callable[[tuple[Any, ...]], None]

    @classmethod
    def of(cls, tap: TokenTap, place: object, batch: Callable[[tuple[Any, ...]], None]) -> BatchTap:
        """Make one from what is called with each token."""
        made = cls(tap)
        made.__dict__.update(place=place, batch=batch)
        return made


class FirstLiveTap(partial[None]):
    """Fan-out carries the same token on each edge: this observes only the first edge that is live."""

    @classmethod
    def of(cls, edges: Sequence[AnyEdge], edge: AnyEdge, tap: TokenTap) -> FirstLiveTap:
        """Make what is called with each token of one of the edges."""
        return cls(_if_first, edges, edge, tap)

    def now(self) -> TokenTap | None:
        """Return what it amounts to as long as the same edges are live."""
        edges, edge, tap = self.args
        return tap if _is_first(edges, edge) else None


def tap_inside(edge: AnyEdge) -> TokenTap | None:
    """Return the tap of an edge inside of a region, which exists only while its edges are live."""
    tap: TokenTap | None = edge.tap
    return tap.now() if isinstance(tap, FirstLiveTap) else tap


def _if_first(edges: Sequence[AnyEdge], edge: AnyEdge, tap: TokenTap, token: Token[Any]) -> None:
    if _is_first(edges, edge):
        tap(token)


def _is_first(edges: Sequence[AnyEdge], edge: AnyEdge) -> bool:
    return edge is next((one for one in edges if one.live), None)
