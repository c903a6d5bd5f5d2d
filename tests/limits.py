"""How long tests wait for what must come: limits are for hangs only, so they are longer where the machine is slower.

No test is about speed. What waits by the clock on the wall takes its limit from here, and so does pytest-timeout.
`HFG_PATIENCE=20` makes all limits twenty times as long; by default the machine is measured as the tests begin.
"""

from __future__ import annotations

import os
import time
from functools import cache

__all__ = ["factor", "patience"]

_STEPS = 200_000
_USUAL_S = 0.012  # that so many steps take on a machine with nothing else to do
_LEAST, _MOST = 4.0, 60.0  # other work may come while the tests run


def patience(seconds: float) -> float:
    """Return how long to wait where `seconds` are enough on a fast machine with nothing else to do."""
    return seconds * factor()


@cache
def factor() -> float:
    """How much longer things may take here."""
    said = os.environ.get("HFG_PATIENCE")
    if said:
        return max(float(said), 1.0)
    began = time.monotonic()
    sum(range(_STEPS))
    for _ in range(_STEPS):
        pass
    return min(max(2 * (time.monotonic() - began) / _USUAL_S, _LEAST), _MOST)
