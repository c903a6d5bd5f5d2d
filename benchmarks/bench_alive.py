"""What activity costs: one chain of ten, alive in many ways, beside the same chain at rest.

Measured: processor time of a wave behind the first tenth, the two graphs in turn in one process, `ROUNDS` times there
  and back; a figure is the ratio of the medians. All rules are in force and nobody observes. Peers run the same steps
  with callbacks.
Not measured: start and end of the runs, and user code (each node passes on).
"""

from __future__ import annotations

import statistics
from collections.abc import Callable
from functools import partial
from importlib import import_module
from importlib.util import find_spec

import hfg
from benchmarks.alive import GRAPHS, Stopwatch, flat, states
from benchmarks.goals import Goal, Side
from benchmarks.measure import Case

WAVES = 20_000
STEPS = 5_000
ROUNDS = 5
DISTRIBUTIONS = ("hfg", "transitions")
SHOWS_CASES = True

Graph = Callable[[Stopwatch], hfg.Graph]


def by_hfg(graph: Graph, waves: int, **options: bool) -> float:
    """Microseconds a wave."""
    watch = Stopwatch(waves)
    hfg.run(graph(watch), block_warning_s=0, **options)  # type: ignore[arg-type]
    return watch.took


def ratio(ours: Callable[[], float], theirs: Callable[[], float]) -> dict[str, float]:
    """The ratio of the medians of runs in turn."""
    times: tuple[list[float], list[float]] = ([], [])
    for number in range(ROUNDS):
        for which in (0, 1) if number % 2 else (1, 0):
            times[which].append((ours, theirs)[which]())
    mine, other = (statistics.median(several) for several in times)
    return {"ratio": mine / other, "ours_us": mine, "theirs_us": other}


def beside_flat(graph: Graph, waves: int) -> dict[str, float]:
    """A graph beside the chain in which nothing is active."""
    return ratio(lambda: by_hfg(graph, waves), lambda: by_hfg(flat, waves))


def interpreted(waves: int) -> dict[str, float]:
    """The chain without short ways, beside itself with them."""
    return ratio(lambda: by_hfg(flat, waves, fast=False), lambda: by_hfg(flat, waves))


def beside_transitions(count: int, steps: int) -> dict[str, float]:
    """A ring of states, each step one firing and one call."""
    peer = import_module("benchmarks.peers.with_transitions").Transitions(count)
    return ratio(lambda: by_hfg(partial(states, count), steps), lambda: peer.step(steps)["cpu"])


CASES: dict[str, Case] = {}
GOALS: list[Goal] = []
SKIPPED: dict[str, str] = {}


def _goal(name: str, run: Callable[[int], dict[str, float]], size: int, at_most: float) -> None:
    CASES[name] = Case(run, size, "x")
    GOALS.append(Goal(name, Side(name, "ratio"), 1.0, at_most))


for _name, (_graph, _at_most) in GRAPHS.items():
    _goal(_name, partial(beside_flat, _graph), WAVES, _at_most)
CASES["interpreted"] = Case(interpreted, WAVES // 4, "x")
for _count in (10, 100):
    _name = f"a ring of {_count} states / transitions"
    if find_spec("transitions") is None:
        SKIPPED[_name] = "transitions is not installed"
    else:
        _goal(_name, partial(beside_transitions, _count), STEPS, 1.0)
