"""Back-pressure of events (F8): which queues hold a node back, who of it waits for room, and who waits for it.

Stands on `contracts`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic

from hfg.engine.model.contracts import NodeT

__all__ = ["Room"]


class Room(Generic[NodeT]):
    """What is full behind the events of one node.

    Attributes:
      full_edges: how many `wait` queues of its events are full.
      waiting: how much of its code awaits `trigger_wait`.
    """

    __slots__ = ("_node", "_waiters", "_watchers", "full_edges", "waiting")

    def __init__(self, node: NodeT) -> None:
        self._node = node
        self.full_edges = 0
        self.waiting = 0
        self._waiters: list[Callable[[], None]] = []  # called when there is room
        self._watchers: dict[NodeT, None] = {}  # held back by full queues, and in no ring while this one works

    def fill(self) -> None:
        """One more queue is full: the node may be in a ring that has closed by that."""
        core = self._node.core
        self.full_edges += 1
        core.full_edges += 1
        core.suspects[self._node] = None

    def free(self) -> bool:
        """One less; whether none is left. Code that waits for room is told."""
        assert self.full_edges > 0, "a queue is free that was not full"
        self.full_edges -= 1
        self._node.core.full_edges -= 1
        if self.full_edges:
            return False
        self.tell_watchers()
        self.tell_waiters()
        return True

    def when_free(self, waiter: Callable[[], None]) -> None:
        """Call back when no queue is full."""
        self._waiters.append(waiter)

    def tell_waiters(self) -> None:
        """Let code that waits for room go on: there is some, or the run is over."""
        waiters, self._waiters = self._waiters, []
        for waiter in waiters:
            waiter()

    def wait(self, how_many: int) -> None:
        """So much more of the node's code awaits `trigger_wait`, or so much less."""
        core = self._node.core
        self.waiting += how_many
        core.waiting_room += how_many
        assert self.waiting >= 0, "code of the node that did not wait for room waits no more"
        core.suspects[self._node] = None
        self.tell_watchers()

    def be_watched_by(self, held: NodeT) -> None:
        """What is held back by a full queue is in no ring as long as code of this node goes on, or its timer."""
        self._watchers[held] = None

    def tell_watchers(self) -> None:
        """That is over, so they are looked at again."""
        if self._watchers:
            self._node.core.suspects.update(self._watchers)
            self._watchers = {}
