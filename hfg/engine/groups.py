"""Where nodes run and in which order: run queues with a policy, the loop group and thread groups (rules R1, R2, X2).

A policy is three methods over workers; the loop group's is drained by the pump in `run`. Threads are our own and
daemons: an executor's stuck job would hold the interpreter's exit. Stands on `worker`.
"""

from __future__ import annotations

import contextvars
import heapq
import itertools
import queue
import random
import threading
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from hfg.engine.worker import Worker
from hfg.errors import UsageError

__all__ = [
    "POLICIES",
    "Fifo",
    "Group",
    "Job",
    "LoopGroup",
    "Policy",
    "Priority",
    "SeededRandom",
    "ThreadGroup",
    "make_policy",
]


_DISPATCH_STEPS = 16  # how much one group may do on the loop before others have their turn


class Policy(Protocol):
    """Which of the workers that can move is next (R2).

    A worker stands in it at most once. `push` is called when it can move, `pop` only while there are any; a policy
    may look at everything a worker and its options say (priority, deadline, busy time), but must not change it.
    """

    def push(self, worker: Worker) -> None:
        """Take in a worker that can move."""

    def pop(self) -> Worker:
        """Give out the next one."""

    def __len__(self) -> int: ...


class Fifo(deque[Worker]):
    """First in, first out: the default."""

    push = deque.append
    pop = deque.popleft


class Priority:
    """The highest priority first; first in, first out among equals."""

    def __init__(self) -> None:
        self._heap: list[tuple[int, int, Worker]] = []
        self._count = itertools.count()

    def push(self, worker: Worker) -> None:
        """See `Policy`."""
        heapq.heappush(self._heap, (-worker.priority, next(self._count), worker))

    def pop(self) -> Worker:
        """See `Policy`."""
        return heapq.heappop(self._heap)[2]

    def __len__(self) -> int:
        return len(self._heap)


class SeededRandom:
    """Any of them, the same each time for the same seed: for finding what leans on an order."""

    def __init__(self, seed: int | None = None) -> None:
        self._random = random.Random(0 if seed is None else seed)
        self._workers: list[Worker] = []

    def push(self, worker: Worker) -> None:
        """See `Policy`."""
        self._workers.append(worker)

    def pop(self) -> Worker:
        """See `Policy`."""
        workers = self._workers
        position = self._random.randrange(len(workers))
        workers[position], workers[-1] = workers[-1], workers[position]
        return workers.pop()

    def __len__(self) -> int:
        return len(self._workers)


POLICIES: dict[str, Callable[[int | None], Policy]] = {
    "fifo": lambda seed: Fifo(),
    "priority": lambda seed: Priority(),
    "random": SeededRandom,
}


def make_policy(name: str, seed: int | None) -> Policy:
    """Make a run queue.

    Raises:
      UsageError: there is no policy of that name.
    """
    if name not in POLICIES:
        raise UsageError(f'unknown policy "{name}": there are {", ".join(sorted(POLICIES))}')
    return POLICIES[name](seed)


class Group:
    """Nodes that never run at the same time."""

    threaded = False

    def __init__(self, name: str, policy: Policy) -> None:
        self.name = name
        self.policy = policy
        self.push: Callable[[Worker], None] = policy.push


class LoopGroup(Group):
    """The nodes that run on the event loop itself."""


class Job:
    """A call for a thread, and what came of it."""

    __slots__ = ("arguments", "call", "done", "error", "held", "owner", "result")

    def __init__(
        self,
        owner: Any,
        call: Callable[..., Any],
        arguments: tuple[Any, ...],
        done: Callable[[Any, BaseException | None], None],
    ) -> None:
        self.owner = owner
        self.call = call
        self.arguments = arguments
        self.done = done
        self.held: Any = None  # what keeps virtual time from passing until it is back
        self.result: Any = None
        self.error: BaseException | None = None


class ThreadGroup(Group):
    """A thread of its own. The loop decides what it does next; results and signals come back in order.

    Many with one wake-up.

    Attributes:
      running: jobs given to the thread and not yet back.
      ready: set when it stands in the pump's list of groups that may dispatch.
    """

    threaded = True

    def __init__(
        self,
        name: str,
        policy: Policy,
        ready_groups: deque[ThreadGroup],
        deliver: Callable[[deque[Any]], None],
        context: contextvars.Context,
    ) -> None:
        super().__init__(name, policy)
        self.push = self._push
        self.running = 0
        self._ready_groups = ready_groups
        self._deliver = deliver
        self._context = context
        self._lane: _Lane | None = None
        self.abandoned: list[tuple[str, threading.Thread]] = []

    def _push(self, worker: Worker) -> None:
        self.policy.push(worker)
        if not self.running:
            self._ready_groups.append(self)

    def dispatch(self) -> None:
        """Let nodes start until the thread is busy; on the loop."""
        policy = self.policy
        for _ in range(_DISPATCH_STEPS):
            if self.running or not len(policy):
                return
            worker = policy.pop()
            worker.step(worker)
        if not self.running and len(policy):
            self._ready_groups.append(self)  # silent firings need no thread: others have their turn

    def submit(self, job: Job) -> None:
        """Give the thread a job; on the loop."""
        if self._lane is None:
            self._lane = _Lane(self.name, self._deliver, self._context.copy())
        self.running += 1
        self._lane.jobs.put(job)

    def returned(self) -> None:
        """A job came back; on the loop."""
        self.running -= 1
        if not self.running and len(self.policy):
            self._ready_groups.append(self)

    def signal(self, call: Callable[[], None]) -> None:
        """From the group's own thread: do this on the loop, before the result of the job under way (F3)."""
        lane = _Lane.current()
        if lane is None:
            raise UsageError(
                f'a signal of group "{self.name}" came from a thread that is none of the group\'s: use run.trigger'
            )
        lane.send(call)

    def abandon(self, what: str) -> None:
        """X2: the job under way does not come back; the group goes on in a new thread."""
        lane, self._lane = self._lane, None
        if lane is not None:
            lane.given_up = True
            lane.jobs.put(None)
            self.abandoned.append((what, lane.thread))
        self.running = 0
        if len(self.policy):
            self._ready_groups.append(self)

    def stop(self) -> threading.Thread | None:
        """Let the thread end after what it is doing."""
        lane, self._lane = self._lane, None
        if lane is None:
            return None
        lane.jobs.put(None)
        return lane.thread


class _Lane:
    """One thread, its jobs, and what it has for the loop."""

    _local = threading.local()

    def __init__(self, name: str, deliver: Callable[[deque[Any]], None], context: contextvars.Context) -> None:
        self.jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self.given_up = False
        self._deliver = deliver
        self._out: deque[Any] = deque()
        self.thread = threading.Thread(target=context.run, args=(self._live,), name=f"hfg group {name}", daemon=True)
        self.thread.start()

    @classmethod
    def current(cls) -> _Lane | None:
        return getattr(cls._local, "lane", None)

    def send(self, item: Any) -> None:
        """Hand something to the loop: one wake-up for all that is there when it looks."""
        if self.given_up:
            return
        first = not self._out
        self._out.append(item)
        if first:
            self._deliver(self._out)

    def _live(self) -> None:
        self._local.lane = self
        while (job := self.jobs.get()) is not None:
            try:
                job.result = job.call(*job.arguments)
            except BaseException as error:
                job.error = error
            self.send(job)
            del job
