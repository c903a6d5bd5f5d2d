"""Where nodes run: the loop group, other groups on the loop, and thread groups (rules R1, R2, X2).

A group's policy decides which node is next. The pump in `engine` drains the loop group; the others dispatch when it
calls them. Threads are daemons of our own, because an executor would wait for a stuck job when the interpreter exits.
"""

from __future__ import annotations

import contextvars
import queue
import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

from hfg.engine.model import Group, Job, RunningNode
from hfg.engine.model.groups import Policy
from hfg.errors import UsageError

__all__ = ["CheckedTurn", "Dispatching", "LoopGroup", "SideGroup", "ThreadGroup", "current_job"]


_DISPATCH_STEPS = 16  # how much one group may do on the loop before others have their turn


class LoopGroup(Group):
    """The nodes that run on the event loop itself."""

    def __init__(self, name: str, policy: Policy[RunningNode], clock: Callable[[], float]) -> None:
        super().__init__(name, policy, clock)
        self.in_a_row = True
        if self.charges is not None:
            self.look_at_each_turn(_Turn(self).take)


class _Turn:
    """Takes the place of the node whose turn on the loop is measured; only if the policy shares time."""

    __slots__ = ("_clock", "_group", "_worker")

    def __init__(self, group: Group) -> None:
        self._group = group
        self._clock = group.clock
        self._worker: Any = None

    def take(self) -> _Turn:
        self._worker = self._group.policy.pop()
        return self

    def step(self, _: _Turn) -> None:
        worker, began = self._worker, self._clock()
        try:
            worker.step(worker)
        finally:
            self._group.charge(worker, self._clock() - began)


class CheckedTurn:
    """Takes the place of the node whose turn it is, and checks invariants after every step.

    In debug mode these are the node's own; in the tests of the semantics, all.
    """

    def __init__(self, group: Group, of_all: Callable[[], None] | None) -> None:
        self._take = group.take
        self._of_all = of_all
        self._turn: Any = None

    def take(self) -> CheckedTurn:
        """Return what is to be stepped next."""
        self._turn = self._take()
        return self

    def step(self, _: CheckedTurn) -> None:
        """Step it, then check."""
        turn = self._turn
        turn.step(turn)
        if self._of_all is not None:
            self._of_all()
        elif isinstance(turn, RunningNode) and not turn.core.over:
            turn.check_invariants()


class SideGroup(LoopGroup):
    """Nodes on the loop with a policy of their own."""

    def __init__(
        self,
        name: str,
        policy: Policy[RunningNode],
        clock: Callable[[], float],
        ready_groups: deque[Dispatching],
        flags: Sequence[str],
    ) -> None:
        super().__init__(name, policy, clock)
        self._flags = flags
        self._into = self.push, self.push_next
        self.push, self.push_next = self._push, self._push_next
        self._ready_groups = ready_groups
        self._stands = False  # in ready_groups

    def _push(self, worker: RunningNode) -> None:
        self._into[0](worker)
        self._stand()

    def _push_next(self, worker: RunningNode) -> None:
        self._into[1](worker)
        self._stand()

    def _stand(self) -> None:
        if not self._stands and len(self.policy):
            self._stands = True
            self._ready_groups.append(self)

    def dispatch(self) -> int:
        """Let some nodes move. Return how many."""
        self._stands = False
        moved = 0
        try:
            while moved < _DISPATCH_STEPS and not (self.paused or self._flags) and len(self.policy):
                moved += 1
                worker = self.take()
                worker.step(worker)
        finally:
            self._stand()
        return moved


class ThreadGroup(Group):
    """Nodes with threads of their own. The loop decides what the threads do next.

    Results and signals of each thread come back in order, many with one wake-up.

    Attributes:
      running: jobs that threads have and that are not back.
      threads: how many it may have; they are created on demand.
    """

    threaded = True

    def __init__(
        self,
        name: str,
        policy: Policy[RunningNode],
        clock: Callable[[], float],
        ready_groups: deque[Dispatching],
        deliver: Callable[[deque[Any]], None],
        context: contextvars.Context,
        threads: int = 1,
    ) -> None:
        super().__init__(name, policy, clock)
        self._into = self.push, self.push_next
        self.push, self.push_next = self._push, self._push_next
        self.running = 0
        self.threads = threads
        self.several = threads > 1
        self._ready_groups = ready_groups
        self._deliver = deliver
        self._context = context
        self._lanes: list[_Lane] = []
        self._idle: list[_Lane] = []
        self.abandoned: list[tuple[str, threading.Thread]] = []

    @property
    def full(self) -> bool:
        """See `Group`."""
        return self.running >= self.threads

    def _push(self, worker: RunningNode) -> None:
        self._into[0](worker)
        if self.running < self.threads:
            self._ready_groups.append(self)

    def _push_next(self, worker: RunningNode) -> None:
        self._into[1](worker)
        if self.running < self.threads:
            self._ready_groups.append(self)

    def dispatch(self) -> int:
        """Let nodes start until the threads are busy. Return how many; on the loop."""
        policy, moved = self.policy, 0
        while moved < _DISPATCH_STEPS and not self.paused and self.running < self.threads and len(policy):
            moved += 1
            worker = self.take()
            worker.step(worker)
        if self.running < self.threads and len(policy):
            self._ready_groups.append(self)  # silent firings need no thread: others have their turn
        return moved

    def submit(self, job: Job) -> None:
        """Pass a job to a thread; on the loop."""
        lane = self._idle.pop() if self._idle else self._new_lane()
        job.begin(lane, 0.0 if self.charges is None else self.clock())
        self.running += 1
        lane.jobs.put(job)

    def _new_lane(self) -> _Lane:
        """Create a thread; the first has the name of the group."""
        name = self.name if not self._lanes else f"{self.name} {len(self._lanes) + 1}"
        lane = _Lane(name, self._deliver, self._context.copy())
        self._lanes.append(lane)
        return lane

    def returned(self, job: Job) -> None:
        """A job is back; on the loop."""
        self.running -= 1
        self._idle.append(job.lane)
        if self.charges is not None:
            self.charge(job.worker, self.clock() - job.began)
        if len(self.policy):
            self._ready_groups.append(self)

    def signal(self, call: Callable[[], None]) -> None:
        """From the group's own thread: make this call on the loop, before the result of the current job (F3)."""
        lane = _Lane.current()
        if lane is None:
            raise UsageError(
                f'a signal of group "{self.name}" came from a thread that is none of the group\'s: use run.trigger'
            )
        lane.send(call)

    def thread_id(self) -> int:
        """Return the id of its only thread; 0 if there is none yet."""
        return self._lanes[0].thread.ident or 0 if self._lanes else 0

    def abandon(self, what: str, job: Job) -> None:
        """The current job does not come back; the group continues in a new thread (X2)."""
        if self.charges is not None:
            self.charge(job.worker, self.clock() - job.began)
        lane = job.lane
        if lane in self._lanes:
            self._lanes.remove(lane)
            lane.give_up()
            self.abandoned.append((what, lane.thread))
            self.running -= 1
        if len(self.policy):
            self._ready_groups.append(self)

    def stop(self) -> list[threading.Thread]:
        """Let the threads end after their current jobs. Return them."""
        lanes, self._lanes, self._idle = self._lanes, [], []
        for lane in lanes:
            lane.jobs.put(None)
        return [lane.thread for lane in lanes]


Dispatching: TypeAlias = SideGroup | ThreadGroup
"""Groups that let their nodes move when the pump calls them."""


def current_job() -> Job | None:
    """Return the current job of the calling thread, if it is one of a group."""
    lane = _Lane.current()
    return None if lane is None else lane.job


class _Lane:
    """One thread, its jobs, and what it has for the loop."""

    _local = threading.local()

    def __init__(self, name: str, deliver: Callable[[deque[Any]], None], context: contextvars.Context) -> None:
        self.jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self.job: Job | None = None  # in progress
        self.given_up = False
        self._deliver = deliver
        self._out: deque[Any] = deque()
        self.thread = threading.Thread(target=context.run, args=(self._live,), name=f"hfg group {name}", daemon=True)
        self.thread.start()

    @classmethod
    def current(cls) -> _Lane | None:
        return getattr(cls._local, "lane", None)

    def send(self, item: Any) -> None:
        """Pass something to the loop, with one wake-up for all that is there by then."""
        if self.given_up:
            return
        first = not self._out
        self._out.append(item)
        if first:
            self._deliver(self._out)

    def give_up(self) -> None:
        """Ignore what its thread still sends; the thread ends by itself."""
        self.given_up = True
        self.jobs.put(None)

    def _live(self) -> None:
        self._local.lane = self
        while (job := self.jobs.get()) is not None:
            self.job = job
            job.run()
            self.job = None
            self.send(job)
            del job
