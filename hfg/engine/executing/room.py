"""How code waits until the queues that a node's events fill have room (F8)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from hfg.engine.executing.code import answer
from hfg.engine.model import Core, RunningEvent, RunningNode
from hfg.engine.model.current import current_task, whose_code
from hfg.engine.rules.sending import trigger, trigger_from_task

__all__ = ["trigger_wait"]


async def trigger_wait(event: RunningEvent, value: Any, activity: int | None, stamp: float | None) -> None:
    """Trigger an event, then wait until no `wait` queue of the events of its node is full (F8).

    Before the start tasks wait too, but not `setup()`, because the start waits for it. After the end of the run, code
    that sends in an endless loop yields here each time; otherwise it would block the loop, uncancellable.
    """
    worker = event.worker
    core = worker.core
    if worker.lifecycle.early is not None:
        await _trigger_early(event, value, activity, stamp)
        return
    task = current_task.get()
    count: Callable[[int], None] = worker.room.wait if whose_code() is worker else _count_nothing
    if task is not None and task.worker is worker:
        trigger_from_task(event, value, activity, stamp)
        count = worker.need_tasks().wait_for_room
    else:
        trigger(event, value, activity, stamp)
    while worker.room.full_edges and (core.started or task is not None) and not core.over:
        await _wait_for_room(worker, count)
    if core.over:
        await asyncio.sleep(0)


async def _trigger_early(event: RunningEvent, value: Any, activity: int | None, stamp: float | None) -> None:
    """Wait until a node that is set up ahead takes part; otherwise an endless loop would block this one (R4).

    `setup()` does not wait, because the node takes part after it.
    """
    lifecycle = event.worker.lifecycle
    assert event.port is not None
    event.port._emit(value, activity, stamp)
    if not lifecycle.opening:
        waiter: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        lifecycle.when_taking_part(lambda: answer(waiter, None))
        await waiter


async def _wait_for_room(worker: RunningNode, count: Callable[[int], None]) -> None:
    """Wait until all queues of a node's events have room; `count` changes how much of the node's code waits."""
    waiter: asyncio.Future[None] = asyncio.get_running_loop().create_future()
    waits = True

    def over() -> None:
        """The graph is not quiet from now on, though the code continues only in the loop's next pass (F13)."""
        nonlocal waits
        if waits:
            waits = False
            count(-1)
        answer(waiter, None)

    worker.room.when_free(over)
    count(1)
    _update_edit(worker.core)
    worker.core.runtime.kick()
    try:
        await waiter
    finally:
        over()
        _update_edit(worker.core)


def _count_nothing(_how_many: int) -> None:
    """The code that waits for room is not the node's own."""


def _update_edit(core: Core) -> None:
    """An edit that waits for this code must not hold nodes that could make room."""
    if core.quiescing is not None:
        core.quiescing.look_for_room()
