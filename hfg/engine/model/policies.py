"""Which of the nodes of a group that can move is next: first in first out, priority, deadline, fair share, chance (R2).

A policy is a run queue: three methods over workers. It may look at everything a worker and its options say, and never
changes them. Stands on `running_node`; knows neither loops nor threads.
"""

from __future__ import annotations

import heapq
import itertools
import random
from collections import deque
from collections.abc import Callable, Iterator
from math import inf
from typing import Any

from hfg.engine.model.groups import Policy
from hfg.engine.model.running_node import RunningNode
from hfg.errors import UsageError

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

    What a firing enables over sequential edges goes in front of all that waits, so a wave comes to its end before the
    next one begins (R2).
    """

    push = deque.append
    push_next = deque.appendleft
    pop = deque.popleft


class _Ranked:
    """A heap of workers by rank, the least first; first in, first out among equals."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, RunningNode]] = []
        self._count = itertools.count()

    def _insert(self, rank: float, worker: RunningNode) -> None:
        heapq.heappush(self._heap, (rank, next(self._count), worker))

    def pop(self) -> RunningNode:
        """See `Policy`."""
        return heapq.heappop(self._heap)[2]

    def remove(self, worker: RunningNode) -> None:
        """See `Policy`."""
        self._heap = [entry for entry in self._heap if entry[2] is not worker]
        heapq.heapify(self._heap)

    def __iter__(self) -> Iterator[RunningNode]:
        return iter([worker for _, _, worker in sorted(self._heap, key=lambda entry: entry[:2])])

    def __len__(self) -> int:
        return len(self._heap)


class Priority(_Ranked):
    """The highest priority first."""

    def push(self, worker: RunningNode) -> None:
        """See `Policy`."""
        self._insert(-worker.priority, worker)


class EarliestDeadline(_Ranked):
    """Whose deadline is nearest goes first; a node without `deadline_s` has none and comes behind all that have one.

    The deadline is the stamp of the oldest token that the firing or call will take, plus the node's `deadline_s`; a
    source's is counted from now.
    """

    def push(self, worker: RunningNode) -> None:
        """See `Policy`."""
        allowed = worker.options.deadline_s if worker.options is not None else None
        self._insert(inf if allowed is None else _oldest_stamp(worker) + allowed, worker)


def _oldest_stamp(worker: RunningNode) -> float:
    """When the oldest of what it takes next was made."""
    if worker.calls and not (worker.fireable and not worker.calls_before):
        edges: tuple[Any, ...] = (worker.calls[0],)
    else:
        edges = worker.live_inputs
    return min((token.stamp for edge in edges for token in edge.contents()[:1]), default=worker.core.now())


class FairShare(_Ranked):
    """Who has had the least of the group's time goes first, so that each gets the same share however long it takes.

    Start-time fair queueing (Goyal, Vin and Cheng, 1996): a turn starts, on the group's account, where the node's last
    one ended, but not before the turn that is being served; so nobody saves up credit while it has nothing to do.
    """

    def __init__(self) -> None:
        super().__init__()
        self._served = 0.0  # where the turn that was given out last starts
        self._ended: dict[RunningNode, float] = {}  # where each worker's last turn ended

    def push(self, worker: RunningNode) -> None:
        """See `Policy`."""
        self._insert(max(self._served, self._ended.get(worker, 0.0)), worker)

    def pop(self) -> RunningNode:
        """See `Policy`."""
        while True:
            start, number, worker = heapq.heappop(self._heap)
            ended = self._ended.get(worker, 0.0)
            if ended <= start or not self._heap:
                break
            heapq.heappush(self._heap, (ended, number, worker))  # it came back before its turn was charged
        self._served = max(self._served, start)
        self._ended[worker] = max(start, ended)
        return worker

    def charge(self, worker: RunningNode, busy_s: float) -> None:
        """Put what a turn took on the worker's account."""
        self._ended[worker] = self._ended.get(worker, self._served) + busy_s


class SeededRandom:
    """Any of them, the same each time for the same seed: for finding what leans on an order."""

    def __init__(self, seed: int | None = None) -> None:
        self._random = random.Random(0 if seed is None else seed)
        self._workers: list[RunningNode] = []

    def push(self, worker: RunningNode) -> None:
        """See `Policy`."""
        self._workers.append(worker)

    def pop(self) -> RunningNode:
        """See `Policy`."""
        workers = self._workers
        position = self._random.randrange(len(workers))
        workers[position], workers[-1] = workers[-1], workers[position]
        return workers.pop()

    def remove(self, worker: RunningNode) -> None:
        """See `Policy`."""
        self._workers.remove(worker)

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
    """Make a run queue.

    Raises:
      UsageError: there is no policy of that name.
    """
    if name not in POLICIES:
        raise UsageError(f'unknown policy "{name}": there are {", ".join(sorted(POLICIES))}')
    return POLICIES[name](seed)
