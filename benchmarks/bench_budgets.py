"""How near the bound of `hfg check --time` comes to what is measured: the camera of examples/photographs.py.

Measured: in one run on the real clock, how long the firings of each node take, and how old a picture is when it has
  been searched. `bound`: what `analyse_time` says about that age, from the mean durations of this very run;
  `measured`: the mean age. `worst bound` and `worst` are the same of the longest ones. `on the loop`: one wave, which
  ends when the circles and lines have been put together. `in threads`: a thread for the camera and one for each of
  both searches; the ages are those behind each search, added up.
Not measured: in threads the join, whose mean age is that of the later search, which differs from picture to picture;
  the expensive branch of the example, which a gate lets rest most of the time. In threads the bound leaves out what
  the system takes to go from one thread to another, which on a busy machine is much: so that is no goal.
"""

from __future__ import annotations

from functools import partial

import hfg
from benchmarks.goals import Goal, Side
from benchmarks.measure import Case
from benchmarks.threaded import PHOTOGRAPHS, example
from hfg.analysis import Profile, analyse_time

DISTRIBUTIONS = ("hfg", "opencv-python-headless")
SHOWS_CASES = True
RUNS = 3
PICTURES = 8 * PHOTOGRAPHS
RATE_HZ = 8
DEADLINE_S = 0.25


def bounds_and_ages(in_threads: bool, pictures: int) -> dict[str, float]:
    """Milliseconds: what the bounds are, and what was measured."""
    graph = _camera(max(1, pictures // PHOTOGRAPHS), in_threads)
    ends = ("find_circles", "find_lines") if in_threads else ("see",)
    runs: list[hfg.Run] = []

    def begin(run: hfg.Run) -> None:
        run.statistics()
        runs.append(run)

    hfg.run(graph, begin=begin, block_warning_s=0)
    statistics = runs[0].statistics()
    profile, ages = Profile.of(graph, statistics), [statistics.nodes[name].latency for name in ends]
    mean = {path: one.mean_s for path, one in profile.nodes.items()}
    found = {
        "bound": _bound(graph, ends, mean),
        "measured": sum(age.mean_s for age in ages),
        "worst bound": _bound(graph, ends, profile.durations(graph)),
        "worst": sum(age.max_s for age in ages),
    }
    return {name: 1e3 * min(seconds, 2.0) for name, seconds in found.items()}  # the worst may have no bound


def _camera(looks: int, in_threads: bool) -> hfg.Graph:
    photographs = example()
    graph = hfg.Graph("camera")
    for group in ("camera", "circles", "lines"):
        graph.group(group, threads=int(in_threads))
    source = graph.add(
        photographs.photographs(looks=looks), group="camera" if in_threads else None, max_rate_hz=RATE_HZ
    )
    sight = graph.add(photographs.see(), deadline_s=DEADLINE_S)
    for branch, ksize, find in (("circles", 5, photographs.find_circles), ("lines", 3, photographs.find_lines)):
        home = branch if in_threads else None
        smooth = graph.add(photographs.smooth(ksize=ksize), group=home)
        found = graph.add(find(), group=home, deadline_s=DEADLINE_S)
        graph.connect(source.picture, smooth.src)
        graph.connect(smooth.out, found.picture)
        graph.connect(found.out, sight.ports.inputs[branch])
    for port in (source.ports.outputs["name"], source.picture):
        graph.connect(port, sight.ports.inputs[port.name])
    return graph


def _bound(graph: hfg.Graph, ends: tuple[str, ...], durations: dict[str, float]) -> float:
    return sum(path.within_s for path in analyse_time(graph, durations).paths if path.node in ends)


CASES = {
    name: Case(partial(bounds_and_ages, in_threads), PICTURES, "ms")
    for name, in_threads in (("on the loop", False), ("in threads", True))
}
SKIPPED: dict[str, str] = {}
GOALS = [
    Goal(f"on the loop, {one} / {other}", Side("on the loop", one), Side("on the loop", other), 1.1)
    for one, other in (("bound", "measured"), ("measured", "bound"))
]
