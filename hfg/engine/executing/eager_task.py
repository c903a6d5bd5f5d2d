"""Starts the code of an async node at once, and lets it wait like a task, but for less.

A coroutine that runs outside a task breaks `asyncio.timeout`, `anyio` and everything else that asks for the current
task. A new task for each firing costs a pass of the loop. So each async node has one dormant task, whose identity and
context are entered around every step of its coroutines. The task itself awaits a future that passes cancellation on to
the coroutine. The awaited future wakes the coroutine directly, like a task, but without another pass of the loop.
"""

from __future__ import annotations

import asyncio
import contextlib
import contextvars
import sys
from collections.abc import Callable
from functools import partial
from typing import Any

from hfg.engine.model.core import PENDING
from hfg.engine.model.jobs import Done

__all__ = ["EagerTask"]


if sys.version_info >= (3, 12):
    from asyncio.tasks import _swap_current_task as _swap  # type: ignore[attr-defined]
else:
    from asyncio.tasks import _current_tasks  # type: ignore[attr-defined]

    def _swap(loop: asyncio.AbstractEventLoop, task: Any) -> Any:
        previous = _current_tasks.pop(loop, None)
        if task is not None:
            _current_tasks[loop] = task
        return previous


class _Sleep(asyncio.Future[None]):
    """What a dormant task awaits: cancelling the task cancels the coroutine that it lends its identity to."""

    def __init__(self, eager_task: EagerTask, loop: asyncio.AbstractEventLoop) -> None:
        super().__init__(loop=loop)
        self._eager_task = eager_task

    def cancel(self, msg: Any = None) -> bool:
        """Pass the cancellation on; without a coroutine in progress the task itself ends."""
        return self._eager_task.take_cancellation(msg) or super().cancel(msg)


class EagerTask:
    """The dormant task of one async node.

    Attributes:
      task: the result of `asyncio.current_task()` inside the node's code.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        name: str,
        outside: contextvars.Context,
        context: contextvars.Context | None = None,
        soon: Callable[[Callable[[], None]], object] | None = None,
    ) -> None:
        self._loop = loop
        self._soon = soon or partial(loop.call_soon, context=outside)  # continues after what is ready now
        self._outside = outside  # the context of the engine's own code
        self._context = outside.copy() if context is None else context
        self._coroutine: Any = None
        self._done: Done | None = None
        self._waits: Callable[[], None] | None = None
        self._waits_for: Any = None
        self._must_cancel: asyncio.CancelledError | None = None
        self.task: asyncio.Task[None] = loop.create_task(self._sleep(), name=name, context=self._context)

    async def _sleep(self) -> None:
        await _Sleep(self, self._loop)

    @property
    def waiting(self) -> bool:
        """Whether a coroutine is in progress."""
        return self._coroutine is not None

    def is_current(self) -> bool:
        """Return whether the caller is the code that it runs."""
        return asyncio.current_task(self._loop) is self.task

    def enter(self, call: Callable[..., object], *arguments: Any) -> None:
        """Call something in the context of the code that it runs."""
        self._context.run(call, *arguments)

    def start(self, coroutine: Any, done: Done, waits: Callable[[], None] | None = None) -> Any:
        """Run the first step now.

        Args:
          coroutine: what to run.
          done: receives its outcome if it has waited.
          waits: called once, when the coroutine first waits for more than its turn.

        Returns:
          The result of the coroutine, or `PENDING`: it waits, and `done(result, error)` follows on the loop.

        Raises:
          whatever the coroutine raised in its first step.
        """
        loop = self._loop
        previous = _swap(loop, self.task)
        try:
            waits_for = self._context.run(coroutine.send, None)
        except StopIteration as stop:
            return stop.value
        finally:
            _swap(loop, previous)
        self._coroutine = coroutine
        self._done = done
        self._waits = waits
        self._wait(waits_for)
        return PENDING

    def cancel(self) -> None:
        """Cancel the coroutine in progress; without one, let the task end."""
        if not self.take_cancellation(None):
            self.task.cancel()

    def drop(self) -> None:
        """Run the coroutine no further, whatever it does, and let the task end: the run is over (X3)."""
        coroutine, self._coroutine = self._coroutine, None
        future, self._waits_for = self._waits_for, None
        self._done = self._must_cancel = None
        if future is not None:
            future.remove_done_callback(self._wake)
        if coroutine is not None:
            previous = _swap(self._loop, self.task)
            try:
                with contextlib.suppress(Exception):  # it ignores even this
                    self._context.run(coroutine.close)
            finally:
                _swap(self._loop, previous)
        self.task.cancel()

    def take_cancellation(self, message: Any) -> bool:
        """Its task was cancelled. Return whether that was passed on to a coroutine in progress."""
        if self.waiting:
            self._cancelled(message)
            return True
        if asyncio.current_task(self._loop) is self.task:  # a coroutine cancels itself in its first step
            self._cancelled(message)
            self._loop.call_soon(self._forget_cancellation)
            return True
        return False

    def _cancelled(self, message: Any) -> None:
        """As `asyncio.Task.cancel`: cancel what it waits for, otherwise throw at the next step."""
        future = self._waits_for
        if future is None or not future.cancel(msg=message):
            self._must_cancel = asyncio.CancelledError() if message is None else asyncio.CancelledError(message)

    def _forget_cancellation(self) -> None:
        """It was meant for a coroutine that has ended without waiting."""
        if not self.waiting:
            self._must_cancel = None
            while self.task.cancelling():
                self.task.uncancel()

    def _wait(self, waits_for: Any) -> None:
        """Continue when what the coroutine yielded is done: the protocol between coroutines, futures and tasks."""
        if waits_for is None:
            self._soon(self._step)
            return
        if getattr(waits_for, "_asyncio_future_blocking", None):
            waits_for._asyncio_future_blocking = False  # noqa: SLF001 (part of that protocol)
            if self._waits is not None:
                waits, self._waits = self._waits, None
                waits()
            self._waits_for = waits_for
            waits_for.add_done_callback(self._wake, context=self._outside)
            if self._must_cancel is not None and waits_for.cancel():
                self._must_cancel = None
            return
        problem = RuntimeError(f"async code awaited something that asyncio does not know: {waits_for!r}")
        self._loop.call_soon(self._step, problem, context=self._outside)

    def _wake(self, future: asyncio.Future[Any]) -> None:
        try:
            future.result()
        except BaseException as error:
            self._step(error)
        else:
            self._step()

    def _step(self, error: BaseException | None = None) -> None:
        coroutine = self._coroutine
        self._waits_for = None
        if coroutine is None:
            return  # dropped
        if self._must_cancel is not None:
            error, self._must_cancel = self._must_cancel, None
        result: Any = None
        over: BaseException | None = None
        loop = self._loop
        previous = _swap(loop, self.task)
        try:
            waits_for = (
                self._context.run(coroutine.send, None) if error is None else self._context.run(coroutine.throw, error)
            )
        except StopIteration as stop:
            result = stop.value
        except BaseException as problem:
            over = problem
        else:
            self._wait(waits_for)
            return
        finally:
            _swap(loop, previous)
        done = self._done
        assert done is not None
        self._coroutine = self._done = self._must_cancel = None
        while self.task.cancelling():
            self.task.uncancel()  # the cancellation ends with the firing it was meant for
        done(result, over)
        if isinstance(over, KeyboardInterrupt):
            raise over
