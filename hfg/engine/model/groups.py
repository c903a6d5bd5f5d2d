"""A group of nodes, of which one runs at a time, or as many as it has threads, and the queue of those that can move.

Rules R1 and R2.

What the deciding modules see of it; how the loop or a thread takes from the queue is in `executing.groups`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Generic, Protocol

from hfg.engine.model.contracts import NodeT

__all__ = ["Group", "Policy"]


class Policy(Protocol[NodeT]):
    """Which of the workers that can move is next (R2).

    A worker stands in it at most once. `push` is called when it can move, `pop` only while there are any. Two more
    methods may be there: `push_next(worker)`, where what a firing enables goes before all others, and
    `charge(worker, busy_s)`, where a turn's time matters.
    """

    def push(self, worker: NodeT) -> None:
        """Take in a worker that can move."""

    def pop(self) -> NodeT:
        """Give out the next one."""

    def remove(self, worker: NodeT) -> None:
        """Take out one that stands in it."""

    def __iter__(self) -> Iterator[NodeT]:
        """Go through those that stand in it, the next ones first as far as that is known."""

    def __len__(self) -> int: ...


class Group(Generic[NodeT]):
    """Nodes that never run at the same time, unless they have several threads.

    Attributes:
      push: takes in a worker that can move.
      take: gives out what is to be stepped next.
      in_a_row: nobody wants to see each turn by itself: a step may go on with the next in the queue, while there are
        turns.
      budget: how many nodes may move before the pump looks round, the one whose turn it is included; 1 if it is not the
        pump that lets them.
      signal_step: of all its nodes that live by slots which events feed, once there is one.
    """

    threaded = False
    several = False  # it has more than one thread

    def __init__(self, name: str, policy: Policy[NodeT], clock: Callable[[], float]) -> None:
        self.name = name
        self.policy = policy
        self.push: Callable[[NodeT], None] = policy.push
        push_next: Callable[[NodeT], None] | None = getattr(policy, "push_next", None)
        self.depth_first = push_next is not None  # what a firing enables goes next (R2)
        self.push_next: Callable[[NodeT], None] = push_next or policy.push
        self.take: Callable[[], NodeT] = policy.pop
        self.charges: Callable[[NodeT, float], None] | None = getattr(policy, "charge", None)
        self.clock = clock  # read only where time is shared
        self.paused = False
        self.in_a_row = False
        self.budget = 1
        self.signal_step: Callable[[NodeT], None] | None = None

    def pause(self, paused: bool) -> None:
        """R3: whether nobody of it moves, for the run is paused."""
        self.paused = paused

    def set_budget(self, budget: int) -> None:
        """So many nodes may move before the pump looks round."""
        self.budget = budget

    def spend(self, more: int) -> None:
        """So many more nodes have moved in the step of the one that the pump has let move."""
        self.budget -= more

    def look_at_each_turn(self, take: Callable[[], Any]) -> None:
        """Somebody wants to see each turn by itself: this gives out what stands for the node whose turn it is."""
        self.take = take
        self.in_a_row = False

    @property
    def full(self) -> bool:
        """Whether its threads are all at work, so that nobody of it can move."""
        return False

    def charge(self, worker: NodeT, busy_s: float) -> None:
        """A worker has kept the group busy for so long."""
        if self.charges is not None:
            self.charges(worker, busy_s)
