"""Edits of a run take effect one after the other (rule R4), and code of nodes may ask for them.

Code must not wait for an edit that waits for that code: a node that edits itself, or two nodes that edit each other,
would wait forever. The last of them gets an error. This module knows which code waits for which edit, and nothing else.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager

from hfg.engine.model.current import current_firing, current_task, whose_code
from hfg.engine.model.running_node import RunningNode
from hfg.errors import UsageError

__all__ = ["EditLock"]


class EditLock:
    """Knows who edits now, and who waits."""

    def __init__(self) -> None:
        self._taken = False
        self._waiting: deque[asyncio.Future[None]] = deque()
        self._asking: dict[RunningNode, asyncio.Future[None]] = {}  # nodes whose code waits for the lock
        self._awaited: set[RunningNode] = set()  # nodes for whose code the present edit waits

    @asynccontextmanager
    async def one(self) -> AsyncIterator[None]:
        """Wait for earlier edits; no other edit is made inside the block.

        Raises:
          UsageError: an edit waits for the end of the calling code, or soon will.
        """
        await self._take(_asking_node())
        try:
            yield
        finally:
            self._awaited.clear()
            self._pass_on()

    def wait_for(self, workers: Iterable[RunningNode], *, tasks_too: bool = False) -> None:
        """Note that the present edit now waits for the code of these nodes, and of no others, to end.

        Args:
          workers: the nodes.
          tasks_too: the edit also waits for their background tasks, because the nodes are torn down.

        Raises:
          UsageError: code of one of them has asked for this edit.
        """
        self._awaited = set(workers)
        task = current_task.get()
        speaker = task.worker if tasks_too and task is not None and task.is_current() else _asking_node()
        if speaker in self._awaited:
            raise _waits_for_itself(speaker)
        for worker in [worker for worker in self._asking if worker in self._awaited]:
            waiter = self._asking[worker]
            if waiter in self._waiting:
                self._waiting.remove(waiter)
                waiter.set_exception(_waits_for_itself(worker))

    async def _take(self, speaker: RunningNode | None) -> None:
        if speaker is not None and speaker in self._awaited:
            raise _waits_for_itself(speaker)
        if not self._taken:
            self._taken = True
            return
        waiter: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._waiting.append(waiter)
        if speaker is not None:
            self._asking[speaker] = waiter
        try:
            await waiter
        except asyncio.CancelledError:
            if waiter in self._waiting:
                self._waiting.remove(waiter)
            elif waiter.done() and not waiter.cancelled() and waiter.exception() is None:
                self._pass_on()  # we had just received the lock
            raise
        finally:
            if speaker is not None:
                del self._asking[speaker]

    def _pass_on(self) -> None:
        while self._waiting:
            waiter = self._waiting.popleft()
            if not waiter.done():  # otherwise it was cancelled just now
                waiter.set_result(None)
                return
        self._taken = False


def _asking_node() -> RunningNode | None:
    """Return the node whose code asks; background tasks do not count, because no edit waits for them."""
    worker = whose_code()
    firing = current_firing.get()
    eager_task = None if worker is None else worker.execution.eager_task if firing is None else firing.eager_task
    return worker if eager_task is not None and eager_task.task is asyncio.current_task() else None


def _waits_for_itself(worker: RunningNode) -> UsageError:
    return UsageError(
        f'"{worker.path}" edits the graph in the middle of its code and would wait for ever, because the edit, or one '
        "before it, waits for the end of this code: do it in a task, asyncio.create_task(run.edit(...))"
    )
