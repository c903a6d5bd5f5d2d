"""The part of the engine that must know when code of nodes is back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

__all__ = ["Pump"]


class Pump(Protocol):
    """The engine, as the code of nodes needs it."""

    beside_work: int

    def guard(self, call: Callable[[], None]) -> None:
        """Make a call of the engine's own; an error ends the run."""

    def go_on(self) -> None:
        """A callback of the loop is over: pump."""

    def give_way(self, call: Callable[[], None]) -> None:
        """Make this call after all that is ready now."""

    def soon(self, callback: Callable[[], None]) -> None:
        """Call back in the loop's next pass."""

    def on_loop(self) -> bool:
        """Return whether the caller is on the run's own thread."""

    def internal_fault(self, error: BaseException) -> None:
        """End the run because of a fault in the engine."""

    def kick(self) -> None:
        """Something may be queued: make the pump run."""
