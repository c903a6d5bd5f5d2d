"""The end of a node, from the call of its `end()` until END is sent (F4, F12, T5). Stands on nothing."""

from __future__ import annotations

from hfg.errors import EngineInternalError

__all__ = ["Ending"]


class Ending:
    """How far the end of one node is; it has one from its last firing on, until it starts afresh.

    Attributes:
      is_dead_source: it counts as ended without having said END, nor will it (R5).
      pending: END leaves as soon as the outputs are free; with the stamp `stamp`.
      deferred: modifiers that were drained, and act behind END; None from then on.
    """

    __slots__ = ("deferred", "is_dead_source", "pending", "stamp")

    def __init__(self, *, is_dead_source: bool) -> None:
        self.is_dead_source = is_dead_source
        self.pending = False
        self.stamp: float | None = None
        self.deferred: list[int] | None = []

    def promise(self, stamp: float | None) -> None:
        """END follows when the outputs are free."""
        assert not self.is_dead_source, "END of a node that nobody hears any more (R5)"
        self.pending = True
        self.stamp = stamp

    def send(self) -> float | None:
        """END is sent now: gives back its stamp (T5)."""
        self.pending = False
        return self.stamp

    def call_off(self) -> None:
        """END will never be sent: the node is gone."""
        self.pending = False

    def defer(self, modifier: int) -> None:
        """F12: a modifier that was drained acts behind END."""
        assert self.deferred is not None, "END has been sent: what is drained acts at once"
        self.deferred.append(modifier)

    @property
    def brings_activity(self) -> bool:
        """Whether a +1 is among what was drained and has yet to act (G2)."""
        return self.deferred is not None and 1 in self.deferred

    def strip(self) -> None:
        """A14: what was drained brings no activity any more."""
        if self.deferred:
            self.deferred = [0] * len(self.deferred)

    def take_deferred(self) -> list[int]:
        """END has been sent, or never will be: what was drained acts now."""
        deferred, self.deferred = self.deferred, None
        return deferred or []

    def check_invariants(self, path: str) -> None:
        """What waits for END waits for one that is to come.

        Raises:
          EngineInternalError: it does not.
        """
        if self.pending and self.is_dead_source:
            raise EngineInternalError(f'node "{path}": END is to follow, though it is given up (R5)')
