"""What a node waits for: its inputs until every live one holds a token.

Its outputs until every consumer has processed (rules F1, F5).

A barrier is a counter with people waiting at it. The engine says what is expected and what arrives, and nothing else
happens as long as nobody waits; whoever wants to wait asks the run (`run.wait_inputs(node)`, `run.wait_outputs(node)`),
which brings the futures. Stands on `errors`; never waits itself.
"""

from __future__ import annotations

from collections.abc import Callable

from hfg.errors import EngineInternalError

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

    def expect(self) -> None:
        """One more is missing from now on."""
        self.missing += 1

    def arrive(self) -> bool:
        """One less is missing; whether it is complete by that. Who waits is told by `notify`, when the caller can."""
        self.missing -= 1
        return not self.missing

    def count(self, missing: int) -> None:
        """What it waits for is another set now, of which so many are missing."""
        self.missing = missing

    def when_complete(self, callback: Callable[[], None]) -> None:
        """Call `callback` once: now if complete, else at completion."""
        if self.missing == 0:
            callback()
        elif self.waiters is None:
            self.waiters = [callback]
        else:
            self.waiters.append(callback)

    def notify(self) -> None:
        """Tell those who wait, if anybody does; for the caller of `arrive`, as soon as it is in order."""
        waiters, self.waiters = self.waiters, None
        for callback in waiters or ():
            callback()

    def check_invariants(self, missing: int, of_whom: str) -> None:
        """Compare with what the caller has counted on the edges.

        Raises:
          EngineInternalError: they differ.
        """
        if self.missing != missing:
            raise EngineInternalError(f"{of_whom}: its barrier says that {self.missing} are missing, not {missing}")
