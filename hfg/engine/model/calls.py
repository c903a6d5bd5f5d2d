"""The order in which tokens wait for slot calls (rule F9), if only one event edge leads into a node's slots.

Then it is the order of that edge's queue, and is kept only there.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from itertools import repeat
from typing import Any, TypeAlias

from hfg.ports.edges import AnyEdge, Edge, EventEdge

__all__ = ["Calls", "CallsOfOne"]


class CallsOfOne:
    """Like a deque that contains the edge once for each signal on it; changes of the edge change it."""

    __slots__ = ("_edge", "_queue")

    def __init__(self, edge: EventEdge) -> None:
        self._edge = edge
        self._queue = edge.queue

    def __len__(self) -> int:
        return len(self._queue)

    def __iter__(self) -> Iterator[AnyEdge]:
        return repeat(self._edge, len(self._queue))

    def __getitem__(self, _: int) -> EventEdge:
        return self._edge

    def __delitem__(self, _: int) -> None:
        """The signal has been taken from the edge."""

    def index(self, _: Edge) -> int:
        """All of them are alike."""
        return 0

    def append(self, _: Edge) -> None:
        """The signal is on the edge already."""

    def popleft(self) -> EventEdge:
        """The signal is taken from the edge at once."""
        return self._edge


Calls: TypeAlias = "deque[Any] | CallsOfOne"
"""Edges whose oldest token waits for a slot call, in order of arrival."""
