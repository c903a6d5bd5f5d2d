"""What a node waits for: its inputs until every live one holds a token.

Its outputs until every consumer has processed (rules F1, F5).

A barrier is a counter with people waiting at it. The engine counts, and touches nothing else as long as nobody
waits; whoever wants to wait asks the run (`run.wait_inputs(node)`, `run.wait_outputs(node)`), which brings the
futures. Stands on nothing; never waits itself.
"""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["Barrier"]


class Barrier:
    """Complete while nothing is missing.

    Attributes:
      missing: input barrier: live inputs that hold no token. Output barrier: tokens sent that are not yet processed.
      waiters: called once, in order, when it completes; None while nobody waits.
    """

    __slots__ = ("missing", "waiters")

    def __init__(self, missing: int = 0) -> None:
        self.missing = missing
        self.waiters: list[Callable[[], None]] | None = None

    @property
    def complete(self) -> bool:
        """Whether there is nothing to wait for."""
        return self.missing == 0

    def when_complete(self, callback: Callable[[], None]) -> None:
        """Call `callback` once: now if complete, else at completion."""
        if self.missing == 0:
            callback()
        elif self.waiters is None:
            self.waiters = [callback]
        else:
            self.waiters.append(callback)

    def notify(self) -> None:
        """Tell those who wait; called by the engine when `missing` has become 0 and `waiters` is set."""
        waiters, self.waiters = self.waiters, None
        for callback in waiters or ():
            callback()
