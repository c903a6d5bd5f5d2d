"""A search inside a graph: each score allows the next candidate, and the trials run in the graph's own time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from hfg.errors import HfgError, RunError
from hfg.nodes import optimization, values
from hfg.testing import fire
from hfg.tuning import Judge
from hfg.tuning.losses import Loss
from hfg.tuning.methods import make_method
from hfg.tuning.space import read_range


class Bowl(hfg.Node):
    """Answers each candidate at once: it lies lowest at 1, -2."""

    wrong = hfg.Parameter(0)
    score = hfg.Event(float)
    nothing = hfg.Event()
    asked = hfg.State(0)

    @hfg.slot
    def candidate(self, candidate: list[float]) -> None:
        self.asked += 1
        if self.wrong and self.asked % self.wrong == 0:
            self.nothing.trigger()
        else:
            self.score.trigger((candidate[0] - 1) ** 2 + (candidate[1] + 2) ** 2)


def bowl(**options: Any) -> hfg.Graph:
    graph = hfg.Graph("bowl")
    wrong = options.pop("wrong", 0)
    usual = {"ranges": ("-5..5", "-5..5"), "values": 2, "evaluations": 120}
    search = graph.add(optimization.Optimize(**usual | options), name="search")
    plant = graph.add(Bowl(wrong=wrong), name="plant")
    graph.start.activates(search.begin)
    graph.connect(search.evaluate, plant.candidate)
    graph.connect(plant.score, search.ports.slots["score"])
    graph.connect(plant.nothing, search.failure)
    graph.connect(search.finished, graph.output("best", optimization.Found))
    return graph


def best_of(graph: hfg.Graph) -> optimization.Found:
    (best,) = hfg.run(graph, clock="virtual").outputs["best"]
    assert isinstance(best, optimization.Found)
    return best


@pytest.mark.parametrize("method", ["de", "random", "grid"])
def test_a_search_ends_with_the_best_candidate(method: str) -> None:
    best = best_of(bowl(method=method))
    assert best.score < (1 if method == "de" else 3)
    assert best.score == pytest.approx((best.values[0] - 1) ** 2 + (best.values[1] + 2) ** 2)


def test_the_search_asks_for_what_the_method_asks_for() -> None:
    """The same method with the same seed, asked and told by hand."""
    cells = [cell for _ in range(2) for cell in read_range("x", "-5..5").cells]
    method, best = make_method("de", cells, seed=7, batch=6, first=None, scores=1), math.inf
    for _ in range(4):
        asked = method.ask()
        scores = [(10 * x - 6) ** 2 + (10 * y - 3) ** 2 for x, y in asked]
        method.tell(asked, [Loss(0.0, (score,)) for score in scores])
        best = min(best, *scores)
    found = best_of(bowl(seed=7, batch=6, evaluations=24))
    assert found.score == pytest.approx(best)


def test_the_result_does_not_depend_on_how_many_candidates_are_out() -> None:
    assert best_of(bowl(ahead=1)) == best_of(bowl(ahead=5))


def test_candidates_without_a_score_are_worse_than_all_others() -> None:
    assert best_of(bowl(wrong=3)).score < 1


def test_large_scores_are_good_when_maximizing() -> None:
    assert best_of(bowl(maximize=True)).score > 60


def test_a_search_stops_when_it_is_told_to() -> None:
    graph = bowl()
    stop = graph.add(StopAfter(), name="stop")
    graph.connect(graph["search.evaluate"], stop.count)
    graph.connect(stop.enough, graph["search.stop"])
    best_of(graph)
    assert graph["plant"].asked <= 12


class StopAfter(hfg.Node):
    enough = hfg.Event()
    seen = hfg.State(0)

    @hfg.slot
    def count(self) -> None:
        self.seen += 1
        if self.seen == 10:
            self.enough.trigger()


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"values": 3}, "values has 3 events for 2 ranges: write values=2"),
        ({"ranges": ("-5..5", "five")}, "ranges[1]"),
        ({"wrong": 1}, "no candidate has a score"),
    ],
)
def test_wrong_use_is_one_sentence(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(RunError) as error:
        hfg.run(bowl(**options), clock="virtual")
    assert sentence in str(error.value)


def test_a_score_that_nobody_asked_for_is_refused() -> None:
    with pytest.raises(ValueError, match="no candidate is out"):
        fire(optimization.Optimize(), slot="score", value=1.0)


# --- a plant in the same graph ---


class Pendulum(hfg.Node):
    """Hangs on a motor; each trial begins at half a radian from where it shall stand upright."""

    torque = hfg.Parameter(0.0)
    error = hfg.Output(float)
    angle = hfg.State(0.5)
    speed = hfg.State(0.0)

    def process(self) -> float:
        for _ in range(2):
            self.speed += (9.81 * math.sin(self.angle) + self.torque - 0.1 * self.speed) * 0.005
            self.angle += self.speed * 0.005
        return -self.angle


def pendulum(evaluations: int = 60) -> hfg.Graph:
    graph = hfg.Graph("pendulum")
    search = graph.add(
        optimization.Optimize(
            ranges=("0..80", "0..80", "0..20"), values=3, evaluations=evaluations, method="de", seed=1
        ),
        name="search",
    )
    plant = graph.add(Pendulum(), name="plant", max_rate_hz=100)
    pid = graph.add(values.PID(lower=-30.0, upper=30.0), name="pid")
    trial = graph.add(optimization.Trial(duration_s=3.0), name="trial")
    graph.start.activates(search.begin)
    for port, gain in zip(search.values, ("kp", "ki", "kd"), strict=True):
        graph.connect(port, pid.ports.parameters[gain])
    search.evaluate.activates(trial.begin)
    graph.connect(trial.began, plant.reset)
    graph.connect(trial.began, pid.clear)
    graph.connect(plant.error, pid.error)
    graph.connect(plant.error, trial.value)
    graph.connect(pid.command.sent, plant.ports.parameters["torque"])
    trial.score.activates(search.ports.slots["score"])
    return graph


@pytest.mark.slow
def test_a_controller_is_tuned_while_its_plant_runs_in_the_same_graph() -> None:
    graph = pendulum()
    hfg.run(graph, clock="virtual", until_s=60 * 3.05)
    best = graph["search"].best
    assert best.score < 0.15
    assert [graph["pid"].kp, graph["pid"].ki, graph["pid"].kd] == best.values


# --- whole runs ---


@hfg.node
def square(*, x: float = 0.0, seed: int = 0) -> Iterator[float]:
    if x > 4:
        raise ValueError("too far")
    yield x * x + seed


def squares() -> hfg.Graph:
    graph = hfg.Graph("squares")
    graph.connect(graph.add(square(), name="square").out, graph.output("squared", float))
    return graph


judge = Judge(squares, ["square.x"], score="squared", seeds=[1, 3])


@hfg.node
def judged(candidate: list[float]) -> float:
    return judge(candidate)


@pytest.mark.slow
def test_whole_runs_in_processes_judge_candidates_several_at_a_time() -> None:
    graph = hfg.Graph("search")
    graph.group("judges", threads=2)
    search = graph.add(optimization.Optimize(ranges=("-3..3",), evaluations=16, batch=8, ahead=2), name="search")
    trial = graph.add(judged(), group="judges", concurrency=2)
    graph.start.activates(search.begin)
    graph.connect(search.evaluate, trial.candidate)
    graph.connect(trial.out, search.ports.slots["score"])
    graph.connect(search.finished, graph.output("best", optimization.Found))
    best = best_of(graph)
    assert best.score == pytest.approx(best.values[0] ** 2 + 2)


@pytest.mark.slow
def test_a_judge_says_why_a_candidate_has_no_score() -> None:
    with pytest.raises(HfgError, match="too far"):
        judge([5.0])
    with pytest.raises(HfgError, match="a candidate has 1 number"):
        judge([1.0, 2.0])
    with pytest.raises(HfgError, match='no parameter "square.y"'):
        Judge(squares, ["square.y"], score="squared")
