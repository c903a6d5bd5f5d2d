"""Who looks at what passes an edge (rule R7), and what a fused region may make of that.

A look is called with each token. Where nodes are fused there are no tokens, so those that need not see one at once are
told of a whole wave together, which costs a fraction. Stands on the edges.
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
    """A look that can be told of all that has passed in a wave at its end; else it is called with each token.

    Attributes:
      place: what it looks at, for its own use.
      batch: called with five entries for each token, in the order in which they have passed: the place, the value
        (None: NO_MESSAGE), the stamp, the number on its edge, and when it passed, on the clock of the run. What passes
        so has activity 0.
    """

    place: object
    batch: Callable[[tuple[Any, ...]], None]

    @classmethod
    def of(cls, look: TokenTap, place: object, batch: Callable[[tuple[Any, ...]], None]) -> BatchTap:
        """Make one of what is called with each token."""
        made = cls(look)
        made.place, made.batch = place, batch
        return made


class FirstLiveTap(partial[None]):
    """Fan-out carries the same token on each edge: this looks at the first that is live only."""

    @classmethod
    def of(cls, edges: Sequence[AnyEdge], edge: AnyEdge, look: TokenTap) -> FirstLiveTap:
        """Make what is called with each token of one of the edges."""
        return cls(_if_first, edges, edge, look)

    def now(self) -> TokenTap | None:
        """What it comes to as long as the same edges are live."""
        edges, edge, look = self.args
        return look if _is_first(edges, edge) else None


def tap_inside(edge: AnyEdge) -> TokenTap | None:
    """Who looks at an edge inside of a region, which lasts no longer than its edges are live."""
    look: TokenTap | None = edge.tap
    return look.now() if isinstance(look, FirstLiveTap) else look


def _if_first(edges: Sequence[AnyEdge], edge: AnyEdge, look: TokenTap, token: Token[Any]) -> None:
    if _is_first(edges, edge):
        look(token)


def _is_first(edges: Sequence[AnyEdge], edge: AnyEdge) -> bool:
    return edge is next((one for one in edges if one.live), None)
