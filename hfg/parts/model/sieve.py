"""Which events of the trace a part tells, for of what passes an edge between two parts both see something (rule R7)."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from hfg.graph.flat import CutEdge
from hfg.trace import TokenProcessed, TokenSent, TokenTaken, TraceEvent

__all__ = ["sieve"]


def sieve(part: str, edges: Iterable[CutEdge]) -> Callable[[TraceEvent], bool]:
    """Give what says whether an event of the trace is told by a part: each edge between two is in both.

    The source's part tells what is sent and processed, the target's what is taken.
    """
    edges = tuple(edges)
    leaving = {edge.label for edge in edges if edge.source == part}
    coming = {edge.label for edge in edges if edge.target == part}

    def is_told(event: TraceEvent) -> bool:
        if isinstance(event, TokenTaken):
            return event.edge not in leaving
        if isinstance(event, TokenSent | TokenProcessed):
            return event.edge not in coming
        return True

    return is_told
