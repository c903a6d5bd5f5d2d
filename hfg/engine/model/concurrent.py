"""Firings of one node that are under way at once (rule F14), and the attempts at a firing that may be repeated (X1).

A node has at most one firing or call that is *beginning*. Where it allows several firings, those that go on are each a
`ConcurrentFiring`, and `ConcurrentFirings` keeps them in the order in which they began. Both exist only where they are
asked for. Plain state; the rules are in `rules.concurrency` and `rules.retries`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Generic, TypeAlias

from hfg.engine.model.contracts import NodeT, Timer
from hfg.errors import EngineInternalError, NodeError

__all__ = ["Attempts", "ConcurrentFiring", "ConcurrentFirings", "Entry"]

Entry: TypeAlias = "tuple[Any, int | None, float | None]"  # what is written to an output: value, modifier, stamp


class Attempts:
    """How often a firing has been tried, and whether it may be once more.

    Attributes:
      made: attempts of this firing so far.
      arguments: what each of them is given.
      timer: the pause before the next one; None: it is under way.
      triggered: its code has sent a signal, which nobody can take back.
    """

    __slots__ = ("arguments", "made", "timer", "triggered")

    def __init__(self) -> None:
        self.made = 0
        self.arguments: tuple[Any, ...] = ()
        self.timer: Any = None
        self.triggered = False

    def begin(self, arguments: tuple[Any, ...]) -> None:
        """The first attempt of a firing."""
        self.made = 1
        self.arguments = arguments
        self.triggered = False

    def begin_none(self) -> None:
        """The firing fails before its function is run."""
        self.made = 0

    def may_go_on(self, retries: int) -> bool:
        """Whether the firing may be tried once more."""
        return 0 < self.made <= retries and not self.triggered

    def rest(self, timer: Timer) -> None:
        """This long until the next attempt."""
        self.timer = timer

    def again(self) -> None:
        """The pause is over: the next attempt."""
        self.timer = None
        self.made += 1

    def has_triggered(self) -> None:
        """A signal has left."""
        self.triggered = True

    def cancel(self) -> None:
        """There will be no other attempt."""
        timer, self.timer = self.timer, None
        if timer is not None:
            timer.cancel()


class ConcurrentFiring(Generic[NodeT]):
    """One firing that is under way beside others.

    Attributes:
      number: of the firing.
      stamp: of what it sends (T5).
      parameters: what the connected parameters of its node were as it began (P8); None: there are none.
      attempts: tries at it.
      ticket: of the attempt; a late result of another one is not listened to (X2).
      working: its code waits or runs in a thread.
      eager_task, job: what does that for it.
      limit_timer: how long the attempt may take (X2).
      written: per output what leaves when its turn comes.
      outcome: how it went; "" while it is not over.
      failure: what X1 made of an error; it is told behind the outputs.
      taken: the values that it has taken, if `failed` is to tell (X1).
      answers: NO_MESSAGE leaves although it failed (X1).
    """

    __slots__ = (
        "answers",
        "attempts",
        "eager_task",
        "failure",
        "job",
        "limit_timer",
        "number",
        "outcome",
        "parameters",
        "stamp",
        "taken",
        "ticket",
        "worker",
        "working",
        "written",
    )

    def __init__(self, worker: NodeT, number: int, stamp: float) -> None:
        self.worker = worker
        self.number = number
        self.stamp = stamp
        self.parameters: dict[str, Any] | None = None
        self.attempts = Attempts()
        self.ticket = 0
        self.working = False
        self.eager_task: Any = None
        self.job: Any = None
        self.limit_timer: Any = None
        self.written: list[Any] | None = None
        self.outcome = ""
        self.failure: NodeError | None = None
        self.taken: dict[str, Any] = {}
        self.answers = True

    @property
    def limit_s(self) -> float | None:
        """X2: how long an attempt may take; `end()` has no limit."""
        return None if not self.attempts.made else self.worker.options.max_duration_s

    def work(self, *, eager_task: object = None, job: object = None) -> None:
        """Its code goes on: it waits on the loop, or is in a thread."""
        self.working = True
        self.eager_task, self.job = eager_task, job
        self.worker.core.begin_async()

    def rest(self) -> tuple[Any, Any]:
        """Its code is over or given up; gives back carrier and job."""
        had = self.eager_task, self.job
        self.eager_task = self.job = None
        if self.working:
            self.working = False
            self.worker.core.end_async()
            self.worker.room.tell_watchers()
        return had

    def limit(self, timer: Timer) -> None:
        """X2: the attempt may take as long as this timer."""
        self.limit_timer = timer

    def in_time(self) -> None:
        """The attempt is over in time, or given up: its late result is not listened to."""
        self.ticket += 1
        timer, self.limit_timer = self.limit_timer, None
        if timer is not None:
            timer.cancel()

    def write(self, position: int, entry: Entry) -> None:
        """Its code has written to one output."""
        if self.written is None:
            self.written = [None] * len(self.worker.out_edges)
        self.written[position] = entry

    def remember(self, taken: dict[str, Any]) -> None:
        """It has taken these values; should it fail, that is told (X1)."""
        self.taken = taken

    def be_given(self, written: list[Any] | None) -> None:
        """This was written before it, by the firing that has found the end."""
        self.written = written

    def take_written(self) -> list[Any] | None:
        """What it has written leaves now, or never."""
        written, self.written = self.written, None
        return written

    def be_over(self, outcome: str, written: list[Any] | None = None) -> None:
        """Its code has come to its end; what it sends waits for its turn."""
        self.outcome = outcome
        self.written = written

    def say_nothing(self) -> None:
        """Nothing leaves, not even NO_MESSAGE."""
        self.answers = False

    def fail(self, failure: NodeError, outcome: str, *, answers: bool) -> None:
        """X1: its code has failed for good."""
        self.outcome = outcome
        self.written = None
        self.failure = failure
        self.answers = answers


class ConcurrentFirings(Generic[NodeT]):
    """The firings of one node that are under way, in the order in which they began.

    Attributes:
      limit: how many there may be; those that are over and wait for their turn count.
      ordered: they leave in that order; else as they are over.
      most: how many there ever were.
      leaving: one of them is sending what it has.
      ending: the node is to end as soon as all others have left (F4): the stamp of that firing; else None.
      end_number, end_written: of that firing.
      idle: eager_tasks that no firing uses now.
    """

    __slots__ = (
        "_on_rest",
        "_over",
        "_under_way",
        "end_number",
        "end_written",
        "ending",
        "idle",
        "leaving",
        "limit",
        "most",
        "ordered",
    )

    def __init__(self, limit: int, ordered: bool) -> None:
        self.limit = limit
        self.ordered = ordered
        self.most = 0
        self.leaving = False
        self.ending: float | None = None
        self.end_number = 0
        self.end_written: list[Any] | None = None
        self.idle: list[Any] = []
        self._under_way: dict[ConcurrentFiring[NodeT], None] = {}
        self._over: deque[ConcurrentFiring[NodeT]] = (
            deque()
        )  # in the order in which they came to that; not used where they are ordered
        self._on_rest: list[Callable[[], None]] = []

    def __len__(self) -> int:
        return len(self._under_way)

    def __iter__(self) -> Iterator[ConcurrentFiring[NodeT]]:
        return iter(list(self._under_way))

    @property
    def full(self) -> bool:
        """Whether no other firing may begin."""
        return len(self._under_way) >= self.limit or self.ending is not None

    @property
    def unfinished(self) -> bool:
        """Whether code of one of them goes on, or is to be tried again."""
        return any(not firing.outcome for firing in self._under_way)

    @property
    def working(self) -> int:
        """Of how many the code waits or runs in a thread."""
        return sum(firing.working for firing in self._under_way)

    def begin(self, firing: ConcurrentFiring[NodeT]) -> None:
        """One more is under way."""
        self._under_way[firing] = None
        self.most = max(self.most, len(self._under_way))

    def over(self, firing: ConcurrentFiring[NodeT]) -> None:
        """One of them has come to its end."""
        if not self.ordered:
            self._over.append(firing)

    def next_to_leave(self, *, to_nobody: bool) -> ConcurrentFiring[NodeT] | None:
        """Whose turn it is to send what it has, if there is one; what goes to nobody waits for no turn (F10)."""
        if to_nobody:
            return next((firing for firing in self._under_way if firing.outcome), None)
        if not self.ordered:
            return self._over[0] if self._over else None
        first = next(iter(self._under_way), None)
        return first if first is not None and first.outcome else None

    def leave(self, firing: ConcurrentFiring[NodeT]) -> None:
        """It has sent what it had."""
        del self._under_way[firing]
        if not self.ordered:
            self._over.remove(firing)

    def begin_leaving(self, leaving: bool) -> None:
        """Who sends now, and by that frees its outputs, goes on with the next by itself."""
        self.leaving = leaving

    def forget(self, firing: ConcurrentFiring[NodeT]) -> None:
        """It has nothing to send: a source has found its end."""
        del self._under_way[firing]

    def end(self, number: int, stamp: float, written: list[Any] | None = None) -> None:
        """The node ends behind those that are under way, by the firing of this number and stamp, and has written so."""
        self.end_number = number
        self.ending = stamp
        self.end_written = written

    def take_ending(self) -> float:
        """All others have left: it ends now."""
        ending, self.ending = self.ending, None
        assert ending is not None
        return ending

    def begin_afresh(self) -> None:
        """The node has not ended (F10, A9)."""
        self.ending = None

    def when_rested(self, callback: Callable[[], None]) -> None:
        """Call back when no code of them goes on."""
        self._on_rest.append(callback)

    def run_idle_callbacks(self) -> None:
        """Those who wait until no code goes on have their turn."""
        if self._on_rest and not self.unfinished:
            waiting, self._on_rest = self._on_rest, []
            for callback in waiting:
                callback()

    def lend(self) -> object:
        """A carrier that is free, or None."""
        return self.idle.pop() if self.idle else None

    def give_back(self, eager_task: object) -> None:
        """No code goes on in it."""
        self.idle.append(eager_task)

    def eager_tasks(self) -> list[Any]:
        """All of them, of firings that wait too."""
        return [*self.idle, *(firing.eager_task for firing in self._under_way if firing.eager_task is not None)]

    def drop_eager_tasks(self) -> None:
        """No code of the node as it was goes on."""
        idle, self.idle = self.idle, []
        for eager_task in idle:
            eager_task.drop()

    def check_invariants(self, path: str) -> None:
        """Between two steps of the run certain things hold of them.

        Raises:
          EngineInternalError: one of them does not.
        """
        over = [firing for firing in self._under_way if firing.outcome]
        for holds, relation in (
            (len(self._under_way) <= self.limit, f"more than {self.limit} of its firings are under way (F14)"),
            (self.ordered or set(over) == set(self._over), "a firing that is over does not stand where it leaves"),
            (not any(firing.working for firing in over), "a firing is over, but its code goes on"),
            (not self.leaving, "a firing is leaving between two steps"),
        ):
            if not holds:
                raise EngineInternalError(f'node "{path}": {relation}')
