"""How an async node starts at once and waits as a task only if it really suspends.

A coroutine stepped outside a task breaks `asyncio.timeout`, `anyio` and everything else that asks for the current task. So each async node has one dormant
task. Its identity and context are entered around the coroutine's first step; if the coroutine suspends, the task wakes up and carries it on, beginning with
the very future that the first step yielded. Works on Python 3.11 to 3.14.
"""

from __future__ import annotations

import asyncio
import contextvars
import sys
from collections.abc import Callable, Generator
from typing import Any

from hfg.engine.core import PENDING

__all__ = ["Carrier"]

Done = Callable[[Any, BaseException | None], None]

if sys.version_info >= (3, 12):
    from asyncio.tasks import _swap_current_task as _swap  # type: ignore[attr-defined]
else:
    from asyncio.tasks import _enter_task, _leave_task, current_task

    def _swap(loop: asyncio.AbstractEventLoop, task: Any) -> Any:
        previous = current_task(loop)
        if previous is not None:
            _leave_task(loop, previous)
        if task is not None:
            _enter_task(loop, task)
        return previous


class Carrier:
    """The dormant task of one async node.

    Attributes:
      task: what `asyncio.current_task()` gives inside the node's code.
    """

    __slots__ = ("_context", "_coroutine", "_done", "_loop", "_park", "_yielded", "task")

    def __init__(self, loop: asyncio.AbstractEventLoop, name: str, context: contextvars.Context) -> None:
        self._loop = loop
        self._context = context.copy()
        self._coroutine: Any = None
        self._yielded: Any = None
        self._done: Done | None = None
        self._park: asyncio.Future[None] | None = None
        self.task: asyncio.Task[None] = loop.create_task(self._live(), name=name, context=self._context)

    def start(self, coroutine: Any, done: Done) -> Any:
        """Run the first step now.

        Returns:
          What the coroutine returned, or `PENDING`: it waits, and `done(result, error)` follows on the loop.

        Raises:
          whatever the coroutine raised in its first step.
        """
        loop = self._loop
        previous = _swap(loop, self.task)
        try:
            yielded = self._context.run(coroutine.send, None)
        except StopIteration as stop:
            return stop.value
        finally:
            _swap(loop, previous)
        self._coroutine = coroutine
        self._yielded = yielded
        self._done = done
        park = self._park
        if park is not None and not park.done():
            park.set_result(None)
        return PENDING

    @property
    def waiting(self) -> bool:
        """Whether a coroutine is under way."""
        return self._coroutine is not None

    def cancel(self) -> None:
        """Cancel the coroutine under way; without one, let the task end."""
        self.task.cancel()

    async def _live(self) -> None:
        await _Awaitable(self._carry())

    def _carry(self) -> Generator[Any, Any, None]:
        while True:
            thrown: BaseException | None = None
            while self._coroutine is None:
                self._park = self._loop.create_future()
                try:
                    yield from self._park
                except asyncio.CancelledError as cancelled:
                    if self._coroutine is None:
                        return
                    thrown = cancelled  # it was meant for the coroutine that has just begun to wait
                finally:
                    self._park = None
            coroutine, yielded, done = self._coroutine, self._yielded, self._done
            assert done is not None
            result: Any = None
            error: BaseException | None = None
            try:
                while True:
                    if thrown is not None:
                        exception, thrown = thrown, None
                        yielded = coroutine.throw(exception)
                    try:
                        received = yield yielded
                    except GeneratorExit:
                        coroutine.close()
                        raise
                    except BaseException as problem:  # noqa: BLE001 - it belongs to the coroutine
                        thrown = problem
                    else:
                        yielded = coroutine.send(received)
            except StopIteration as stop:
                result = stop.value
            except GeneratorExit:
                raise
            except BaseException as problem:  # noqa: BLE001
                error = problem
            self._coroutine = self._yielded = self._done = None
            while self.task.cancelling():
                self.task.uncancel()  # the cancellation ends with the firing it was meant for
            done(result, error)


class _Awaitable:
    """Lets a coroutine drive a generator's bare yields."""

    __slots__ = ("_generator",)

    def __init__(self, generator: Generator[Any, Any, None]) -> None:
        self._generator = generator

    def __await__(self) -> Generator[Any, Any, None]:
        return self._generator
