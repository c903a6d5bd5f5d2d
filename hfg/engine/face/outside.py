"""How code outside a graph brings tokens in and takes them out (rules P10, F8): feeds, readers, taps, signals.

Depends on `engine`. Everything here is for the event loop of the run, except `Feed.send_from_thread`.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
from collections.abc import AsyncIterator, Callable
from functools import partial
from types import TracebackType
from typing import Any, Generic, TypeVar

from hfg.activity.rules import asked_for
from hfg.base.token import END, NO_MESSAGE, Marker, Token
from hfg.engine.executing.code import answer
from hfg.engine.model.running_node import ENDED, RunningNode
from hfg.engine.rules.releasing import take_from_reader
from hfg.engine.rules.sending import enqueue, put_outputs
from hfg.engine.runtime.engine import Engine
from hfg.engine.runtime.plan import prepare_slot
from hfg.errors import NotRunning, UsageError
from hfg.ports.base import need_sendable
from hfg.types import accepts, describe, describe_value

__all__ = ["Feed", "collect", "read", "signal", "until"]

T = TypeVar("T")


class Feed(Generic[T]):
    """Brings tokens into a graph input; while it is open it holds the run open (R5).

    Leaving the block sends END after the last token, unless `end=False` or an exception leaves it. It waits until
    threads have sent what they had begun to send, but not for END's place.
    """

    def __init__(self, engine: Engine, worker: RunningNode, hint: object, *, end: bool) -> None:
        self._engine = engine
        self._worker = worker
        self._hint = hint
        self._end = end
        self._open = False
        self._lock = asyncio.Lock()

    async def __aenter__(self) -> Feed[T]:
        _check_running(self._engine)
        self._check_not_ended()
        self._open = True
        self._engine.quiet.hold()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._open = False
        try:
            if kind is None and self._end:
                async with self._lock:
                    self._put_end()
        finally:
            self._engine.quiet.unhold()

    async def send(
        self, value: T | Token[T] | Marker | None, *, activity: int | None = None, stamp: float | None = None
    ) -> None:
        """Send one token and wait until the graph has processed it (P10); None is silence.

        Raises:
          NotRunning: the feed is closed, or the run ended before the token was processed.
          TypeError: the value is not of the input's type.
        """
        if not self._open:
            raise NotRunning(
                f'the feed of "{self._worker.port_name}" is closed: use it inside "async with run.feed(...)"'
            )
        need_sendable(value, activity, stamp)
        self._check_type(value)
        waiting = _Waiting(self._engine, self._worker)
        try:
            async with self._lock:
                await self._free()
                _check_running(self._engine)
                self._check_not_ended()
                self._put(value, activity, stamp)
                waiting.over()
                await self._free()
        finally:
            waiting.over()
        _check_running(self._engine)

    def send_from_thread(
        self, value: T | Token[T] | Marker | None, *, activity: int | None = None, stamp: float | None = None
    ) -> concurrent.futures.Future[None]:
        """Send from any other thread, in order; the future is done when the token is processed.

        Raises:
          TypeError: the value is not of the input's type.
        """
        need_sendable(value, activity, stamp)
        self._check_type(value)
        return asyncio.run_coroutine_threadsafe(self.send(value, activity=activity, stamp=stamp), self._engine.loop)

    def _check_type(self, value: object) -> None:
        if value is not None and not isinstance(value, Token | Marker) and not accepts(value, self._hint):
            raise TypeError(
                f'graph input "{self._worker.port_name}" expects {describe(self._hint)}, got {describe_value(value)}'
            )

    def _check_not_ended(self) -> None:
        if self._worker.blocked & ENDED:
            raise UsageError(
                f'graph input "{self._worker.port_name}" has ended: another feed of it was closed; open that '
                f"one with end=False to feed it again"
            )

    def _put_end(self) -> None:
        worker = self._worker
        if self._engine.core.over or worker.blocked & ENDED:
            return
        if worker.outputs.missing:
            worker.outputs.when_complete(partial(self._put_end_soon, _Waiting(self._engine, worker)))
            return
        worker.block(ENDED)
        self._put(END, None, None)

    def _put_end_soon(self, waiting: _Waiting) -> None:
        def now() -> None:
            self._put_end()
            waiting.over()

        self._engine.loop.call_soon(now)  # not in the middle of what the engine does now

    def _put(self, value: object, activity: int | None, stamp: float | None) -> None:
        if value is None:
            value = NO_MESSAGE
        if type(value) is Token:
            activity = asked_for(activity, value.activity)
            stamp = value.stamp if stamp is None else stamp
            value = value.value
        put_outputs(self._worker, [(value, activity, stamp)])
        self._engine.kick()

    async def _free(self) -> None:
        """Wait until the input's edges are free, or the run is over."""
        while True:
            await until(self._engine, self._worker.outputs.when_complete)
            if not self._worker.outputs.missing or self._engine.core.over:
                return


class _Waiting:
    """Somebody has a token for a feed: while there is a place for it, the graph is not quiet."""

    def __init__(self, engine: Engine, feed: RunningNode) -> None:
        self._engine = engine
        self._feed = feed
        engine.quiet.senders.append(feed)
        self._is_over = False

    def over(self) -> None:
        """It was sent, or never will be."""
        if not self._is_over:
            self._is_over = True
            self._engine.quiet.senders.remove(self._feed)
            self._engine.kick()


async def until(engine: Engine, when: Callable[[Callable[[], None]], None]) -> None:
    """Wait for a barrier, or for the end of the run."""
    waiter: asyncio.Future[None] = engine.loop.create_future()
    when(partial(answer, waiter, None))
    if not waiter.done():
        try:
            await engine.or_end(waiter)
        finally:
            waiter.cancel()


def _check_running(engine: Engine) -> None:
    if engine.core.over:
        raise NotRunning("the run is over: nothing can be brought into it any more")


async def read(engine: Engine, worker: RunningNode) -> AsyncIterator[Any]:
    """Yield the values of a graph output, with back-pressure, until END or the end of the run (P10)."""
    if not worker.live_inputs:
        raise UsageError(f'graph output "{worker.port_name}" is not connected: nothing will come out of it')
    engine.quiet.readers.append(worker)
    try:
        while True:
            while worker.inputs.missing:  # another reader may have been faster
                if engine.core.over or worker in engine.quiet.read_out:
                    return
                await until(engine, worker.inputs.when_complete)
            token = take_from_reader(worker)
            engine.kick()
            if token.value is END:
                engine.quiet.read_out.add(worker)
                return
            engine.quiet.read_out.discard(worker)
            if token.value is not NO_MESSAGE:
                yield token.value
    finally:
        engine.quiet.readers.remove(worker)
        engine.kick()


def collect(engine: Engine, worker: RunningNode, values: list[Any]) -> None:
    """Read a graph output into a list, for runs whose outputs are not read."""

    def step(worker: RunningNode) -> None:
        worker.use_turn()
        while worker.live_inputs and not worker.inputs.missing:
            token = take_from_reader(worker)
            if type(token.value) is not Marker:
                values.append(token.value)
        engine.kick()

    worker.run_by(step)


async def signal(
    engine: Engine, worker: RunningNode, slot: str, value: object, activity: int | None, stamp: float | None
) -> None:
    """Bring a signal into a slot from outside, as if by an edge that is active; waits while its queue is full (F8).

    The signal goes to the end of the queue. Nothing is sent to a disabled node (F10).
    """
    _check_running(engine)
    edge = worker.core.outside.get((worker.index, slot))
    if edge is None:
        edge = prepare_slot(worker, slot)
        for adopt in engine.callbacks.joined:
            adopt(edge)
    while len(edge.queue) >= edge.capacity:
        waiter: asyncio.Future[None] = engine.loop.create_future()
        edge.source.room.when_free(partial(answer, waiter, None))
        await until(engine, lambda done: waiter.add_done_callback(lambda _: done()))  # noqa: B023
        _check_running(engine)
    explicit = activity or 0
    if type(value) is Token:
        explicit = value.activity if activity is None else activity
        stamp = value.stamp if stamp is None else stamp
        value = value.value
    if edge.live:
        enqueue(edge, value, explicit, engine.now() if stamp is None else stamp)
        engine.kick()
