"""The time in a graph: seconds on the run's clock, and since the start of the run.

`now()` reads the clock of the run that the caller's code belongs to, real or virtual. Outside a run it reads the loop's
clock if that is in virtual time, otherwise the real clock. `elapsed()` counts from the start of the run. No
dependencies; the engine sets the clocks (rule R6).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Final

from hfg.errors import NotRunning

current_clock: Final[ContextVar[Callable[[], float]]] = ContextVar("hfg.base.clock", default=time.time)
"""Set by the engine around the code of a run, on the loop and in threads."""

current_elapsed: Final[ContextVar[Callable[[], float] | None]] = ContextVar("hfg.elapsed", default=None)
"""The same in seconds since the start of the run; None outside a run."""


@contextmanager
def time_told_by(clock: Callable[[], float]) -> Iterator[None]:
    """Make `now` read another clock, which began at 0, inside the block."""
    resets = current_clock.set(clock), current_elapsed.set(clock)
    try:
        yield
    finally:
        current_clock.reset(resets[0])
        current_elapsed.reset(resets[1])


def now() -> float:
    """Return seconds on the current run's clock, the clock of stamps.

    On the real clock this is Unix time: read once at the start of the run, then advanced by the monotonic clock, so
    that setting the system clock does not affect a run. On a virtual clock it is seconds since its loop was made, which
    is the start of `hfg.run(graph, clock="virtual")`.
    """
    return current_clock.get()()


def elapsed() -> float:
    """Return seconds since the start of the run that the caller's code belongs to; its nodes' `setup` begins at 0.

    Raises:
      NotRunning: the caller's code does not belong to a run.
    """
    clock = current_elapsed.get()
    if clock is None:
        raise NotRunning(
            "hfg.elapsed() counts from the start of the run whose code calls it, but was called outside a "
            "run: call it in a node, or use run.elapsed()"
        )
    return clock()
