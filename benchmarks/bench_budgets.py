"""How near the bound of `hfg check --time` comes to what is measured: the camera of examples/photographs.py.

Measured: in one run on the real clock, how long the firings of each node take, and how old a picture is when both
  branches have been put together (`see`). `bound`: what `analyse_time` says about that age, from the mean durations of
  this very run; `measured`: the mean age. `worst bound` and `worst` are the same of the longest ones.
Not measured: the expensive branch behind `see`, which a gate lets rest most of the time.
"""

from __future__ import annotations

import hfg
from benchmarks.goals import Goal, Side
from benchmarks.measure import Case
from benchmarks.threaded import PHOTOGRAPHS, example
from hfg import commands
from hfg.analysis import Profile, analyse_time

DISTRIBUTIONS = ("hfg", "opencv-python-headless")
RUNS = 3
PICTURES = 8 * PHOTOGRAPHS
DEADLINE_S = 0.25

_CAMERA = "age of a picture"


def ages(pictures: int) -> dict[str, float]:
    """Milliseconds: what the bounds are, and what was measured."""
    graph = example().build()
    graph.edit(
        commands.SetParameter("camera.looks", max(1, pictures // PHOTOGRAPHS)),
        commands.SetEdge("find_circles.out", "see.circles", deadline_s=DEADLINE_S),
    )
    runs: list[hfg.Run] = []

    def begin(run: hfg.Run) -> None:
        run.statistics()
        runs.append(run)

    hfg.run(graph, begin=begin)
    statistics = runs[0].statistics()
    profile, age = Profile.of(graph, statistics), statistics.nodes["see"].latency
    mean = {path: one.mean_s for path, one in profile.nodes.items()}
    found = {
        "bound": _bound(graph, mean),
        "measured": age.mean_s,
        "worst bound": _bound(graph, profile.durations(graph)),
        "worst": age.max_s,
    }
    return {name: 1e3 * seconds for name, seconds in found.items()}


def _bound(graph: hfg.Graph, durations: dict[str, float]) -> float:
    return next(path.within_s for path in analyse_time(graph, durations).paths if path.node == "see")


CASES = {_CAMERA: Case(ages, PICTURES, "ms")}
GOALS = [
    Goal("the bound / the measured mean age", Side(_CAMERA, "bound"), Side(_CAMERA, "measured"), 1.1),
    Goal("the measured mean age / the bound", Side(_CAMERA, "measured"), Side(_CAMERA, "bound"), 1.1),
]
