"""What time it is for a graph: seconds on the run's clock, and since the run began.

`now()` is the clock of the run that the caller's code belongs to, real or virtual; outside a run it is the loop's,
if that is in virtual time, else the real clock. `elapsed()` counts from the run's own start. Stands on nothing; the
engine brings the clocks (rule R6).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Final

from hfg.errors import NotRunning

__all__ = ["current_clock", "current_elapsed", "elapsed", "now", "time_told_by"]

current_clock: Final[ContextVar[Callable[[], float]]] = ContextVar("hfg.base.clock", default=time.time)
"""Set by the engine around the code of a run, on the loop and in threads."""

current_elapsed: Final[ContextVar[Callable[[], float] | None]] = ContextVar("hfg.elapsed", default=None)
"""The same, in seconds since the start of the run; None outside of one."""


@contextmanager
def time_told_by(clock: Callable[[], float]) -> Iterator[None]:
    """Inside the block, let a clock that began at 0 tell the time."""
    resets = current_clock.set(clock), current_elapsed.set(clock)
    try:
        yield
    finally:
        current_clock.reset(resets[0])
        current_elapsed.reset(resets[1])


def now() -> float:
    """Seconds on the current run's clock, the one of stamps.

    On the real clock Unix time, as it was when the run began and carried on by the machine's monotonic clock: a step of
    the system's clock does not touch a run. On a virtual one seconds since its loop was made, so since the start of
    `hfg.run(graph, clock="virtual")`.
    """
    return current_clock.get()()


def elapsed() -> float:
    """Seconds since the start of the run to which the caller's code belongs: its nodes' `setup` begins at 0.

    Raises:
      NotRunning: the caller's code belongs to no run.
    """
    clock = current_elapsed.get()
    if clock is None:
        raise NotRunning(
            "hfg.elapsed() counts from the start of the run whose code asks, and this is called outside of one: "
            "call it in a node, or ask the run itself, run.elapsed()"
        )
    return clock()
