"""Runs setups and teardowns of nodes for an edit, each to its end (rules R4, X3).

A hook is code of a user: it may wait, fail, be cancelled, or ask for an edit itself. So each waits under the edit lock,
which refuses an edit that would wait for itself, and a cancelled edit still waits for the hook that it has begun.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Coroutine, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from hfg.engine.editing.edit_lock import EditLock
from hfg.engine.executing.code import answer
from hfg.engine.model.current import whose_code
from hfg.engine.model.running_node import ENDED, UNREADY, RunningNode
from hfg.engine.rules import concurrency, doing, node_lifecycle
from hfg.engine.runtime import plan
from hfg.engine.runtime import ports as engine_ports
from hfg.engine.runtime.engine import Engine
from hfg.engine.runtime.run_lifecycle import RunLifecycle
from hfg.errors import HfgError, NodeError
from hfg.graph.flat import FlatNode
from hfg.graph.structure.options import NodeOptions
from hfg.graph.structure.places import node_place

__all__ = ["NodeHooks"]


class NodeHooks:
    """Sets up and tears down nodes of one engine."""

    def __init__(self, engine: Engine, run_lifecycle: RunLifecycle, lock: EditLock) -> None:
        self._engine = engine
        self._lifecycle = run_lifecycle
        self._lock = lock

    async def set_up(self, come: Mapping[Any, NodeOptions], made: list[RunningNode]) -> None:
        """Set up the nodes that come while all others keep running; `made` receives those that were begun."""
        engine = self._engine
        for node in sorted(come, key=node_place):
            said = FlatNode(0, node._place.path, node, come[node], ())
            worker = plan.make_worker(engine.core, said, engine.groups)
            made.append(worker)
            self._lifecycle.carry(worker)
            worker.be_busy("setup")
            self._lock.wait_for((worker,))
            worker.lifecycle.wait_to_take_part()
            await self.run(worker, node_lifecycle.set_up)
            self._lifecycle.came(worker)

    async def run(self, worker: RunningNode, hook: Callable[[RunningNode, node_lifecycle.Then], None]) -> None:
        """Run a hook of a node to its end. If the edit is cancelled meanwhile, cancel the hook and wait for it.

        Raises:
          NodeError: it failed.
        """
        waiter: asyncio.Future[NodeError | None] = self._engine.loop.create_future()
        begin = partial(hook, worker, partial(answer, waiter))
        if whose_code() is None:
            self._engine.context.run(begin)
        else:  # the code of a node asks, and a context cannot be entered twice
            self._engine.soon(partial(self._engine.guard, begin))
        cancelled: asyncio.CancelledError | None = None
        while not waiter.done():
            try:
                await asyncio.wait({waiter})
            except asyncio.CancelledError as error:
                if cancelled is not None or self._engine.core.over:
                    raise
                cancelled = error
                if worker.execution.eager_task is not None:
                    worker.execution.eager_task.cancel()
        if cancelled is not None:
            raise cancelled
        failure = waiter.result()
        if failure is not None:
            raise failure

    async def to_its_end(self, clearing: Coroutine[Any, Any, None]) -> None:
        """Clean up after an edit that failed or was cancelled, however often it is cancelled."""
        task = asyncio.create_task(clearing, name="hfg edit")
        while not task.done():
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.wait({task})
        task.result()

    async def exchange(self, swapped: Sequence[tuple[RunningNode, Any, Any]]) -> None:
        """Tear down the nodes that are replaced and set up the new ones; restore them all if one fails."""
        begun: list[tuple[RunningNode, Any]] = []
        try:
            for worker, _, node in swapped:
                begun.append((worker, worker.node))
                await self._become(worker, node)
        except BaseException:
            await self.to_its_end(self._become_again(begun))
            raise
        for worker, _ in begun:
            worker.start_over()
            worker.allow(ENDED | UNREADY)

    async def _become_again(self, begun: list[tuple[RunningNode, Any]]) -> None:
        """Restore the nodes that were to be replaced; one that cannot be set up again ends the run."""
        for worker, before in reversed(begun):
            try:
                await self._become(worker, before)
            except HfgError as error:
                self._engine.finish("failed", error)
            else:
                node_lifecycle.take_part(worker)
                doing.afresh(worker)

    async def _become(self, worker: RunningNode, node: Any) -> None:
        """Let a worker run another node. A teardown that fails is reported with the other errors (X3)."""
        self._lock.wait_for((worker,))
        try:
            await self.run(worker, node_lifecycle.tear_down)
        except NodeError as error:
            self._engine.core.errors.append(error)
        _drop_code(worker)
        if worker.execution.eager_task is not None:
            worker.execution.run_in(None)
        worker.take_node(node)
        worker.show_activity()
        self._lifecycle.carry(worker)
        worker.lifecycle.wait_to_take_part()
        await self.run(worker, node_lifecycle.set_up)

    async def leave(self, gone: list[RunningNode]) -> None:
        """Tear down nodes that are gone, even if the caller does not wait for it any more."""
        if not gone:
            return
        task = asyncio.create_task(self.tear_down(gone), name="hfg edit")
        self._lifecycle.leaving.add(task)
        task.add_done_callback(self._lifecycle.leaving.discard)
        await asyncio.shield(task)

    async def tear_down(self, workers: Iterable[RunningNode]) -> None:
        """Let nodes that are gone close what they opened; a failure is reported with the other errors (X3)."""
        engine = self._engine
        for worker in workers:
            worker.cancel_timers()
        for worker in workers:
            try:
                await self.run(worker, node_lifecycle.tear_down)
            except HfgError as error:
                engine.core.errors.append(error)
            _drop_code(worker)
            self._lifecycle.went(worker)


def _drop_code(worker: RunningNode) -> None:
    """Drop what is left of the code of a node that was torn down."""
    engine_ports.release_ports(worker)
    if worker.execution.eager_task is not None:
        worker.execution.eager_task.drop()
    if worker.concurrent is not None:
        concurrency.abandon(worker)
        worker.concurrent.drop_eager_tasks()
