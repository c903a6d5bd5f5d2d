"""How long each step at the end of a run may take (X3), even if the user wants to leave now."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import anyio

from hfg.engine.runtime.engine import Engine

__all__ = ["TeardownLimit"]

_HURRY_S = 1.5  # so that the process is over within two seconds


class TeardownLimit:
    """The time limit of each wait during a teardown. It can be shortened while something waits."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._leave_by = float("inf")
        # The current wait. The first scope of a process takes a while to make, so it is not made in a hurry.
        self._waiting = anyio.CancelScope()

    @property
    def seconds(self) -> float:
        """How long one node may take; in a hurry, the time that is left for all of them."""
        return max(0.0, min(self._engine.settings.teardown_limit_s, self._leave_by - time.monotonic()))

    @property
    def is_shortened(self) -> bool:
        """Whether the user wants to leave."""
        return self._leave_by != float("inf")

    def hurry(self) -> None:
        """The user wants to leave: tear down whatever can be torn down in time."""
        if not self.is_shortened:
            self._leave_within(_HURRY_S)

    def leave_now(self) -> None:
        """The user is tired of waiting: stop waiting altogether."""
        self._leave_within(0.0)

    def _leave_within(self, seconds: float) -> None:
        self._leave_by = time.monotonic() + seconds
        self._engine.code.hold_no_longer_than(self.seconds)
        self._waiting.deadline = min(self._waiting.deadline, self.deadline(self.seconds))

    @contextmanager
    def applied(self) -> Iterator[None]:
        """Leave the block when the limit is over, or when a hurry has moved it forward."""
        limit_s = self.seconds
        self._engine.code.hold_no_longer_than(limit_s)
        with anyio.CancelScope(deadline=self.deadline(limit_s)) as self._waiting:
            yield

    def deadline(self, seconds: float) -> float:
        """Return the loop's time after this many seconds.

        It is rounded to nanoseconds, as virtual time is; otherwise a limit in virtual time would end too late.
        """
        return round(self._engine.loop.time() + seconds, 9)

    async def wait_while(self, in_progress: Callable[[], bool]) -> None:
        """Wait until code is back, no longer than the limit."""
        code = self._engine.code
        with self.applied():
            while in_progress():
                code.came_back.clear()
                await code.came_back.wait()
