"""Tables of what if: every combination of listed values and of what happens, run with the same seeds.

Depends on `searching` and `tuning`.
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from hfg.errors import UsageError
from hfg.graph import Graph
from hfg.tuning.evaluating import Constraints, Problem, Told, seed_parameters
from hfg.tuning.happenings import read_happening
from hfg.tuning.scores import Score, ScoreLike
from hfg.tuning.searching import Candidate, Effort, Evaluation, Searching
from hfg.tuning.space import Space, Tuned, read_parameter
from hfg.tuning.tuning import built, header_of, journal_at, read_scores, read_seeds
from hfg.tuning.workers import usual_processes

_MOST_ROWS: Final = 100_000


@dataclass(frozen=True)
class Row:
    """One combination.

    Attributes:
      fault: what happens in its runs; "" for nothing.
      evaluation: its values and runs. Means are over the runs that have a score.
    """

    fault: str
    evaluation: Evaluation


@dataclass(frozen=True)
class Sweep:
    """The table.

    Attributes:
      scores: the columns on the right.
      tuned: the parameters, the columns on the left.
      rows: the combinations, in order.
      effort: what they cost.
    """

    scores: Sequence[Score]
    tuned: Sequence[Tuned]
    rows: Sequence[Row]
    effort: Effort

    @property
    def heads(self) -> list[str]:
        """The heads of the columns."""
        faults = ["fault"] if any(row.fault for row in self.rows) else []
        return [
            *(one.path for one in self.tuned),
            *faults,
            *(one.name for one in self.scores),
            "runs",
            "without a score",
        ]

    def cells(self) -> list[list[str]]:
        """Return the cells as texts; a score is its mean and half its 95 % confidence interval."""
        found = []
        for row in self.rows:
            one = row.evaluation
            values = [each.as_text(one.values[each.path]) for each in self.tuned]
            faults = [row.fault or "none"] if "fault" in self.heads else []
            scores = [str(mean) if mean.runs else "none" for mean in one.means]
            failed = sum(run.outcome != "ok" for run in one.runs.values())
            found.append([*values, *faults, *scores, str(len(one.runs)), f"{failed} ({one.why})" if failed else "0"])
        return found

    def as_data(self) -> list[dict[str, Any]]:
        """Return the rows as plain data."""
        return [
            {
                "values": {each.path: each.as_data(row.evaluation.values[each.path]) for each in self.tuned},
                "fault": row.fault or None,
                "scores": {
                    score.name: {"mean": mean.value, "within": mean.within, "runs": mean.runs}
                    for score, mean in zip(self.scores, row.evaluation.means, strict=True)
                },
                "runs": [
                    {"seed": seed, "outcome": told.outcome, "scores": told.scores, "why": told.why}
                    for seed, told in row.evaluation.runs.items()
                ],
            }
            for row in self.rows
        ]


def sweep(
    build: Callable[[], Graph],
    parameters: Sequence[str] = (),
    *,
    scores: ScoreLike | Sequence[ScoreLike],
    seeds: Sequence[int] = (),
    seed_parameter: str | None = None,
    faults: Sequence[str] = (),
    constraints: Constraints | None = None,
    until_s: float | None = None,
    processes: int | None = None,
    journal: str | os.PathLike[str] | None = None,
    patience_s: float | None = None,
    told: Callable[[Told], object] | None = None,
) -> Sweep:
    """Run every combination of values and faults with every seed, in virtual time.

    Args:
      build: returns a new graph.
      parameters: each with its values, as in "pid.kp=10,20" or "pid.kp=10..50/5".
      scores: what each run is judged by; see `tune`.
      seeds: each combination runs once with each.
      seed_parameter: gets the seed; by default every parameter with the name "seed".
      faults: what may happen, "world.push_robot@30" or "world.light=0.1@30"; a combination without any is included.
      constraints: monitors; a run that violates one has no score.
      until_s: ends each run.
      processes: how many runs at a time.
      journal: a file for all runs, from which a sweep that was killed continues.
      patience_s: a run that takes longer on the clock of the wall is ended.
      told: called with each run.

    Returns:
      The table.

    Raises:
      UsageError: a parameter, fault, score or option does not fit, or there are too many combinations.
      OSError: the journal cannot be used.
    """
    graph = built(build)
    space = Space(read_parameter(graph, one) for one in parameters)
    happenings = [read_happening(graph, one) for one in faults]
    combinations = _combinations(space.tuned, _MOST_ROWS // (1 + len(happenings)))
    every, judged = read_seeds(seeds), read_scores(scores, ())
    paths = seed_parameters(graph, seed_parameter) if seeds else []
    problem = Problem(build, space, judged, paths, until_s, constraints or {}, happenings)
    header = header_of(problem, parameters, "sweep", 0, None, every, graph.name)
    candidates = [
        Candidate(number, at, space.values(at), happening)
        for number, (happening, at) in enumerate(itertools.product(range(-1, len(happenings)), combinations))
    ]
    with Searching(
        problem,
        every,
        journal_at(journal, header),
        processes or usual_processes(),
        patience_s,
        told or (lambda _: None),
    ) as searching:
        found = searching.evaluate(candidates)
    names = [*(one.name for one in happenings), ""]  # the last for -1
    rows = [Row(names[one.candidate.happening], one.over_good(len(judged))) for one in found]
    return Sweep(judged, space.tuned, rows, searching.effort)


def _combinations(tuned: Sequence[Tuned], most: int) -> list[list[float]]:
    """Return every combination of the listed values, each as its place in the unit cube.

    Raises:
      UsageError: a parameter has any number of values, or there are too many combinations.
    """
    for one in tuned:
        if not all(cell.levels for cell in one.cells):
            raise UsageError(
                f'parameter "{one.path}" has any number of values: list some, as in {one.path}=1,2, or '
                f"{one.path}=1..2/5 for five"
            )
    units = [[(index + 0.5) / cell.levels for index in range(cell.levels)] for one in tuned for cell in one.cells]
    count = math.prod(map(len, units))
    if count > most:
        raise UsageError(f"there are {count:,} combinations for each fault and for none; a sweep has {most:,} at most")
    return [list(one) for one in itertools.product(*units)]
