"""What missions are judged by; `test_machine.py` has the scores of whole missions."""

from __future__ import annotations

from collections.abc import Iterator

import hfg
from examples.fetch_delivery import judging


@hfg.node
def cubes() -> Iterator[int]:
    yield from range(9)


def test_a_run_ends_when_enough_cubes_are_delivered() -> None:
    graph = hfg.Graph("enough")
    enough = graph.add(judging.Enough(wanted=3), name="enough")
    graph.connect(graph.add(cubes(), max_rate_hz=1).out, enough.delivered)
    graph.connect(enough.reached, graph.stop)
    report = hfg.run(graph, clock="virtual")
    assert (report.outcome, report.duration_s) == ("stopped", 2.0)


def test_the_graph_that_is_tuned_is_sound() -> None:
    assert not [problem for problem in judging.deliveries().check() if problem.severity == "error"]
