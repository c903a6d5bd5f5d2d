"""Barriers: counters that are complete when a node may fire or continue (rules F1, F5).

The input barrier of a node waits until every live input holds a token; its output barrier waits until every consumer
has processed.

The engine sets the expected count and reports arrivals. Nothing else happens as long as there are no waiters. To wait,
use the run (`run.wait_inputs(node)`, `run.wait_outputs(node)`), which provides the futures. Depends on `errors`; never
waits itself.
"""

from __future__ import annotations

from collections.abc import Callable

from hfg.errors import EngineInternalError

__all__ = ["Barrier"]


class Barrier:
    """A counter of missing tokens; complete at 0.

    Attributes:
      missing: input barrier: live inputs that hold no token. Output barrier: tokens sent that are not yet processed.
      waiters: called once, in order, when the barrier completes; None without waiters.
    """

    __slots__ = ("missing", "waiters")

    def __init__(self, missing: int = 0) -> None:
        self.missing = missing
        self.waiters: list[Callable[[], None]] | None = None

    @property
    def complete(self) -> bool:
        """Whether nothing is missing."""
        return self.missing == 0

    def expect(self) -> None:
        """Count one more missing token."""
        self.missing += 1

    def arrive(self) -> bool:
        """Count one arrival. Return whether the barrier is now complete.

        Waiters are not called from here; call `notify` when it is safe to do so.
        """
        self.missing -= 1
        return not self.missing

    def count(self, missing: int) -> None:
        """Replace the set that the barrier waits for by another, of which `missing` are missing."""
        self.missing = missing

    def when_complete(self, callback: Callable[[], None]) -> None:
        """Call `callback` once: now if the barrier is complete, otherwise at completion."""
        if self.missing == 0:
            callback()
        elif self.waiters is None:
            self.waiters = [callback]
        else:
            self.waiters.append(callback)

    def notify(self) -> None:
        """Call and forget the waiters. The caller of `arrive` calls this as soon as it is safe."""
        waiters, self.waiters = self.waiters, None
        for callback in waiters or ():
            callback()

    def check_invariants(self, missing: int, of_whom: str) -> None:
        """Compare the count with the one that the caller has taken on the edges.

        Raises:
          EngineInternalError: they differ.
        """
        if self.missing != missing:
            raise EngineInternalError(
                f"{of_whom}: its barrier counts {self.missing} missing tokens, but there are {missing}"
            )
