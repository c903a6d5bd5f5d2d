"""Listeners of a run (rule R7): consumers of the trace, called directly or through their own buffer.

A plain function is called with each event as it happens, on the loop: it loses nothing and its time is the graph's.
One that is slow goes behind a buffer, a plain one on a thread of its own, an async one in a task: it loses its own
oldest events, counted, and the graph does not wait. Depends on `trace`.
"""

from __future__ import annotations

import asyncio
import inspect
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import anyio

from hfg.base.logs import Log
from hfg.engine.fusion.specialise import specialise
from hfg.engine.runtime.engine import Engine
from hfg.errors import UsageError
from hfg.trace import TraceEvent

__all__ = ["Consumers", "Listener", "check_consumer"]

_LOGGER = Log("hfg.engine")
_BUFFER = 10_000  # events, for an async consumer that does not say
_LAST_S = 1.0  # how long those with a buffer may continue when the run is over
_CANCELLED_S = 0.3  # and after they were cancelled

Take = Callable[[TraceEvent], Any]
Sieve = Callable[[TraceEvent], bool]


def check_consumer(consumer: Any) -> None:
    """Refuse what can take no events.

    Raises:
      UsageError: it is neither callable nor a list or deque, to which events are appended.
    """
    if not callable(consumer) and not isinstance(consumer, list | deque):
        raise UsageError(
            f"trace must be a function that takes each event of the run, or a list to append them to, got {consumer!r}"
        )


class Listener:
    """One consumer of a run's trace. Calling it removes the consumer, as `remove` does.

    Attributes:
      consumer: what was given.
      error: what it raised, for which it was removed; None else.
      changes_only: it wants no events of single tokens, firings and calls, so that nobody leaves his fast path for it.
    """

    def __init__(self, consumer: Any, consumers: Consumers, *, changes_only: bool = False) -> None:
        self.consumer = consumer
        self.changes_only = changes_only
        self.error: BaseException | None = None
        self._consumers = consumers
        self._open = True
        # The append of a list fails for want of memory only: no guard, and so a recorder costs half.
        self.take: Take = consumer.append if isinstance(consumer, list | deque) else self._guarded

    @property
    def lost(self) -> int:
        """Events that it will never see, because its buffer was full; 0 without a buffer."""
        return 0

    def remove(self) -> None:
        """Let it see nothing more. Does nothing the second time."""
        if self._open:
            self._open = False
            self._consumers.changed()

    __call__ = remove

    @property
    def is_open(self) -> bool:
        """Whether it still takes events."""
        return self._open

    def _guarded(self, event: TraceEvent) -> None:
        if self._open:
            try:
                self.consumer(event)
            except (Exception, asyncio.CancelledError) as error:  # of something of its own: nobody cancels a function
                self.failed(error)

    def failed(self, error: BaseException) -> None:
        """It raised: it is logged and removed, and the run continues (R7)."""
        self.error = error
        _LOGGER.error("a consumer of the trace failed and was removed", exc_info=error)
        self.remove()

    async def end(self) -> None:
        """The run is over."""


class _Buffered(Listener):
    """A consumer with a bounded buffer: when it is too slow, the oldest events are dropped."""

    def __init__(self, consumer: Any, consumers: Consumers, size: int) -> None:
        super().__init__(consumer, consumers)
        self.kept: deque[TraceEvent] = deque(maxlen=size)
        self.taken = 0  # only the consumer writes it, and only the run writes `put`: no lock is needed
        self.put = 0
        self.idle = True
        self.ended = False
        self.take = self._put

    @property
    def lost(self) -> int:
        """See `Listener`."""
        return self.put - self.taken - len(self.kept)

    def _put(self, event: TraceEvent) -> None:
        self.put += 1
        self.kept.append(event)
        if self.idle:
            self.idle = False
            self.wake()

    def wake(self) -> None:
        """Something lies in the buffer, or the run is over."""

    def remove(self) -> None:
        """Let it see nothing more, not even what lies in its buffer."""
        super().remove()
        self.ended = True
        self.wake()

    __call__ = remove


class _InTask(_Buffered):
    """An async consumer, in a task of its own."""

    def __init__(self, consumer: Any, consumers: Consumers, size: int, engine: Engine) -> None:
        super().__init__(consumer, consumers, size)
        self._something = asyncio.Event()
        self._ending = False
        self._task = engine.loop.create_task(self._live(), name="hfg consumer", context=engine.context.copy())

    def wake(self) -> None:
        self._something.set()

    async def _live(self) -> None:
        while self.kept or not self.ended:
            while self.kept and self._open:
                event = self.kept.popleft()
                self.taken += 1
                try:
                    await self.consumer(event)
                except asyncio.CancelledError as error:
                    if self._ending:
                        return
                    self.failed(error)  # of something of its own
                except Exception as error:
                    self.failed(error)
            if not self._open:
                return
            self.idle = True
            self._something.clear()
            if not self.ended:
                await self._something.wait()

    async def end(self) -> None:
        self.ended = True
        self.wake()
        await asyncio.wait({self._task}, timeout=_LAST_S if self._open else 0)
        self._ending = True
        self._task.cancel()
        await asyncio.wait({self._task}, timeout=_CANCELLED_S)
        if not self._task.done():
            _LOGGER.error("a consumer of the trace was cancelled at the end of the run and did not end; it was left")
        self._open = False


class _InThread(_Buffered):
    """A plain consumer that may block, on a thread of its own."""

    def __init__(self, consumer: Any, consumers: Consumers, size: int, engine: Engine) -> None:
        super().__init__(consumer, consumers, size)
        self._something = threading.Event()
        self._loop = engine.loop
        self._thread = threading.Thread(target=self._live, name="hfg consumer", daemon=True)
        self._thread.start()

    def wake(self) -> None:
        self._something.set()

    def _live(self) -> None:
        while True:
            self._something.wait()
            self._something.clear()
            while self._open:
                try:
                    event = self.kept.popleft()
                except IndexError:
                    break
                self.taken += 1
                try:
                    self.consumer(event)
                except BaseException as error:  # whatever it is, nobody else hears of it
                    self._open = False
                    self._loop.call_soon_threadsafe(self._has_failed, error)
                    return
            self.idle = True
            if self.kept:  # put while we were about to rest
                self._something.set()
            elif self.ended:
                return

    def _has_failed(self, error: BaseException) -> None:
        self._open = True
        self.failed(error)

    async def end(self) -> None:
        self.ended = True
        self.wake()
        until = time.monotonic() + _LAST_S
        while self._thread.is_alive() and time.monotonic() < until:
            await asyncio.sleep(0)
            self._thread.join(0.001)
        self._open = False


class Consumers:
    """All consumers of one run's trace."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._sieve: Sieve | None = None
        self._listeners: list[Listener] = []

    @property
    def listeners(self) -> list[Listener]:
        """Those who listen."""
        return list(self._listeners)

    def leave_out(self, sieve: Sieve) -> None:
        """From now on tell only what this holds for: of an edge to another part each side tells what is its own."""
        self._sieve = sieve
        self.changed()

    def add(self, consumer: Any, size: int | None = None, *, changes_only: bool = False) -> Listener:
        """Let a consumer see every event from now on, or those that have to do with no single token or firing.

        Raises:
          UsageError: it cannot take events, or its buffer has no place.
        """
        check_consumer(consumer)
        if size is not None and (type(size) is not int or size < 1):
            raise UsageError(f"size is how many events the consumer's buffer holds, 1 or more, got {size!r}")
        listener: Listener
        if inspect.iscoroutinefunction(consumer) or inspect.iscoroutinefunction(getattr(consumer, "__call__", None)):  # noqa: B004
            listener = _InTask(consumer, self, size or _BUFFER, self._engine)
        elif size is not None:
            listener = _InThread(consumer, self, size, self._engine)
        else:
            listener = Listener(consumer, self)
        listener.changes_only = changes_only
        self.join(listener)
        return listener

    def join(self, listener: Listener) -> None:
        """It is among those who listen from now on."""
        self._listeners.append(listener)
        self.changed()

    def changed(self) -> None:
        """One came or went. Build nothing for none, call a single one directly, and several one after the other."""
        self._listeners = [listener for listener in self._listeners if listener.is_open]
        core = self._engine.core
        core.trace_changes = _all_of([listener.take for listener in self._listeners])
        before = core.trace
        core.trace = _all_of([listener.take for listener in self._listeners if not listener.changes_only])
        if self._sieve is not None and core.trace is not None:
            core.trace = _sieved(self._sieve, core.trace)
        if core.trace is before:
            return
        core.running_node = None
        if core.started:
            for worker in core.workers:
                specialise(worker)

    async def end(self) -> None:
        """The run is over: those with a buffer take the rest of it, all together within a second."""
        async with anyio.create_task_group() as ending:
            for listener in list(self._listeners):
                ending.start_soon(listener.end)


def _sieved(sieve: Sieve, take: Take) -> Take:
    """Return a function that passes on only some events."""

    def tell(event: TraceEvent) -> None:
        if sieve(event):
            take(event)

    return tell


def _all_of(takes: Sequence[Take]) -> Take | None:
    """Return a function that passes an event to each of them."""
    if len(takes) < 2:
        return takes[0] if takes else None

    def tell(event: TraceEvent) -> None:
        for take in takes:
            take(event)

    return tell
