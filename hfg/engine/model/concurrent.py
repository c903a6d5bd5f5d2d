"""Firings of one node that are in progress at once (rule F14), and the attempts at a firing that may be retried (X1).

A node has at most one firing or call that is *starting*. If it allows several firings, each of those that continue is a
`ConcurrentFiring`, and `ConcurrentFirings` keeps them in the order in which they started. Other nodes have neither. The
rules are in `rules.concurrency` and `rules.retries`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Generic, Literal, TypeAlias

from hfg.engine.model.contracts import EagerTask, NodeT, Timer
from hfg.engine.model.jobs import Job
from hfg.engine.model.records import Record
from hfg.errors import NodeError
from hfg.trace import FiringOutcome

__all__ = ["Attempts", "ConcurrentFiring", "ConcurrentFirings", "Entry"]

Entry: TypeAlias = "tuple[Any, int | None, float | None]"
"""What is written to an output: value, modifier, stamp."""


@dataclass(slots=True, eq=False)
class Attempts:
    """How often a firing has been tried, and whether it may be tried again (X1)."""

    made: int = 0  # attempts of this firing so far; 0: it failed before its function was called
    arguments: tuple[Any, ...] = ()  # of each attempt
    timer: Timer | None = None  # the pause before the next attempt; None: one is in progress
    triggered: bool = False  # its code has sent a signal, which cannot be taken back

    def begin(self, arguments: tuple[Any, ...], *, made: int = 1) -> None:
        """Start the first attempt of a firing; `made=0`: it fails before its function is called."""
        self.made = made
        self.arguments = arguments
        self.triggered = False

    def may_retry(self, retries: int) -> bool:
        """Return whether the firing may be tried again."""
        return 0 < self.made <= retries and not self.triggered

    def wait(self, timer: Timer) -> None:
        """Start the pause before the next attempt."""
        self.timer = timer

    def again(self) -> None:
        """The pause is over: start the next attempt."""
        self.timer = None
        self.made += 1

    def mark_triggered(self) -> None:
        """A signal has left: this firing is not retried."""
        self.triggered = True

    def cancel(self) -> None:
        """Make no other attempt."""
        timer, self.timer = self.timer, None
        if timer is not None:
            timer.cancel()


@dataclass(slots=True, eq=False)
class ConcurrentFiring(Generic[NodeT]):
    """One firing that is in progress alongside others of its node."""

    worker: NodeT
    number: int
    stamp: float  # of what it sends (T5)
    written: list[Any] | None = None  # per output: what leaves when its turn comes
    attempts: Attempts = field(default_factory=Attempts)
    parameters: dict[str, Any] | None = None  # its node's connected ones when it started (P8); None: there are none
    taken: dict[str, Any] = field(default_factory=dict)  # the values it took, if the event `failed` carries them (X1)
    ticket: int = 0  # of the attempt; the late result of another one is ignored (X2)
    working: bool = False  # its code waits, or runs in a thread
    eager_task: EagerTask | None = None
    job: Job[NodeT] | None = None
    limit_timer: Timer | None = None  # X2: of the attempt
    outcome: FiringOutcome | Literal[""] = ""  # "" while its code has not ended
    failure: NodeError | None = None  # sent as an event after the outputs
    answers: bool = True  # its outputs leave, or NO_MESSAGE if it failed

    @property
    def limit_s(self) -> float | None:
        """The time limit of an attempt (X2); `end()` has none."""
        return None if not self.attempts.made else self.worker.options.max_duration_s

    def begin(
        self, arguments: tuple[Any, ...], parameters: dict[str, Any] | None, taken: dict[str, Any] | None
    ) -> None:
        """Start the first attempt; see the attributes of the same names."""
        self.parameters = parameters
        self.taken = taken or {}
        self.attempts.begin(arguments)

    def work(self, *, eager_task: EagerTask | None = None, job: Job[NodeT] | None = None) -> None:
        """Its code continues on the loop or in a thread."""
        self.working = True
        self.eager_task, self.job = eager_task, job
        self.worker.core.begin_async()

    def rest(self) -> tuple[EagerTask | None, Job[NodeT] | None]:
        """Its code has ended or is given up. Return what ran it."""
        had = self.eager_task, self.job
        self.eager_task = self.job = None
        if self.working:
            self.working = False
            self.worker.core.end_async()
            self.worker.room.notify_watchers()
        return had

    def limit(self, timer: Timer) -> None:
        """Start the time limit of the attempt (X2)."""
        self.limit_timer = timer

    def end_attempt(self) -> None:
        """The attempt has ended or is given up: ignore its late result, stop its time limit."""
        self.ticket += 1
        timer, self.limit_timer = self.limit_timer, None
        if timer is not None:
            timer.cancel()

    def write(self, position: int, entry: Entry) -> None:
        """Its code has written to one output."""
        if self.written is None:
            self.written = [None] * len(self.worker.out_edges)
        self.written[position] = entry

    def take_written(self) -> list[Any] | None:
        """Return what it has written, which leaves now or never."""
        written, self.written = self.written, None
        return written

    def complete(
        self,
        outcome: FiringOutcome,
        written: list[Any] | None = None,
        *,
        failure: NodeError | None = None,
        answers: bool = True,
    ) -> None:
        """Its code has ended; what it sends waits for its turn."""
        self.outcome = outcome
        self.written = written
        self.failure = failure
        self.answers = answers


@dataclass(slots=True, eq=False)
class ConcurrentFirings(Record, Generic[NodeT]):
    """The firings of one node that are in progress, in the order in which they started."""

    limit: int  # how many there may be; those that have ended and wait for their turn count
    ordered: bool  # they leave in the order in which they started; otherwise as they end
    most: int = 0  # the most that there ever were
    leaving: bool = False  # one of them is sending its outputs
    ending: ConcurrentFiring[NodeT] | None = None  # with it the node ends as soon as all others have left (F4)
    last: ConcurrentFiring[NodeT] | None = None  # the one with which the node has ended, or is to end
    idle: list[EagerTask] = field(default_factory=list)  # eager tasks that no firing uses now
    _in_progress: dict[ConcurrentFiring[NodeT], None] = field(default_factory=dict)
    _over: deque[ConcurrentFiring[NodeT]] = field(default_factory=deque)  # as they ended; unused if ordered
    _on_rest: list[Callable[[], None]] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self._in_progress)

    def __iter__(self) -> Iterator[ConcurrentFiring[NodeT]]:
        return iter(list(self._in_progress))

    @property
    def full(self) -> bool:
        """Whether no other firing may start."""
        return len(self._in_progress) >= self.limit or self.ending is not None

    @property
    def unfinished(self) -> bool:
        """Whether code of one of them continues, or is to be retried."""
        return any(not firing.outcome for firing in self._in_progress)

    @property
    def working(self) -> int:
        """How many of them have code that waits or runs in a thread."""
        return sum(firing.working for firing in self._in_progress)

    def begin(self, firing: ConcurrentFiring[NodeT]) -> None:
        """One more is in progress."""
        self._in_progress[firing] = None
        self.most = max(self.most, len(self._in_progress))

    def over(self, firing: ConcurrentFiring[NodeT]) -> None:
        """The code of one of them has ended."""
        if not self.ordered:
            self._over.append(firing)

    def next_to_leave(self, *, to_nobody: bool) -> ConcurrentFiring[NodeT] | None:
        """Return the one whose turn it is to send its outputs; those with no receiver need not wait (F10)."""
        if to_nobody:
            return next((firing for firing in self._in_progress if firing.outcome), None)
        if not self.ordered:
            return self._over[0] if self._over else None
        first = next(iter(self._in_progress), None)
        return first if first is not None and first.outcome else None

    def begin_leaving(self, leaving: bool) -> None:
        """The sending firing continues with the next one by itself if its sending frees the outputs."""
        self.leaving = leaving

    def leave(self, firing: ConcurrentFiring[NodeT]) -> None:
        """It has sent its outputs, or has nothing to send because a source has found its end."""
        del self._in_progress[firing]
        if firing.outcome and not self.ordered:
            self._over.remove(firing)

    def end(self, firing: ConcurrentFiring[NodeT]) -> None:
        """The node ends with this firing, after those that are in progress."""
        self.ending = self.last = firing

    def take_ending(self) -> ConcurrentFiring[NodeT]:
        """All others have left: the node ends now, with the firing returned."""
        firing, self.ending = self.ending, None
        assert firing is not None
        return firing

    def start_over(self) -> None:
        """The node has not ended (F10, A9)."""
        self.ending = None

    def when_rested(self, callback: Callable[[], None]) -> None:
        """Call back when no code of them continues."""
        self._on_rest.append(callback)

    def run_idle_callbacks(self) -> None:
        """Call those back that wait until no code continues."""
        if self._on_rest and not self.unfinished:
            waiting, self._on_rest = self._on_rest, []
            for callback in waiting:
                callback()

    def eager_tasks(self) -> list[EagerTask]:
        """Return all eager tasks, including those of firings that wait."""
        return [*self.idle, *(firing.eager_task for firing in self._in_progress if firing.eager_task is not None)]

    def drop_eager_tasks(self) -> None:
        """No code of the node's previous version continues."""
        idle, self.idle = self.idle, []
        for eager_task in idle:
            eager_task.drop()

    def relations(self) -> Iterator[tuple[bool, str]]:
        """See `Record`."""
        over = [firing for firing in self._in_progress if firing.outcome]
        yield len(self._in_progress) <= self.limit, f"more than {self.limit} of its firings are in progress (F14)"
        yield self.ordered or set(over) == set(self._over), "a firing that has ended is not among those that may leave"
        yield not any(firing.working for firing in over), "a firing has ended, but its code continues"
        yield not self.leaving, "a firing is leaving between two steps"
