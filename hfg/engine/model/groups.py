"""A group of nodes, of which one runs at a time, or as many as it has threads; and its ready queue (rules R1, R2).

This is what decisions need of a group. How the loop or a thread takes nodes from the queue is in `executing.groups`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Generic, Protocol

from hfg.engine.model.contracts import NodeT

__all__ = ["Group", "Policy"]


class Policy(Protocol[NodeT]):
    """Determines which of the nodes that can move is next (R2): a ready queue with an order of its own.

    A node is queued at most once. `push` is called when it can move, `pop` only while there are any. A policy may have
    two more methods: `push_next(node)` puts what a firing enables ahead of all others, and `charge(node, busy_s)`
    receives the time of each turn.
    """

    def push(self, node: NodeT) -> None:
        """Add a node that can move."""

    def pop(self) -> NodeT:
        """Remove and return the next one."""

    def remove(self, node: NodeT) -> None:
        """Remove one that is queued."""

    def __iter__(self) -> Iterator[NodeT]:
        """Iterate over those that are queued, the next ones first as far as that is known."""

    def __len__(self) -> int: ...


class Group(Generic[NodeT]):
    """Nodes that never run at the same time, unless they have several threads.

    Attributes:
      push: queues a node that can move; push_next: ahead of all others, if the policy allows it.
      take: returns what is to be stepped next.
      in_a_row: no observer needs to see each turn by itself, so a step may continue with the next in the queue.
      budget: how many nodes may move before the pump looks at other things, including the current one; 1 if it is not
        the pump that lets them.
      signal_step: of all its nodes that only have slots which events feed, once there is one.
    """

    threaded = False
    several = False  # it has more than one thread

    def __init__(self, name: str, policy: Policy[NodeT], clock: Callable[[], float]) -> None:
        self.name = name
        self.policy = policy
        self.push: Callable[[NodeT], None] = policy.push
        push_next: Callable[[NodeT], None] | None = getattr(policy, "push_next", None)
        self.depth_first = push_next is not None  # what a firing enables is next (R2)
        self.push_next: Callable[[NodeT], None] = push_next or policy.push
        self.take: Callable[[], Any] = policy.pop
        self.charges: Callable[[NodeT, float], None] | None = getattr(policy, "charge", None)
        self.clock = clock  # read only if the policy shares time
        self.paused = False  # R3: none of its nodes moves
        self.in_a_row = False
        self.budget = 1
        self.signal_step: Callable[[NodeT], None] | None = None

    def pause(self, paused: bool) -> None:
        """Set whether its nodes may move (R3)."""
        self.paused = paused

    def set_budget(self, budget: int) -> None:
        """Let this many nodes move before the pump looks at other things."""
        self.budget = budget

    def spend(self, more: int) -> None:
        """This many more nodes have moved in the step of the node that the pump let move."""
        self.budget -= more

    def look_at_each_turn(self, take: Callable[[], Any]) -> None:
        """Step what this returns instead of the node whose turn it is, one turn at a time."""
        self.take = take
        self.in_a_row = False

    @property
    def full(self) -> bool:
        """Whether all its threads are running, so that none of its nodes can move."""
        return False

    def charge(self, node: NodeT, busy_s: float) -> None:
        """A node has kept the group busy for this long."""
        if self.charges is not None:
            self.charges(node, busy_s)
