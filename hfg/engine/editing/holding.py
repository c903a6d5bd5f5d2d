"""Holds nodes for an edit: as they come to rest, until it has taken effect or is given up (rule R4).

While the code of one of them waits until a queue has room, none is held: they may be the ones that make it.
Stands on `lifecycle`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence

from hfg.engine.executing.code import answer
from hfg.engine.model.worker import REMOVED, Worker
from hfg.engine.rules import lifecycle
from hfg.engine.rules.sending import flush_automatic
from hfg.engine.runtime.engine import Engine
from hfg.errors import NotRunning
from hfg.trace import EditWaits, StructureChanged

__all__ = ["Held"]


class Held:
    """Holds nodes as they come to rest; inside the block all of them rest.

    Attributes:
      done: the edit has taken effect; else it was given up.
    """

    def __init__(self, engine: Engine, workers: Sequence[Worker]) -> None:
        self._engine = engine
        self._workers = workers
        self._held: dict[Worker, Callable[[], None]] = {}  # who rests, and what lets it go
        self._free: list[Worker] = []  # who may go on until a queue has room
        self._waiter: asyncio.Future[None] = engine.loop.create_future()
        self._given_up = False
        self.done = False
        self._said = False  # that it waits
        self._counts = False  # among what is in flight

    async def __aenter__(self) -> Held:
        engine = self._engine
        core = engine.core
        core.holding = self
        for worker in self._workers:
            lifecycle.when_idle(worker, self._rests, lifecycle.nothing)
        if len(self._held) < len(self._workers):
            self._said = True
            if core.trace is not None:
                core.trace(EditWaits(core.now(), tuple(worker.path for worker in self._workers)))
            try:
                await self._or_end(self._waiter)
            except BaseException:
                self._let_go()
                raise
        return self

    def _rests(self, worker: Worker, over: Callable[[], None]) -> None:
        """One of them has come to rest."""
        if self._given_up:
            over()
            return
        if self._is_room_awaited():
            self._free.append(worker)
            over()
            return
        worker.be_busy("edit")
        self._held[worker] = over
        if len(self._held) == len(self._workers):
            if self._said:  # until we have our turn it is not quiet, or queues would grow (F8)
                self._engine.core.set_out()
                self._counts = True
            answer(self._waiter, None)

    def _is_room_awaited(self) -> bool:
        return any(worker.waiting_room for worker in self._workers)

    def look_for_room(self) -> None:
        """Somebody's code begins or ceases to wait until a queue has room (F8)."""
        if self._given_up or self._waiter.done():
            return
        if self._is_room_awaited():
            held, self._held = self._held, {}
            self._free += held
            for over in held.values():
                over()
        else:
            free, self._free = self._free, []
            for worker in free:
                lifecycle.when_idle(worker, self._rests, lifecycle.nothing)

    async def _or_end(self, waiter: asyncio.Future[None]) -> None:
        """Wait until all rest, or the run is over."""
        engine = self._engine
        ending = asyncio.ensure_future(engine.ending.wait())
        try:
            await asyncio.wait((waiter, ending), return_when=asyncio.FIRST_COMPLETED)
        finally:
            ending.cancel()
            if self._counts:
                self._counts = False
                engine.core.come_back()
        if engine.core.over:
            raise NotRunning("the run ended before the edit could take effect; the graph is as it was")

    async def __aexit__(self, *_: object) -> None:
        self._let_go()

    def _let_go(self) -> None:
        core = self._engine.core
        self._given_up = True
        core.holding = None
        if not self.done and self._said and core.trace is not None and not core.over:
            core.trace(StructureChanged(core.now(), ""))
        for worker in self._workers if self.done else ():
            if not worker.blocked & REMOVED:
                flush_automatic(worker)  # what activity that went back has raised (A8, A9)
        held, self._held = self._held, {}
        for over in held.values():
            over()
        self._engine.kick()
