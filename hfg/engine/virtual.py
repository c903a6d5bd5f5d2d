"""Virtual time: an event loop whose clock jumps to the next timer when nothing is ready and no work is in flight.

(rule R6).

Nodes that call plain `asyncio.sleep` are covered without knowing it. Work in threads would make the loop look idle,
so whoever starts some holds the clock until it is back; `run_in_executor` (and so `asyncio.to_thread`) does by itself.
"""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable
from typing import Any

__all__ = ["VirtualTimeLoop"]

_POLL_EVERY = 64  # jumps without a look at real sockets and signals


class _JumpingSelector(selectors.DefaultSelector):
    """Instead of waiting until the next timer, moves the clock to it."""

    loop: VirtualTimeLoop
    _skipped = 0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        loop = self.loop
        if timeout is None or loop._holds:
            return super().select(None if timeout is None or timeout > 0 else timeout)
        if timeout <= 0:
            self._skipped += 1
            if self._skipped < _POLL_EVERY and len(self.get_map()) <= 1:
                return []
            self._skipped = 0
            return super().select(0)
        self._skipped += 1
        if self._skipped >= _POLL_EVERY or len(self.get_map()) > 1:
            self._skipped = 0
            ready = super().select(0)
            if ready:
                return ready
        loop._jump(timeout)
        return []


class VirtualTimeLoop(asyncio.SelectorEventLoop):
    """An asyncio event loop in virtual time; `time()` begins at 0.

    Example:
      >>> async def main() -> float:
      ...     await asyncio.sleep(3600)
      ...     return asyncio.get_running_loop().time()
      >>> with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
      ...     runner.run(main())
      3600.0
    """

    def __init__(self) -> None:
        self._virtual_now = 0.0
        self._holds = 0
        selector = _JumpingSelector()
        selector.loop = self
        super().__init__(selector)
        self._clock_resolution = 1e-9

    def time(self) -> float:
        """Virtual seconds since the loop was made."""
        return self._virtual_now

    def hold(self) -> None:
        """Work is in flight outside the loop: the clock stands still until as many `unhold` have followed."""
        self._holds += 1

    def unhold(self) -> None:
        """The work is back."""
        self._holds -= 1

    def run_in_executor(self, executor: Any, func: Callable[..., Any], *args: Any) -> Any:  # type: ignore[override]
        """As asyncio's, but the clock waits for it."""
        future = super().run_in_executor(executor, func, *args)
        self.hold()
        future.add_done_callback(lambda _: self.unhold())
        return future

    async def shutdown_default_executor(self, timeout: float | None = None) -> None:  # noqa: ASYNC109
        """As asyncio's, but the clock waits for the executor's threads."""
        self.hold()
        try:
            await super().shutdown_default_executor()
        finally:
            self.unhold()

    def _jump(self, timeout: float) -> None:
        scheduled = self._scheduled  # type: ignore[attr-defined]
        if scheduled:
            self._virtual_now = max(self._virtual_now, scheduled[0].when())
        else:
            self._virtual_now += timeout
