"""Which of the nodes of a group that can move is next: by order, priority, deadline, fair share or chance (R2).

A policy is a ready queue with three methods. It may read the state and the options of nodes, but never changes them. It
does not depend on loops or threads.
"""

from __future__ import annotations

import heapq
import itertools
import random
from collections import deque
from collections.abc import Callable, Iterator
from math import inf

from hfg.engine.model.groups import Policy
from hfg.engine.model.running_node import RunningNode
from hfg.errors import UsageError
from hfg.ports.edges import AnyEdge

__all__ = [
    "POLICIES",
    "EarliestDeadline",
    "FairShare",
    "Fifo",
    "Priority",
    "SeededRandom",
    "make_policy",
]


class Fifo(deque[RunningNode]):
    """First in, first out among waves, and within a wave depth first: the default.

    Nodes that a firing enables over sequential edges go ahead of all others, so a wave ends before the next one starts
    (R2).
    """

    push = deque.append
    push_next = deque.appendleft
    pop = deque.popleft


class _Ranked:
    """A heap of nodes by rank, the least first; first in, first out among equals."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, RunningNode]] = []
        self._count = itertools.count()

    def _insert(self, rank: float, node: RunningNode) -> None:
        heapq.heappush(self._heap, (rank, next(self._count), node))

    def pop(self) -> RunningNode:
        """See `Policy`."""
        return heapq.heappop(self._heap)[2]

    def remove(self, node: RunningNode) -> None:
        """See `Policy`."""
        self._heap = [entry for entry in self._heap if entry[2] is not node]
        heapq.heapify(self._heap)

    def __iter__(self) -> Iterator[RunningNode]:
        return iter([node for _, _, node in sorted(self._heap, key=lambda entry: entry[:2])])

    def __len__(self) -> int:
        return len(self._heap)


class Priority(_Ranked):
    """The highest priority first."""

    def push(self, node: RunningNode) -> None:
        """See `Policy`."""
        self._insert(-node.priority, node)


class EarliestDeadline(_Ranked):
    """The nearest deadline first; nodes without one come after all that have one.

    The deadline is the stamp of the oldest token that the firing or call will take, plus the node's `due_s`: its
    `deadline_s`, or that of what it leads to (`graph.flat.deadlines`). A source's is counted from now.
    """

    def push(self, node: RunningNode) -> None:
        """See `Policy`."""
        self._insert(inf if node.due_s is None else _oldest_stamp(node) + node.due_s, node)


def _oldest_stamp(node: RunningNode) -> float:
    """Return the stamp of the oldest token that it takes next."""
    if node.calls and not (node.fireable and not node.calls_before):
        edges: tuple[AnyEdge, ...] = (node.calls[0],)
    else:
        edges = node.live_inputs
    return min((token.stamp for edge in edges for token in edge.contents()[:1]), default=node.core.now())


class FairShare(_Ranked):
    """The node with the least of the group's time first, so that each gets the same share, however long its turns are.

    Start-time fair queueing (Goyal, Vin and Cheng, 1996): a turn starts, on the group's account, where the node's last
    one ended, but not before the turn that is being served; so an idle node saves up no credit.
    """

    def __init__(self) -> None:
        super().__init__()
        self._served = 0.0  # where the turn that was given out last starts
        self._ended: dict[RunningNode, float] = {}  # where each node's last turn ended

    def push(self, node: RunningNode) -> None:
        """See `Policy`."""
        self._insert(max(self._served, self._ended.get(node, 0.0)), node)

    def pop(self) -> RunningNode:
        """See `Policy`."""
        while True:
            start, number, node = heapq.heappop(self._heap)
            ended = self._ended.get(node, 0.0)
            if ended <= start or not self._heap:
                break
            heapq.heappush(self._heap, (ended, number, node))  # it came back before its turn was charged
        self._served = max(self._served, start)
        self._ended[node] = max(start, ended)
        return node

    def charge(self, node: RunningNode, busy_s: float) -> None:
        """Charge a turn to the node's account."""
        self._ended[node] = self._ended.get(node, self._served) + busy_s


class SeededRandom:
    """Any of them, the same each time for the same seed: finds code that relies on an order."""

    def __init__(self, seed: int | None = None) -> None:
        self._random = random.Random(0 if seed is None else seed)
        self._workers: list[RunningNode] = []

    def push(self, node: RunningNode) -> None:
        """See `Policy`."""
        self._workers.append(node)

    def pop(self) -> RunningNode:
        """See `Policy`."""
        nodes = self._workers
        position = self._random.randrange(len(nodes))
        nodes[position], nodes[-1] = nodes[-1], nodes[position]
        return nodes.pop()

    def remove(self, node: RunningNode) -> None:
        """See `Policy`."""
        self._workers.remove(node)

    def __iter__(self) -> Iterator[RunningNode]:
        return iter(self._workers)

    def __len__(self) -> int:
        return len(self._workers)


POLICIES: dict[str, Callable[[int | None], Policy[RunningNode]]] = {
    "fifo": lambda seed: Fifo(),
    "priority": lambda seed: Priority(),
    "deadline": lambda seed: EarliestDeadline(),
    "fair": lambda seed: FairShare(),
    "random": SeededRandom,
}


def make_policy(name: str, seed: int | None) -> Policy[RunningNode]:
    """Make a ready queue.

    Raises:
      UsageError: there is no policy of that name.
    """
    if name not in POLICIES:
        raise UsageError(f'unknown policy "{name}": there are {", ".join(sorted(POLICIES))}')
    return POLICIES[name](seed)
