"""When the next firing of a node may start: its rate (F11), and that of a throttling gate (A11). Stands on nothing."""

from __future__ import annotations

from typing import Final

from hfg.engine.model.contracts import Timer

__all__ = ["SAME_MOMENT_S", "Rate"]

SAME_MOMENT_S: Final = 1e-9  # times that differ by less are one: sums of floats do


class Rate:
    """The grid of starts of one node.

    Attributes:
      next_start: when its next firing may start.
      gate_next: when its last firing began, for a throttling gate; minus infinity: the next may begin at once.
      timer: runs while the rate keeps a firing from starting.
    """

    __slots__ = ("_grid_start", "_next_period", "gate_next", "next_start", "timer")

    def __init__(self) -> None:
        self._grid_start: float | None = None  # when the first firing with a rate began
        self._next_period = 0  # of that grid: the first in which it may start again
        self.next_start = 0.0
        self.gate_next = float("-inf")
        self.timer: Timer | None = None

    def start(self, now: float, rate_hz: float) -> None:
        """F11: a firing starts; the next one may in the next period of the grid that the first one began.

        Each place of the grid is found from its beginning, so that errors of floats never add up.
        """
        if self._grid_start is None:
            self._grid_start = now
        period = int((now - self._grid_start + SAME_MOMENT_S) * rate_hz)
        self._next_period = max(self._next_period, period) + 1  # (a clock as large as the date has fewer digits)
        self.next_start = self._grid_start + self._next_period / rate_hz

    def start_gated(self, now: float) -> None:
        """A11: an idle rate counts from here; minus infinity: from the next firing."""
        self.gate_next = now

    def wait(self, timer: Timer) -> None:
        """Nothing starts before this timer."""
        assert self.timer is None, "a node waits for one start at a time"
        self.timer = timer

    def end_wait(self) -> None:
        """The timer has come to its end, or is of no use any more."""
        if self.timer is not None:
            self.timer.cancel()
            self.timer = None
