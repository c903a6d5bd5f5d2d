"""How much faster a search is on two processors than on one, by the clock on the wall.

Measured: `hfg.tuning.tune` of examples/follow_path.py with one process and with two, in turn, and the ratio of both.
They must find the same, or the case fails. The machine has to be quiet: `python -m benchmarks bench_tuning`.
"""

from __future__ import annotations

import time
from typing import Any

from benchmarks.goals import Goal, Side
from benchmarks.measure import Case
from examples.follow_path import build
from hfg import tuning

DISTRIBUTIONS = ("hfg",)
SHOWS_CASES = True
PARAMETERS = ("follow.look_ahead=0.1..2", "follow.speed=0.2..1.5", "follow.slow=0.3..5", "follow.turn_limit=0.5..4")


def two_beside_one(evaluations: int) -> dict[str, float]:
    """The time with two processes, relative to that with one; both in microseconds for each candidate."""
    found: set[Any] = set()

    def with_processes(count: int) -> float:
        began = time.perf_counter()
        best = tuning.tune(
            build, PARAMETERS, minimize="robot.cost", seeds=[1, 2, 3], evaluations=evaluations, processes=count
        ).best
        found.add((best.number, best.means[0].value))
        return (time.perf_counter() - began) * 1e6 / evaluations

    one, two = with_processes(1), with_processes(2)
    if len(found) > 1:
        raise RuntimeError(f"the result depends on the number of processes: {found}")
    return {"ratio": two / one, "two_us": two, "one_us": one}


_TWO = "a search with two processes / with one, by the clock on the wall"
CASES = {_TWO: Case(two_beside_one, 33, "x")}
SKIPPED: dict[str, str] = {}
GOALS = [Goal(_TWO, Side(_TWO, "ratio"), 1.0, 1 / 1.8)]
