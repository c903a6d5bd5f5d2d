"""An asyncio loop whose timers ring in time: `epoll` waits for whole milliseconds, and so up to one too long.

At a rate of 1,000 Hz that is a period, and each start that is late by a period is one that is left out (F11).
"""

from __future__ import annotations

import asyncio
import select
import selectors

from typing_extensions import override

__all__ = ["PunctualLoop"]

_MOST_DESCRIPTORS = 1024  # select() knows no others


def _selector() -> selectors.BaseSelector | None:
    """One that waits by the microsecond; None where the system's own does."""
    if not hasattr(selectors, "EpollSelector"):
        return None

    class Punctual(selectors.EpollSelector):
        """An epoll object can be waited for like a file: select() does that, and keeps fractions of a millisecond."""

        @override
        def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
            if timeout is not None and timeout > 0 and self.fileno() < _MOST_DESCRIPTORS:
                select.select((self.fileno(),), (), (), timeout)
                timeout = 0
            return super().select(timeout)

    return Punctual()


class PunctualLoop(asyncio.SelectorEventLoop):
    """The event loop in which `hfg.run` runs a graph on the real clock.

    Timers ring within about a tenth of a millisecond, where asyncio's own loop on Linux may be a whole one late. For
    a loop of your own: `asyncio.Runner(loop_factory=hfg.PunctualLoop)`.
    """

    def __init__(self) -> None:
        super().__init__(_selector())
