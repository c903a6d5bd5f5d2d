"""What time it is for a graph: seconds on the run's clock.

`now()` is the clock of the run that the caller's code belongs to, real or virtual; outside a run it is the loop's,
if that is in virtual time, else the real clock. Stands on nothing; the engine brings the clocks (rule R6).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from contextvars import ContextVar
from typing import Final

__all__ = ["current_clock", "now"]

current_clock: Final[ContextVar[Callable[[], float]]] = ContextVar("hfg.clock", default=time.time)
"""Set by the engine around the code of a run, on the loop and in threads."""


def now() -> float:
    """Seconds on the current run's clock: Unix time on the real clock, seconds since the run began on a virtual one."""
    return current_clock.get()()
