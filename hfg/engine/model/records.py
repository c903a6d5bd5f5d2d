"""Parts of the state of one running node, each with its transitions and invariants.

The parts depend on each other only where a docstring says so. `RunningNode` owns them. Hot paths read them directly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final, Generic

from hfg.engine.model.contracts import EagerTask, NodeT, Timer
from hfg.engine.model.jobs import Job
from hfg.errors import EngineInternalError

__all__ = ["SAME_MOMENT_S", "Counts", "Ending", "Execution", "Lifecycle", "Rate", "Record", "Room"]

SAME_MOMENT_S: Final = 1e-9
"""Times that differ by less are one moment: sums of floats differ by so little."""


class Record:
    """A part of the state of a node, with relations that hold between two steps of the run."""

    __slots__ = ()

    def relations(self) -> Iterable[tuple[bool, str]]:
        """Yield each relation: whether it holds, and what is wrong if it does not."""
        return ()

    def check_invariants(self, path: str) -> None:
        """Check all relations of the node with this path.

        Raises:
          EngineInternalError: one of them does not hold.
        """
        for holds, relation in self.relations():
            if not holds:
                raise EngineInternalError(f'node "{path}": {relation}')


@dataclass(slots=True, eq=False)
class Counts(Record):
    """How often a node has done what since its run started: the source of report, statistics and glance.

    The counts only grow. A fused region adds many at once.
    """

    firings: int = 0  # all of them, including silent ones and the last one
    silent: int = 0  # without a call of the function (F4)
    end_firings: int = 0  # those with which the node ended
    calls: int = 0  # slot calls
    failed_firings: int = 0  # hooks included
    failed_calls: int = 0
    retries: int = 0  # attempts after the first (X1)
    restarts: int = 0  # by `on_error="restart"` (X1)

    @property
    def processed(self) -> int:
        """Firings in which the node's function ran."""
        return self.firings - self.silent - self.end_firings

    @property
    def failed(self) -> int:
        """Failed firings and calls."""
        return self.failed_firings + self.failed_calls

    @property
    def done(self) -> int:
        """Firings and calls."""
        return self.firings + self.calls

    def add_firings(self, times: int, silently: int = 0) -> None:
        """Add firings, some of which were silent."""
        self.firings += times
        self.silent += silently

    def add_calls(self, times: int) -> None:
        """Add slot calls."""
        self.calls += times

    def add_silent(self) -> None:
        """The current firing, which is counted already, is silent."""
        self.silent += 1

    def add_end_firing(self) -> None:
        """The current firing, which is counted already, is the one with which the node ends."""
        self.end_firings += 1

    def add_failure(self, *, of_call: bool = False) -> None:
        """Its code has failed, in a slot call or elsewhere (X1)."""
        if of_call:
            self.failed_calls += 1
        else:
            self.failed_firings += 1

    def add_retry(self) -> None:
        """A firing that has failed is tried again (X1)."""
        self.retries += 1

    def add_restart(self) -> None:
        """The node is torn down, and set up after a pause (X1)."""
        self.restarts += 1

    def relations(self) -> Iterator[tuple[bool, str]]:
        """See `Record`."""
        yield self.processed >= 0 and self.failed_calls <= self.calls, "some of its counts exceed their total"


@dataclass(slots=True, eq=False)
class Rate:
    """When the next firing of a node may start: by its own rate (F11) or by that of a throttling gate (A11)."""

    next_start: float = 0.0  # by its own rate
    gate_next: float = float("-inf")  # when its last firing started, for a gate; -inf: the next may start at once
    timer: Timer | None = None  # runs while a rate prevents a firing
    _grid_start: float | None = None  # when the first firing with a rate started
    _next_period: int = 0  # of that grid: the first in which a firing may start

    def start(self, now: float, rate_hz: float) -> None:
        """A firing starts; the next one may start in the next period of the grid that the first one started (F11).

        Each place on the grid is computed from the start of the grid, so that rounding errors never add up.
        """
        if self._grid_start is None:
            self._grid_start = now
        period = int((now - self._grid_start + SAME_MOMENT_S) * rate_hz)
        self._next_period = max(self._next_period, period) + 1  # (a clock as large as the date has fewer digits)
        self.next_start = self._grid_start + self._next_period / rate_hz

    def start_gated(self, now: float) -> None:
        """An idle rate counts from now (A11); minus infinity: from the next firing."""
        self.gate_next = now

    def wait(self, timer: Timer) -> None:
        """Nothing starts before this timer."""
        assert self.timer is None, "a node waits for one start at a time"
        self.timer = timer

    def end_wait(self) -> None:
        """The timer is over, or not needed any more."""
        if self.timer is not None:
            self.timer.cancel()
            self.timer = None


@dataclass(slots=True, eq=False)
class Room(Generic[NodeT]):
    """Back-pressure of events (F8): which queues block a node, which of its code waits for room, and who watches it."""

    _node: NodeT
    full_edges: int = 0  # `wait` queues of its events that are full
    waiting: int = 0  # how much of its code awaits `trigger_wait`
    _waiters: list[Callable[[], None]] = field(default_factory=list)  # called when there is room
    _watchers: dict[NodeT, None] = field(default_factory=dict)  # blocked, but in no ring while this node works

    def fill(self) -> None:
        """One more queue is full, which may have closed a ring of nodes that wait for each other."""
        core = self._node.core
        self.full_edges += 1
        core.full_edges += 1
        core.suspects[self._node] = None

    def free(self) -> bool:
        """One queue is no longer full. Return whether none is; code that waits for room then continues."""
        assert self.full_edges > 0, "a queue is free that was not full"
        self.full_edges -= 1
        self._node.core.full_edges -= 1
        if self.full_edges:
            return False
        self.notify_watchers()
        self.notify_waiters()
        return True

    def when_free(self, waiter: Callable[[], None]) -> None:
        """Call back when no queue is full."""
        self._waiters.append(waiter)

    def notify_waiters(self) -> None:
        """Let code continue that waits for room: there is some, or the run is over."""
        waiters, self._waiters = self._waiters, []
        for waiter in waiters:
            waiter()

    def wait(self, how_many: int) -> None:
        """Change how much of the node's code awaits `trigger_wait`."""
        core = self._node.core
        self.waiting += how_many
        core.waiting_room += how_many
        assert self.waiting >= 0, "code of the node that did not wait for room waits no more"
        core.suspects[self._node] = None
        self.notify_watchers()

    def be_watched_by(self, held: NodeT) -> None:
        """A node that a full queue blocks is in no ring while code of this node continues, or its timer runs."""
        self._watchers[held] = None

    def notify_watchers(self) -> None:
        """That is over, so the rings of these nodes are checked again."""
        if self._watchers:
            self._node.core.suspects.update(self._watchers)
            self._watchers = {}


@dataclass(slots=True, eq=False)
class Lifecycle(Record):
    """Whether a node is set up (X3): a teardown follows each setup before the next one."""

    is_up: bool = False  # its setup has started, its teardown has not
    opening: bool = False  # its setup is in progress
    backoff_timer: Timer | None = None  # the pause of a restart (X1)
    early: list[Callable[[], None]] | None = None  # its signals before it takes part (R4, F10); None once it does
    waiters: list[Callable[[], None]] = field(default_factory=list)  # its code that waits until it takes part

    def open(self) -> None:
        """Its setup starts; a teardown follows even if it fails."""
        self.is_up = self.opening = True

    def opened(self) -> None:
        """Its setup has ended, successfully or not."""
        self.opening = False

    def close(self) -> None:
        """Its teardown starts."""
        assert self.is_up, "a node is torn down that was not set up"
        self.is_up = False

    def wait_to_take_part(self) -> None:
        """It is set up ahead: its signals are kept until it takes part, because its events have no edges yet."""
        self.early = []

    def when_taking_part(self, waiter: Callable[[], None]) -> None:
        """Call back when its signals leave at once."""
        self.waiters.append(waiter)

    def take_part(self) -> list[Callable[[], None]]:
        """From here on its signals leave at once; return the calls that have waited until now, in order."""
        kept = [*(self.early or ()), *self.waiters]
        self.early, self.waiters = None, []
        return kept

    def rest(self, timer: Timer) -> None:
        """It is set up again when this timer is over (X1)."""
        self.backoff_timer = timer

    def end_rest(self) -> None:
        """The pause is over, or nothing follows it any more."""
        timer, self.backoff_timer = self.backoff_timer, None
        if timer is not None:
            timer.cancel()

    def relations(self) -> Iterator[tuple[bool, str]]:
        """See `Record`."""
        yield self.is_up or not self.opening, "its setup is in progress, though its teardown has started (X1)"


@dataclass(slots=True, eq=False)
class Ending(Record):
    """The end of a node, from its last firing until it starts over (F4, F12, T5)."""

    is_dead_source: bool  # it counts as ended without having sent END, and never will (R5)
    pending: bool = False  # END leaves as soon as the outputs are free
    stamp: float | None = None  # of END
    deferred: list[int] | None = field(default_factory=list)  # drained modifiers that act after END; None from then on

    def promise(self, stamp: float | None) -> None:
        """END follows when the outputs are free."""
        assert not self.is_dead_source, "END of a node that has no receiver any more (R5)"
        self.pending = True
        self.stamp = stamp

    def stop_pending(self) -> float | None:
        """END is sent now, or never because the node is gone. Return its stamp (T5)."""
        self.pending = False
        return self.stamp

    def defer(self, modifier: int) -> None:
        """A drained modifier acts after END (F12)."""
        assert self.deferred is not None, "END has been sent: drained modifiers act at once"
        self.deferred.append(modifier)

    @property
    def brings_activity(self) -> bool:
        """Whether a drained +1 has yet to act (G2)."""
        return self.deferred is not None and 1 in self.deferred

    def strip(self) -> None:
        """Drained modifiers bring no activity any more (A14)."""
        if self.deferred:
            self.deferred = [0] * len(self.deferred)

    def take_deferred(self) -> list[int]:
        """END has been sent, or never will be: return the drained modifiers, which act now."""
        deferred, self.deferred = self.deferred, None
        return deferred or []

    def relations(self) -> Iterator[tuple[bool, str]]:
        """See `Record`."""
        yield not (self.pending and self.is_dead_source), "END is to follow, though it is a dead source (R5)"


@dataclass(slots=True, eq=False)
class Execution(Record):
    """The code of one node that is in progress, except for concurrent firings (F14) and tasks."""

    in_flight: bool = False  # it waits on the loop, or is in a thread
    job: Job[Any] | None = None  # what a thread does for it, perhaps together with others of its region
    eager_task: EagerTask | None = None  # runs its coroutines; None: made for the next one
    generator: Any = None  # a source takes its values from it; None: it has ended, or starts at the next firing
    limit_timer: Timer | None = None  # X2: of the firing
    taken: dict[str, Any] | None = None  # values that the firing took, if the event `failed` carries them (X1)

    def run_in(self, eager_task: EagerTask | None) -> None:
        """Run its coroutines in this task from now on; None: code in the previous one continues without the node."""
        self.eager_task = eager_task

    def exchange(self, other: Execution) -> None:
        """Swap the tasks of two nodes, because code of this one runs in the task of the other."""
        mine, self.eager_task = self.eager_task, other.eager_task
        other.run_in(mine)

    def take_job(self, job: Job[Any] | None) -> None:
        """A thread works for it, or does no longer."""
        self.job = job

    def draw_from(self, generator: object) -> None:
        """Take the next values from this generator."""
        self.generator = generator

    def close_generator(self) -> object:
        """Take no more values. Return what they came from."""
        generator, self.generator = self.generator, None
        return generator

    def limit(self, timer: Timer) -> None:
        """Start the time limit of the firing (X2)."""
        assert self.limit_timer is None, "one firing has one limit"
        self.limit_timer = timer

    def end_limit(self) -> None:
        """The firing has ended, in time or not."""
        timer, self.limit_timer = self.limit_timer, None
        if timer is not None:
            timer.cancel()

    def remember(self, taken: dict[str, Any]) -> None:
        """The firing has taken these values."""
        self.taken = taken

    def recall(self) -> dict[str, Any]:
        """Return the values that the firing took; it has ended and forgets them."""
        taken, self.taken = self.taken, None
        return taken or {}

    def relations(self) -> Iterator[tuple[bool, str]]:
        """See `Record`."""
        yield (
            self.limit_timer is None or self.in_flight,
            "its firing has a limit, but none of its code is in progress (X2)",
        )
