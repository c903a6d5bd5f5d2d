"""Setup and teardown of one node, and the pause of a restart between them (X1, X3). Stands on `contracts`."""

from __future__ import annotations

from hfg.engine.model.contracts import Timer
from hfg.errors import EngineInternalError

__all__ = ["Lifecycle"]


class Lifecycle:
    """Whether a node is set up: each setup is followed by a teardown before the next one.

    Attributes:
      is_up: its setup has begun, its teardown has not.
      opening: its setup is under way.
      backoff_timer: of a restart; None: it does not pause.
    """

    __slots__ = ("backoff_timer", "is_up", "opening")

    def __init__(self) -> None:
        self.is_up = False
        self.opening = False
        self.backoff_timer: Timer | None = None

    def open(self) -> None:
        """Its setup begins; teardown follows one that fails half-way too."""
        self.is_up = self.opening = True

    def opened(self) -> None:
        """Its setup is over, well or not."""
        self.opening = False

    def close(self) -> None:
        """Its teardown begins."""
        assert self.is_up, "a node is torn down that was not set up"
        self.is_up = False

    def rest(self, timer: Timer) -> None:
        """X1: it is set up again when this timer is over."""
        self.backoff_timer = timer

    def end_rest(self) -> None:
        """The pause is over, or nothing follows it any more."""
        timer, self.backoff_timer = self.backoff_timer, None
        if timer is not None:
            timer.cancel()

    def check_invariants(self, path: str) -> None:
        """A setup under way belongs to a node that is to be torn down.

        Raises:
          EngineInternalError: it does not.
        """
        if self.opening and not self.is_up:
            raise EngineInternalError(f'node "{path}": its setup is under way, though its teardown has begun (X1)')
