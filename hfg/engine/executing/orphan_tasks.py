"""Finds tasks that the code of nodes creates by asyncio itself and then neglects (rule X1).

A task that is awaited where it was created is fine: gathered, in a group, with a time limit. A task that still runs at
the end of the run, or has failed without being awaited, is reported as a warning with the node and the remedy. During a
run the loop creates its tasks by a factory that notes which node's code asks for one. Only that costs time.
"""

from __future__ import annotations

import asyncio
import site
import sys
import sysconfig
import weakref
from collections.abc import Callable, Coroutine
from pathlib import Path
from types import FrameType
from typing import Any, Final

import anyio

from hfg.base.frames import is_ours, users_part
from hfg.base.logs import node_log
from hfg.engine.executing.virtual import VirtualTimeLoop
from hfg.engine.model.running_node import RunningNode

__all__ = ["OrphanTasks"]

Asking = Callable[[], RunningNode | None]

_STANDARD: Final = sysconfig.get_path("stdlib")
_INSTALLED: Final = tuple({sysconfig.get_path("purelib"), sysconfig.get_path("platlib"), site.getusersitepackages()})
_ANYIO: Final = str(Path(anyio.__file__).parent)  # as what is standard: whoever calls it asks for a task
_OF_VIRTUAL_TIME: Final = VirtualTimeLoop.create_task.__code__
_OF_THE_LOOP: Final = asyncio.Handle._run.__code__  # noqa: SLF001


_PATH: Final = "_hfg_path"

_of_loop: weakref.WeakKeyDictionary[asyncio.AbstractEventLoop, OrphanTasks] = weakref.WeakKeyDictionary()


class OrphanTasks:
    """Those of the runs on one event loop; `notice` when a run starts, `forget` when it is over."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._asking: list[Asking] = []
        self._tasks: weakref.WeakKeyDictionary[asyncio.Task[Any], RunningNode] = weakref.WeakKeyDictionary()
        self._factory_before: Any = loop.get_task_factory()
        self._handler_before: Any = loop.get_exception_handler()
        self._factory: Any = self._make
        self._handler: Any = self._hear
        loop.set_task_factory(self._factory)  # type: ignore[arg-type]  # typeshed has it without the options
        loop.set_exception_handler(self._handler)

    @classmethod
    def notice(cls, loop: asyncio.AbstractEventLoop, asking: Asking) -> OrphanTasks:
        """A run starts; `asking` returns its node whose code runs now, if any."""
        found = _of_loop.get(loop)
        if found is None:
            found = _of_loop[loop] = cls(loop)
        found._asking.append(asking)
        return found

    def forget(self, asking: Asking, is_of_run: Callable[[RunningNode], bool]) -> None:
        """The run is over, and its code has ended: report what that has left behind."""
        for task, worker in list(self._tasks.items()):
            if not is_of_run(worker):
                continue
            del self._tasks[task]
            if not task.done() and not task.cancelling():
                _warn(worker.path, task, "still runs at the end of the run, and may be lost")
            elif task.done() and not task.cancelled() and getattr(task, "_log_traceback", False):
                _warn(worker.path, task, "has failed, and nobody has looked", task.exception())
        self._asking.remove(asking)
        if self._asking:
            return
        del _of_loop[self._loop]
        if self._loop.get_task_factory() is self._factory:
            self._loop.set_task_factory(self._factory_before)
        if self._loop.get_exception_handler() is self._handler:
            self._loop.set_exception_handler(self._handler_before)

    def _make(
        self, loop: asyncio.AbstractEventLoop, coroutine: Coroutine[Any, Any, Any], **options: Any
    ) -> asyncio.Task[Any]:
        before = self._factory_before
        task: asyncio.Task[Any] = (
            asyncio.Task(coroutine, loop=loop, **options) if before is None else before(loop, coroutine, **options)
        )
        worker = next((worker for worker in (asking() for asking in self._asking) if worker is not None), None)
        if worker is not None and _is_asked_for_by(worker, sys._getframe(1)):  # noqa: SLF001
            self._tasks[task] = worker
            setattr(task, _PATH, worker.path)  # when it is reported, weak references are gone
        return task

    def _hear(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Handle what the loop reports, including a failed task that is not referenced any more."""
        task: Any = context.get("task") or context.get("future")
        path = getattr(task, _PATH, None)
        error = context.get("exception")
        if path is not None and isinstance(error, BaseException) and "never retrieved" in context.get("message", ""):
            _warn(path, task, "has failed, and nobody has looked", error)
        elif self._handler_before is not None:
            self._handler_before(loop, context)
        else:
            loop.default_exception_handler(context)


def _is_asked_for_by(worker: RunningNode, frame: FrameType | None) -> bool:
    """Return whether the node's own code creates the task, and not a library that handles its tasks itself."""
    while frame is not None:
        file = frame.f_code.co_filename
        if frame.f_code is _OF_THE_LOOP:
            return False  # a server that the node has opened, a callback: the loop is running, not the node
        if file.startswith(_ANYIO) or frame.f_code is _OF_VIRTUAL_TIME:
            frame = frame.f_back
            continue
        if is_ours(file):
            return bool(worker.type.module == frame.f_globals.get("__name__"))
        if file.startswith(_INSTALLED):
            package = str(frame.f_globals.get("__name__", "")).partition(".")[0]
            return bool(package == worker.type.module.partition(".")[0])
        if not file.startswith(_STANDARD):
            return True
        frame = frame.f_back
    return False


def _warn(path: str, task: asyncio.Task[Any], what: str, error: BaseException | None = None) -> None:
    coroutine: Any = task.get_coro()
    name = getattr(coroutine, "__name__", task.get_name())
    node_log(path).warning(
        'node "%s": the task "%s" that its code has started %s; await it there, or start it by '
        "self.start_soon(%s(...)): then its errors are the node's, and it ends with it",
        path,
        name,
        what,
        name,
        exc_info=None if error is None else (type(error), error, users_part(error.__traceback__)),
    )
