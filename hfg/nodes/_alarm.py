"""One timer of a node: setting it again restarts it, and once cancelled it delays nothing.

Depends on the clock and nodetype.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final

from hfg.base.clock import elapsed
from hfg.nodetypes.node import Node

_INSTANT_S: Final = 1e-9
"""What is closer is now: a clock in whole nanoseconds never reaches the last digits of a sum of floats."""


class Alarm:
    """Calls something of a node at a moment of the run's clock, in a task of the node; made in its `setup()`.

    However often it is set, there is one task, and none while it is not set: so a run does not end before the alarm has
    rung, and a cancelled one does not keep it from ending.

    Attributes:
      due: when it rings, in seconds since the start of the run; None: it is not set.
    """

    def __init__(self, node: Node, ring: Callable[[], None]) -> None:
        self.due: float | None = None
        self._node = node
        self._ring = ring
        self._runs = False
        self._sleeping: asyncio.Future[None] | None = None

    def set(self, seconds: float) -> None:
        """Ring `seconds` from now, instead of at the time set before."""
        self.set_at(elapsed() + seconds)

    def set_at(self, due: float) -> None:
        """Ring at a moment, in seconds since the start of the run."""
        sooner = self.due is not None and due < self.due
        self.due = due
        if not self._runs:
            self._runs = True
            self._node.start_soon(self._run())
        elif sooner:
            self._wake()

    def cancel(self) -> None:
        """Do not ring."""
        self.due = None
        self._wake()

    def _wake(self) -> None:
        if self._sleeping is not None and not self._sleeping.done():
            self._sleeping.set_result(None)

    async def _run(self) -> None:
        try:
            while self.due is not None:
                rest = self.due - elapsed()
                if rest > _INSTANT_S:  # it was set to a later moment meanwhile, or has just begun
                    await self._sleep(rest)
                else:
                    self.due = None
                    self._ring()  # which may set it again
        finally:
            self._runs = False

    async def _sleep(self, seconds: float) -> None:
        loop = asyncio.get_running_loop()
        self._sleeping = loop.create_future()
        timer = loop.call_later(seconds, self._wake)
        try:
            await self._sleeping
        finally:
            timer.cancel()
            self._sleeping = None
