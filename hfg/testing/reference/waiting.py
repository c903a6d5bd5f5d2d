"""A tiny event loop that a machine can turn by hand.

Async node code runs in it one step at a time, in the machine's own time.

Each firing or call that waits has an owner; its steps and timers are kept apart, so that the machine's owner decides
which coroutine runs next. Only what `asyncio.sleep`, futures, tasks and `asyncio.timeout` need is there: no sockets, no
threads, no signals.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Iterator, Set
from contextlib import contextmanager
from contextvars import Context, ContextVar, copy_context
from types import CoroutineType
from typing import Any, Final
from weakref import WeakSet

MOMENT_S: Final = 1e-9
"""Sums of floats that differ by less are the same moment."""

TEARDOWN_LIMIT_S: Final = 5.0
"""How long code may take to end once it is cancelled, and each teardown (X3)."""

_OWNER: Final[ContextVar[object]] = ContextVar("hfg.testing.owner", default=None)


class HandTurnedLoop(asyncio.AbstractEventLoop):
    """Runs callbacks when told to, never by itself; `now` is asked for the time."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._ready: list[tuple[object, asyncio.Handle]] = []
        self._timers: list[tuple[object, asyncio.TimerHandle]] = []
        self._tasks: WeakSet[asyncio.Task[Any]] = WeakSet()

    # --- what asyncio asks of a loop

    def time(self) -> float:
        """Return the machine's time."""
        return self._now()

    def get_debug(self) -> bool:
        """Tell asyncio not to look closer."""
        return False

    def is_running(self) -> bool:
        """Say yes: code that asks is being run."""
        return True

    def is_closed(self) -> bool:
        """Say no: the loop lives as long as its machine."""
        return False

    def create_future(self) -> asyncio.Future[Any]:
        """Make a future that wakes its waiter through this loop."""
        return asyncio.Future(loop=self)

    def create_task(
        self, coro: Any, *, name: Any = None, context: Context | None = None, **_: Any
    ) -> asyncio.Task[Any]:
        """Make a task; its first step is one of the owner's next steps."""
        task = asyncio.Task(coro, loop=self, name=name, context=context)
        self._tasks.add(task)
        return task

    def call_soon(  # type: ignore[override]
        self, callback: Any, *args: Any, context: Context | None = None
    ) -> asyncio.Handle:
        """Add a step to those that the owner may do next."""
        handle = asyncio.Handle(callback, args, self, context)
        self._ready.append((_owner_of(context), handle))
        return handle

    def call_later(  # type: ignore[override]
        self, delay: float, callback: Any, *args: Any, context: Context | None = None
    ) -> asyncio.TimerHandle:
        """Add a step for later."""
        return self.call_at(self._now() + delay, callback, *args, context=context)

    def call_at(  # type: ignore[override]
        self, when: float, callback: Any, *args: Any, context: Context | None = None
    ) -> asyncio.TimerHandle:
        """Add a step for a moment of the machine's time."""
        timer = asyncio.TimerHandle(when, callback, args, self, context)
        self._timers.append((_owner_of(context), timer))
        return timer

    def run_in_executor(  # type: ignore[override]
        self, executor: Any, func: Callable[..., Any], *args: Any
    ) -> asyncio.Future[Any]:
        """Do at once what a thread would do: no time passes here while it works."""
        done = self.create_future()
        try:
            done.set_result(func(*args))
        except Exception as error:
            done.set_exception(error)
        return done

    def _timer_handle_cancelled(self, handle: asyncio.TimerHandle) -> None:
        """Nothing is counted: cancelled timers are skipped."""

    def call_exception_handler(self, context: dict[str, Any]) -> None:
        """Say nothing: a coroutine that is discarded at the end of a run is not an error."""

    # --- what the machine does with it

    def start(self, owner: object, coroutine: Coroutine[Any, Any, Any]) -> asyncio.Task[Any]:
        """Make a task for `owner`; nothing of it runs yet."""
        context = copy_context()
        context.run(_OWNER.set, owner)
        return self.create_task(coroutine, context=context)

    def can_step(self, owner: object) -> bool:
        """Return whether something of `owner` can go on now."""
        return any(one is owner and not handle.cancelled() for one, handle in self._ready)

    def owners_in_turn(self) -> list[object]:
        """Return those of whom something can go on now, in the order in which it could."""
        return [owner for owner, handle in self._ready if not handle.cancelled()]

    def step(self, owner: object) -> bool:
        """Run the first waiting step of `owner`; False if there was none."""
        for index, (one, handle) in enumerate(self._ready):
            if one is owner and not handle.cancelled():
                del self._ready[index]
                with self.entered():
                    handle._run()
                return True
        return False

    def next_time(self, without: Set[int] = frozenset()) -> float | None:
        """The moment of the next timer, or None; owners in `without` (by `id`) are left out."""
        waiting = [timer for owner, timer in self._timers if not timer.cancelled() and id(owner) not in without]
        return min((timer.when() for timer in waiting), default=None)

    def next_time_of(self, owner: object) -> float | None:
        """The moment of the next timer of `owner`, or None."""
        waiting = [timer for one, timer in self._timers if one is owner and not timer.cancelled()]
        return min((timer.when() for timer in waiting), default=None)

    def ring(self) -> None:
        """Make the timers whose moment has come into steps of their owners, in order of time."""
        due = [entry for entry in self._timers if entry[1].when() <= self._now() + MOMENT_S]
        self._timers = [entry for entry in self._timers if entry not in due]
        self._ready.extend((owner, timer) for owner, timer in sorted(due, key=lambda entry: round(entry[1].when(), 9)))

    def forget(self, owner: object) -> None:
        """Throw away what `owner` still has to do."""
        self._ready = [entry for entry in self._ready if entry[0] is not owner]
        self._timers = [entry for entry in self._timers if entry[0] is not owner]

    def close_tasks(self) -> None:
        """Close the code of all tasks that are not done, some of which may not have begun."""
        for task in list(self._tasks):
            coroutine = task.get_coro()
            if not task.done() and isinstance(coroutine, CoroutineType):
                coroutine.close()

    @contextmanager
    def entered(self) -> Iterator[None]:
        """Be the running loop for a moment, also inside another one."""
        outside = asyncio._get_running_loop()
        asyncio._set_running_loop(None)
        asyncio._set_running_loop(self)
        try:
            yield
        finally:
            asyncio._set_running_loop(outside)


def hand_turned_loop(now: Callable[[], float]) -> HandTurnedLoop:
    """Make a loop whose time is what `now` says."""
    return HandTurnedLoop(now)  # type: ignore[abstract]  # all the rest of a loop stays unimplemented


def _owner_of(context: Context | None) -> object:
    return _OWNER.get() if context is None else context.get(_OWNER)
