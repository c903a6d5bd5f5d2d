"""Searches give the same result however they are carried out, and say in a sentence what is wrong."""

from __future__ import annotations

import os
import signal
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from annotated_types import Interval

import hfg
from hfg import monitors as m
from hfg.errors import UsageError
from hfg.tuning import Tuning, mean_of, read_parameter, sweep, tune
from hfg.tuning.losses import Loss, best_first, front
from hfg.tuning.methods import METHODS, make_method
from hfg.tuning.space import Cell

pytestmark = pytest.mark.slow

RANGES = ["hill.x=-2..2", "hill.y=-2..2"]


class Hill(hfg.Node):
    """The lowest place is at 1, -1, give or take what the seed says."""

    x = hfg.Parameter(0.0, Interval(ge=-5, le=5))
    y = hfg.Parameter(0.0, Interval(ge=-5, le=5))
    mode = hfg.Parameter("fast", choices=("fast", "good"))
    band = hfg.Parameter(hfg.Span(0.2, 0.8), Interval(ge=0, le=1))
    frame = hfg.Parameter(hfg.Colour(255, 128, 0))
    free = hfg.Parameter(1.0)
    seed = hfg.Parameter(1)
    height = hfg.Output(float)
    far = hfg.State(0.0)

    def process(self) -> float:
        self.far = abs(self.x) + abs(self.y)
        if self.x < -1.5:
            os.kill(os.getpid(), signal.SIGKILL)
        if self.y > 1.5:
            raise ValueError("too high")
        self.height.send((self.x - 1) ** 2 + (self.y + 1) ** 2 + 0.01 * self.seed)
        raise hfg.EndOfStream


def build() -> hfg.Graph:
    graph = hfg.Graph("hill")
    graph.connect(graph.add(Hill(), name="hill").height, graph.output("score", float))
    return graph


def search(**options: Any) -> Tuning:
    usual: dict[str, Any] = {"minimize": "score", "seeds": [1, 2], "evaluations": 17, "processes": 2}
    return tune(build, RANGES, **usual | options)


def told(found: Tuning) -> Sequence[object]:
    return [(one.values, one.means, one.why) for one in found.evaluations]


def test_the_result_does_not_depend_on_the_number_of_processes() -> None:
    assert told(search(processes=1)) == told(search(processes=3))


def test_a_search_that_was_cut_off_goes_on_to_the_same_result_and_journal(tmp_path: Path) -> None:
    whole, part = tmp_path / "whole", tmp_path / "part"
    first = search(journal=whole)
    text = whole.read_bytes()
    for share in (1, 4, 9):
        part.write_bytes(text[: len(text) * share // 10])  # as a process leaves it that is killed, mostly within a line
        assert told(search(journal=part)) == told(first)
        assert part.read_bytes() == text


def test_crashes_and_errors_are_counted_and_kept_with_their_seed() -> None:
    found = search(method="random", evaluations=24)
    assert found.outcomes["crashed"]
    assert found.outcomes["failed"]
    crashed = next(one for one in found.evaluations if "crashed" in one.why)
    assert crashed.why == "crashed with seed 1: its process ended by signal SIGKILL"
    assert crashed.values["hill.x"] < -1.5
    assert not found.best.failed


def test_a_candidate_that_violates_a_monitor_is_not_the_best() -> None:
    high = m.never(m.sent("hill.height", lambda height: height < 1))
    found = search(constraints={"high": high})
    assert found.outcomes["violated"]
    assert found.best.means[0].value >= 1


@pytest.mark.parametrize("method", sorted(METHODS))
def test_every_method_finds_better_values_than_those_before(method: str) -> None:
    pytest.importorskip({"cma": "cma", "tpe": "optuna"}.get(method, "hfg"))
    found = search(method=method, seeds=[1])
    assert found.best.means[0].value < found.before.means[0].value
    assert "<svg" in found.plot()


def test_two_scores_give_a_front_of_which_none_is_better_than_another() -> None:
    found = search(minimize=["score", "hill.far"])
    scores = [tuple(mean.value for mean in one.means) for one in found.front]
    assert len(scores) > 1
    assert sorted(scores) == sorted(scores, key=lambda pair: (-pair[1], pair[0]))


def test_new_seeds_confirm_a_gain() -> None:
    assert search().confirm([11, 12, 13]).is_certain


@pytest.mark.parametrize(
    ("parameter", "options", "sentence"),
    [
        ("hill.z=0..1", {}, 'has no parameter "hill.z"'),
        ("hill.free", {}, "has no limits: write hill.free=LOW..HIGH"),
        ("hill.x=-9..9", {}, "must be >= -5, got -9"),
        ("hill.x=2..1", {}, "write the smaller number first"),
        ("hill.mode=slow", {}, "must be one of 'fast', 'good'"),
        ("hill.x=0..1", {"minimize": "hill.depth"}, 'no score "hill.depth"'),
        ("hill.x=0..1", {"minimize": ()}, "nothing to judge by"),
        ("hill.x=0..1", {"method": "luck"}, 'no method "luck"'),
        ("hill.x=0..1", {"seeds": [1, 1]}, "has a number twice"),
    ],
)
def test_wrong_use_is_one_sentence(parameter: str, options: dict[str, Any], sentence: str) -> None:
    usual: dict[str, Any] = {"minimize": "score", "evaluations": 3, "processes": 1}
    with pytest.raises(UsageError) as error:
        tune(build, [parameter], **usual | options)
    assert sentence in str(error.value)


@pytest.mark.rule("L4")
@pytest.mark.parametrize("text", [b"\x80\x04pickle\n", b"{}\n", b"[" * 100_000 + b"\n", b'{"journal": 1}\n'])
def test_a_file_that_is_no_journal_is_refused(tmp_path: Path, text: bytes) -> None:
    (tmp_path / "journal").write_bytes(text)
    with pytest.raises(UsageError, match="not the journal of a search"):
        search(journal=tmp_path / "journal")


def test_the_journal_of_another_search_is_refused(tmp_path: Path) -> None:
    search(journal=tmp_path / "journal", evaluations=2)
    with pytest.raises(UsageError, match="its seed is 1, not 2"):
        search(journal=tmp_path / "journal", seed=2)


def test_a_score_that_is_no_number_is_no_score() -> None:
    found = search(minimize=lambda finished: float("nan"), evaluations=2)
    assert found.outcomes == {"no score": 4}
    assert "is nan" in found.best.why


@pytest.mark.parametrize("said", ["hill.x=-2..2", "hill.mode", "hill.band", "hill.frame", "hill.seed=1..9"])
def test_values_become_numbers_and_values_again(said: str) -> None:
    tuned = read_parameter(build(), said)
    value = tuned.make([cell.value(0.7) for cell in tuned.cells])
    assert tuned.spec.check(value) is None
    numbers = tuned.take(value)
    assert numbers is not None
    again = tuned.make([cell.value(cell.unit(one)) for cell, one in zip(tuned.cells, numbers, strict=True)])
    assert tuned.as_text(again) == tuned.as_text(value)


def test_a_sweep_has_a_row_for_each_combination() -> None:
    table = sweep(build, ["hill.x=0,1", "hill.mode"], scores="score", seeds=[1, 2, 3], processes=2)
    assert len(table.rows) == 4
    assert table.cells()[0] == ["0", "fast", "2.02 ± 0.025", "3", "0"]


def test_means_have_the_interval_of_student() -> None:
    assert mean_of([1.0, 2.0, 3.0]).within == pytest.approx(4.303 / 3**0.5)


def test_a_sweep_that_was_cut_off_goes_on_to_the_same_table_and_journal(tmp_path: Path) -> None:
    def table(journal: Path) -> object:
        told = sweep(
            build, ["hill.x=0,1"], scores="score", seeds=[1, 2], faults=["hill.x=2@0", "hill.y=1@0"], journal=journal
        )
        return told.cells()

    first, text = table(tmp_path / "whole"), (tmp_path / "whole").read_bytes()
    for share in (0, 3, 7, 10):
        (tmp_path / "part").write_bytes(text[: len(text) * share // 10])
        assert table(tmp_path / "part") == first
        assert (tmp_path / "part").read_bytes() == text


def test_equal_runs_are_carried_out_once() -> None:
    """The values before are the first member of a population, too, and a choice has few values."""
    found = tune(build, ["hill.mode"], minimize="score", seeds=[1, 2], evaluations=9, processes=2)
    assert len(found.evaluations) == 9
    assert found.effort.runs == 4


def test_failures_are_worse_than_any_score() -> None:
    losses = [Loss(0.5), Loss(0.0, (2.0, 1.0)), Loss(0.0, (1.0, 2.0)), Loss(0.0, (3.0, 3.0)), Loss(1.0)]
    assert front(losses) == [1, 2]
    assert best_first(losses)[2:] == [3, 0, 4]


def test_a_grid_has_every_combination_once() -> None:
    grid = make_method("grid", [Cell(options=3), Cell()], seed=1, batch=100, first=None, scores=1)
    assert len({tuple(one) for one in grid.ask()}) == 15
    assert not grid.ask()
