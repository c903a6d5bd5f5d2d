"""Selects the trace events that a part reports: both parts of an edge between them see some of its events (rule R7)."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from hfg.graph.flat import CutEdge
from hfg.trace import TokenProcessed, TokenSent, TokenTaken, TraceEvent


def trace_filter(part: str, edges: Iterable[CutEdge]) -> Callable[[TraceEvent], bool]:
    """Return a filter for the trace events that a part reports; each edge between two parts is in both.

    The source's part reports sent and processed tokens, the target's part taken ones.
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
