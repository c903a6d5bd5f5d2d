"""Holds nodes for an edit: as they come to rest, until it has taken effect or is given up (rule R4).

Stands on `lifecycle`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from hfg.engine.model.worker import REMOVED, Worker
from hfg.engine.rules import lifecycle
from hfg.engine.rules.sending import flush_automatic
from hfg.engine.runtime.code import answer
from hfg.errors import NotRunning
from hfg.trace import EditWaits, StructureChanged

if TYPE_CHECKING:
    from hfg.engine.runtime.engine import Engine

__all__ = ["Held"]


class Held:
    """Holds nodes as they come to rest; inside the block all of them rest.

    Attributes:
      done: the edit has taken effect; else it was given up.
    """

    def __init__(self, engine: Engine, workers: Sequence[Worker]) -> None:
        self._engine = engine
        self._workers = workers
        self._letting_go: list[Callable[[], None]] = []
        self._given_up = False
        self.done = False
        self._said = False  # that it waits
        self._counts = False  # among what is in flight

    async def __aenter__(self) -> Held:
        engine = self._engine
        core = engine.core
        waiter: asyncio.Future[None] = engine.loop.create_future()
        left = [len(self._workers)]

        def rests(worker: Worker, over: Callable[[], None]) -> None:
            if self._given_up:
                over()
                return
            worker.busy = "edit"
            worker.disturb()
            self._letting_go.append(over)
            left[0] -= 1
            if not left[0]:
                if self._said:  # until we have our turn it is not quiet, or queues would grow (F8)
                    core.in_flight += 1
                    self._counts = True
                answer(waiter, None)

        for worker in self._workers:
            lifecycle.when_idle(worker, rests, lifecycle.nothing)
        if left[0]:
            self._said = True
            if core.trace is not None:
                core.trace(EditWaits(core.now(), tuple(worker.path for worker in self._workers)))
            try:
                await self._or_end(waiter)
            except BaseException:
                self._let_go()
                raise
        return self

    async def _or_end(self, waiter: asyncio.Future[None]) -> None:
        """Wait until all rest, or the run is over."""
        engine = self._engine
        ending = asyncio.ensure_future(engine.ending.wait())
        try:
            await asyncio.wait((waiter, ending), return_when=asyncio.FIRST_COMPLETED)
        finally:
            ending.cancel()
            engine.core.in_flight -= self._counts
            self._counts = False
        if engine.core.over:
            raise NotRunning("the run ended before the edit could take effect; the graph is as it was")

    async def __aexit__(self, *_: object) -> None:
        self._let_go()

    def _let_go(self) -> None:
        core = self._engine.core
        self._given_up = True
        if not self.done and self._said and core.trace is not None and not core.over:
            core.trace(StructureChanged(core.now(), ""))
        for worker in self._workers if self.done else ():
            if not worker.blocked & REMOVED:
                flush_automatic(worker)  # what activity that went back has raised (A8, A9)
        letting_go, self._letting_go = self._letting_go, []
        for over in letting_go:
            over()
        self._engine.kick()
