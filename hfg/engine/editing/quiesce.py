"""Holds nodes for an edit: each when it becomes idle, until the edit has taken effect or is given up (rule R4).

While code of one of them waits for room in a queue, none is held: the others may be the ones that make room, and to
hold them would be a deadlock. Nodes inside a subgraph that iterates are held after it, because its firing ends only
when they are idle (G4).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence

from hfg.engine.executing.code import answer
from hfg.engine.model.running_node import REMOVED, RunningNode
from hfg.engine.rules import node_lifecycle
from hfg.engine.rules.sending import send_automatic
from hfg.engine.runtime.engine import Engine
from hfg.errors import NotRunning
from hfg.trace import EditWaits, StructureChanged

__all__ = ["Quiesced"]


class Quiesced:
    """Holds nodes when they become idle; inside the block all of them are idle.

    Attributes:
      done: the edit has taken effect; otherwise it was given up.
    """

    def __init__(self, engine: Engine, workers: Sequence[RunningNode]) -> None:
        self._engine = engine
        self._workers = workers
        self._held: dict[RunningNode, Callable[[], None]] = {}  # idle nodes, and what releases each
        self._wanted = frozenset(workers)
        self._left = list(workers)  # not held until others are idle, or a queue has room
        self._waiter: asyncio.Future[None] = engine.loop.create_future()
        self._given_up = False
        self.done = False
        self._said = False  # the trace knows that the edit waits
        self._counts = False  # the edit counts as work in flight

    async def __aenter__(self) -> Quiesced:
        engine = self._engine
        core = engine.core
        core.quiescing = self
        self._hold()
        if len(self._held) < len(self._workers):
            self._said = True
            self._say()
            try:
                await self._or_end(self._waiter)
            except BaseException:
                self._let_go()
                raise
        return self

    def _hold(self) -> None:
        """Hold the remaining nodes when they become idle, except those inside a subgraph that must be idle first."""
        for worker in [worker for worker in self._left if not self._is_amid(worker)]:
            if worker in self._left:
                self._left.remove(worker)
                node_lifecycle.when_idle(worker, self._rests, node_lifecycle.nothing)

    def _is_amid(self, worker: RunningNode) -> bool:
        """Return whether a node is inside an iterating subgraph that is still to be held."""
        around = worker.within
        while around is not None:
            if around.worker in self._wanted and around.worker not in self._held:
                return True
            around = around.worker.within
        return False

    def _say(self) -> None:
        """Report to the trace which nodes start nothing until the edit is over."""
        core = self._engine.core
        if core.trace is not None:
            waiting = tuple(worker.path for worker in self._workers if worker not in self._left)
            core.trace(EditWaits(core.now(), waiting))

    def _rests(self, worker: RunningNode, over: Callable[[], None]) -> None:
        """Hold a node that has become idle."""
        if self._given_up:
            over()
            return
        if self._is_room_awaited():
            self._left.append(worker)
            over()
            return
        worker.be_busy("edit")
        self._held[worker] = over
        if self._left:
            self._hold()
            if self._said and len(self._held) < len(self._workers):
                self._say()
        elif len(self._held) == len(self._workers):
            if self._said:  # the run is not quiet before the edit continues, or queues would grow (F8)
                self._engine.core.begin_async()
                self._counts = True
            answer(self._waiter, None)

    def _is_room_awaited(self) -> bool:
        return any(worker.room.waiting for worker in self._workers)

    def look_for_room(self) -> None:
        """React to code that starts or stops waiting for room in a queue (F8)."""
        if self._given_up or self._waiter.done():
            return
        if self._is_room_awaited():
            held, self._held = self._held, {}
            self._left += held
            self._say()
            for over in held.values():
                over()
        else:
            self._hold()

    async def _or_end(self, waiter: asyncio.Future[None]) -> None:
        """Wait until all are idle, or the run is over."""
        engine = self._engine
        try:
            await engine.or_end(waiter)
        finally:
            if self._counts:
                self._counts = False
                engine.core.end_async()
        if engine.core.over:
            raise NotRunning("the run ended before the edit could take effect; the graph is as it was")

    async def __aexit__(self, *_: object) -> None:
        self._let_go()

    def _let_go(self) -> None:
        core = self._engine.core
        self._given_up = True
        core.quiescing = None
        if not self.done and self._said and core.trace is not None and not core.over:
            core.trace(StructureChanged(core.now(), ""))
        for worker in self._workers if self.done else ():
            if not worker.blocked & REMOVED:
                send_automatic(worker)  # automatic events of activity that was returned (A8, A9)
        held, self._held = self._held, {}
        for over in held.values():
            over()
        self._engine.kick()
