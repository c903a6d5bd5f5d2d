"""The clock of one run, and when the run started and ended on it (rules T5, R6, L1)."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

from hfg.errors import EngineInternalError

__all__ = ["RunTime"]


class RunTime:
    """Converts between the loop's clock and the run's, which has the date and may follow that of another process.

    Attributes:
      ahead_s: how far the run's clock is ahead of the loop's.
      epoch: how far it is ahead of the machine's monotonic clock; None: the loop has a clock of its own.
      within_s: returns by how much the clock here may differ from that of the run of which this is a part.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, *, virtual: bool) -> None:
        self._loop = loop
        self._virtual = virtual
        self.ahead_s = 0.0 if virtual else time.time() - loop.time()
        self.epoch = self.ahead_s if type(loop).time is asyncio.BaseEventLoop.time else None
        self.within_s: Callable[[], float] = float  # 0.0: it is the run's own
        # On the loop's clock, whose digits the date does not use up.
        self._began_before: float | None = None  # when the run started of which this is a part
        self._started: float | None = None
        self._ended: float | None = None

    def now(self) -> float:
        """Return seconds on the run's clock."""
        return self._loop.time() + self.ahead_s

    def elapsed(self) -> float:
        """Return seconds from the start of the run to its end; 0 before. Rounded to 1 ns: more digits are noise."""
        if self._started is None:
            return 0.0
        return round((self._loop.time() if self._ended is None else self._ended) - self._started, 9)

    @property
    def began_at(self) -> float:
        """When the run started, on its clock.

        Raises:
          EngineInternalError: it has not.
        """
        if self._started is None:
            raise EngineInternalError("the run has not begun")
        return self._started + self.ahead_s

    @property
    def ended_at(self) -> float | None:
        """When the run ended, on its clock; None before."""
        return None if self._ended is None else self._ended + self.ahead_s

    def follow(self, ahead_s: float, began_s: float, within_s: Callable[[], float]) -> None:
        """Follow the clock of the run of which this is a part, before it starts.

        Args:
          ahead_s: how far that clock is ahead of this machine's monotonic one.
          began_s: when the run started, on its clock.
          within_s: returns by how much the two may differ.
        """
        self.within_s = within_s
        if not self._virtual:
            self.ahead_s = ahead_s
            self.epoch = None if self.epoch is None else ahead_s
        self._began_before = began_s - self.ahead_s

    def begin(self) -> None:
        """The run starts now, or did when it started elsewhere."""
        self._started = self._loop.time() if self._began_before is None else self._began_before

    def end(self) -> None:
        """The run is over."""
        self._ended = self._loop.time()
