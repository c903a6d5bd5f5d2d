"""Virtual time: an event loop whose clock jumps to the next timer when nothing is ready (rule R6).

It counts whole nanoseconds, so that sums of floats that mean one moment are one. Timers of one moment ring in the order
in which they were set.

Nodes that call plain `asyncio.sleep` are covered without knowing it. Work in threads would make the loop look idle,
so whoever starts some holds the clock until it is back; `run_in_executor` (and so `asyncio.to_thread`) does by itself.
"""

from __future__ import annotations

import asyncio
import heapq
import itertools
import math
import selectors
import time
from collections import deque
from collections.abc import Callable
from contextvars import Context, copy_context
from typing import Any

from hfg.base.clock import current_clock

__all__ = ["TimeHold", "VirtualTimeLoop"]

_RESOLUTION_S = 1e-9
_DIGITS = 9  # of a second: time is counted in nanoseconds
_POLL_EVERY = 64  # jumps without a look at real sockets and signals


class TimeHold:
    """Work in flight outside the loop, for which virtual time stands still.

    Attributes:
      deliver: brings its result in; None while it is not back.
      give_up: called if it is not back at `give_up_at`, on the machine's own monotonic clock.
    """

    __slots__ = ("deliver", "give_up", "give_up_at")

    def __init__(self) -> None:
        self.deliver: Callable[[], None] | None = None
        self.give_up: Callable[[], None] | None = None
        self.give_up_at: float | None = None

    def limit(self, seconds: float, give_up: Callable[[], None]) -> None:
        """Call `give_up` if it is not back after that many real seconds."""
        self.give_up = give_up
        self.give_up_at = time.monotonic() + seconds


class _JumpingSelector(selectors.DefaultSelector):
    """Instead of waiting until the next timer, moves the clock to it."""

    loop: VirtualTimeLoop
    _skipped = 0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        self._skipped += 1
        look = self._skipped >= _POLL_EVERY or len(self.get_map()) > 1
        if look:
            self._skipped = 0
        if timeout is not None and timeout <= 0:
            return super().select(0) if look else []
        loop = self.loop
        if loop._held:
            return self._wait_for_work(loop)
        if timeout is None or loop._executor_jobs:
            return super().select(None)
        if look and (ready := super().select(0)):
            return ready
        loop._jump(timeout)
        return []

    def _wait_for_work(self, loop: VirtualTimeLoop) -> list[tuple[selectors.SelectorKey, int]]:
        """Nothing else can happen now, so work that is back comes in: in the order it was begun.

        Whichever was faster.
        """
        held = loop._held
        first = held[0]
        if first.deliver is not None:
            held.popleft()
            loop.call_soon(first.deliver)
            return []
        limits = [one.give_up_at for one in held if one.give_up_at is not None and one.deliver is None]
        ready = super().select(max(0.0, min(limits) - time.monotonic()) if limits else None)
        if limits and min(limits) <= time.monotonic():
            for one in [one for one in held if one.give_up_at is not None and one.give_up_at <= time.monotonic()]:
                if one.deliver is None and one.give_up is not None:
                    one.give_up_at = None
                    loop.call_soon(one.give_up)
        return ready


class _Timer(asyncio.TimerHandle):
    """Fires after earlier timers of the same moment; asyncio's heap does not keep their order."""

    def __init__(self, number: int, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._key = (self.when(), number)

    def __lt__(self, other: Any) -> bool:
        is_earlier: bool = self._key < other._key
        return is_earlier


class VirtualTimeLoop(asyncio.SelectorEventLoop):
    """An asyncio event loop in virtual time; `time()` begins at 0.

    Attributes:
      watchers: called with the seconds when time has passed, before anything that is due then.

    Examples:
      >>> async def main() -> float:
      ...     await asyncio.sleep(3600)
      ...     return asyncio.get_running_loop().time()
      >>> with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
      ...     runner.run(main())
      3600.0
    """

    def __init__(self) -> None:
        self._virtual_now = 0.0
        self._timer_numbers = itertools.count()
        self._held: deque[TimeHold] = deque()  # the engine's work in threads, in order of its beginning
        self._executor_jobs = 0
        self.watchers: list[Callable[[float], None]] = []
        selector = _JumpingSelector()
        selector.loop = self
        super().__init__(selector)
        self._clock_resolution = _RESOLUTION_S

    def time(self) -> float:
        """Virtual seconds since the loop was made."""
        return self._virtual_now

    def call_at(  # type: ignore[override]  # typeshed's type variable tuple says no more
        self, when: float, callback: Callable[..., object], *args: Any, context: Context | None = None
    ) -> asyncio.TimerHandle:
        """As asyncio's, to the nanosecond; of one moment, in the order of the calls."""
        self._check_closed()  # type: ignore[attr-defined]
        if self.get_debug():
            self._check_thread()  # type: ignore[attr-defined]
        moment = round(when, _DIGITS)
        now = self._virtual_now
        if moment <= now < when:
            # Who asks again for a moment that has come by our count, but not by sums of floats of its own, as anyio's
            # scopes with a deadline do, would ask forever: time is to go on. What is due within the clock's resolution
            # asyncio calls at once, so the smallest step is behind that.
            moment = max(round(now + 2 * _RESOLUTION_S, _DIGITS), now + 2 * math.ulp(now), when)
        timer = _Timer(next(self._timer_numbers), moment, callback, args, self, context)
        heapq.heappush(self._scheduled, timer)  # type: ignore[attr-defined]
        timer._scheduled = True  # type: ignore[attr-defined]  # as asyncio's own `call_at`: counts it when cancelled
        return timer

    def create_task(self, coro: Any, *, context: Context | None = None, **options: Any) -> asyncio.Task[Any]:
        """As asyncio's; `hfg.now()` is this loop's time in every task that belongs to no run."""
        context = copy_context() if context is None else context
        if current_clock not in context:
            context.run(current_clock.set, self.time)
        return super().create_task(coro, context=context, **options)

    def spend(self, seconds: float) -> None:
        """Let time pass at once, as code that computes would: what is due meanwhile comes late.

        For trying a graph under load; by itself code takes no virtual time.

        Raises:
          ValueError: time does not go back.
        """
        if not seconds >= 0:
            raise ValueError(f"time goes forward: spend() takes seconds from 0 on, got {seconds!r}")
        self._virtual_now = round(self._virtual_now + seconds, _DIGITS)

    def hold(self) -> TimeHold:
        """Let the clock stand still until this work is back (`deliver` set, on the loop) or dropped.

        Results come in when nothing else is ready, and in the order in which the work was begun: so a run in virtual
        time is the same each time, however the threads race.
        """
        held = TimeHold()
        self._held.append(held)
        return held

    def drop(self, held: TimeHold) -> None:
        """No caller waits for this work any more."""
        if held in self._held:
            self._held.remove(held)

    def run_in_executor(self, executor: Any, func: Callable[..., Any], *args: Any) -> Any:  # type: ignore[override]
        """As asyncio's, but the clock waits for it."""
        future = super().run_in_executor(executor, func, *args)
        self._executor_jobs += 1
        future.add_done_callback(self._executor_done)
        return future

    def _executor_done(self, _future: object) -> None:
        self._executor_jobs -= 1

    async def shutdown_default_executor(self, timeout: float | None = None) -> None:  # noqa: ASYNC109
        """As asyncio's, but the clock waits for the executor's threads."""
        self._executor_jobs += 1
        try:
            await super().shutdown_default_executor()
        finally:
            self._executor_jobs -= 1

    def _jump(self, timeout: float) -> None:
        before = self._virtual_now
        scheduled = self._scheduled  # type: ignore[attr-defined]
        if scheduled:
            self._virtual_now = max(self._virtual_now, scheduled[0].when())
        else:
            self._virtual_now += timeout
        self._clock_resolution = max(_RESOLUTION_S, math.ulp(self._virtual_now))  # after months, floats are not finer
        for watcher in self.watchers:
            watcher(self._virtual_now - before)
