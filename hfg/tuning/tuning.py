"""Searches for the parameters of a graph that make a score smallest or largest.

Depends on `searching`, `methods` and `space`.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from hfg.errors import UsageError
from hfg.graph import Graph
from hfg.tuning.evaluating import Constraints, Problem, Told, seed_parameters
from hfg.tuning.figures import Mean, paired
from hfg.tuning.journal import Header, Journal
from hfg.tuning.losses import best_first, front
from hfg.tuning.methods import Method, make_method
from hfg.tuning.plotting import plot
from hfg.tuning.scores import Score, ScoreLike, read_score
from hfg.tuning.searching import Candidate, Effort, Evaluation, Searching
from hfg.tuning.space import Space, read_parameter
from hfg.tuning.workers import usual_processes

_FORM: Final = 1
_MOST_SEEDS: Final = 10_000


@dataclass(frozen=True)
class Confirmation:
    """The best values against the values before, on the same seeds.

    Attributes:
      before: the values that the graph had.
      best: the best ones.
      gains: for each score, by how much the best values are better: the mean over the pairs of runs with the same seed.
    """

    before: Evaluation
    best: Evaluation
    gains: Sequence[Mean]

    @property
    def is_certain(self) -> bool:
        """Whether each gain is outside the noise: its confidence interval is above 0."""
        return bool(self.gains) and all(one.value > one.within for one in self.gains)


class Tuning:
    """What a search has found.

    Attributes:
      evaluations: all candidates, in order; the first has the values that the graph had before.
      scores: what was searched for.
      effort: what it cost, without what was in the journal.
    """

    def __init__(self, searching: Searching, evaluations: list[Evaluation]) -> None:
        self.evaluations = evaluations
        self.scores = searching.problem.scores
        self.effort: Effort = searching.effort
        self._searching = searching

    @property
    def before(self) -> Evaluation:
        """The values that the graph had."""
        return self.evaluations[0]

    @property
    def best(self) -> Evaluation:
        """The best candidate; with several scores, one of the front."""
        return self.evaluations[best_first(self._losses())[0]]

    @property
    def front(self) -> list[Evaluation]:
        """The candidates of which no other is better in all scores."""
        return [self.evaluations[index] for index in front(self._losses()) if not self.evaluations[index].failed]

    @property
    def outcomes(self) -> dict[str, int]:
        """How many runs went how."""
        return dict(Counter(run.outcome for one in self.evaluations for run in one.runs.values()))

    @property
    def space(self) -> Space:
        """The parameters."""
        return self._searching.problem.space

    def apply(self, graph: Graph, evaluation: Evaluation | None = None) -> None:
        """Set the best values, or those of another candidate, in a graph that is not running."""
        self.space.apply(graph, (evaluation or self.best).values)

    def confirm(self, seeds: Sequence[int], *, processes: int | None = None) -> Confirmation:
        """Run the values before and the best ones with new seeds: those of the search have helped to choose.

        Args:
          seeds: of the runs.
          processes: how many runs at a time.

        Raises:
          UsageError: the graph takes no seed.
        """
        known = self._searching
        if not known.problem.seed_paths:
            raise UsageError("runs without a seed are all the same, so there is nothing to confirm: tune with seeds=")
        again = Searching(
            known.problem,
            read_seeds(seeds),
            journal_at(None, header_of(known.problem, [], "", 0, None, [])),
            processes or known.processes,
            known.patience_s,
        )
        with again:
            before, best = again.evaluate([self.before.candidate, self.best.candidate])
        gains = []
        if not (before.failed or best.failed):
            for number, score in enumerate(self.scores):
                gain = paired(before.scores(number), best.scores(number))
                gains.append(gain._replace(value=score.loss(gain.value)))
        return Confirmation(before, best, gains)

    def plot(self) -> str:
        """Return an SVG drawing: scores by candidate and by parameter, or two scores with their front."""
        return plot(self.scores, self.space, self.evaluations, self.front)

    def __str__(self) -> str:
        """The best values, the values before, and how many runs failed."""
        lines = [f"{'best' if one.number != 0 else 'before'}: {self._line(one)}" for one in self._shown()]
        if self.before not in self._shown():
            lines.append(f"before: {self._line(self.before)}")
        failed = {name: count for name, count in self.outcomes.items() if name != "ok"}
        if failed:
            told = ", ".join(f"{count} {name}" for name, count in sorted(failed.items()))
            first = next(one for one in self.evaluations if one.failed)
            lines.append(f"runs without a score: {told}; the first is candidate {first.number}, {first.why}")
        return "\n".join(lines)

    def _shown(self) -> list[Evaluation]:
        return [self.best] if len(self.scores) == 1 else self.front

    def _line(self, one: Evaluation) -> str:
        scores = ", ".join(f"{score.name} {mean}" for score, mean in zip(self.scores, one.means, strict=False))
        return f"{scores or one.why} with {self.space.as_text(one.values)}"

    def _losses(self) -> list[Any]:
        return [self._searching.loss(one) for one in self.evaluations]


def tune(
    build: Callable[[], Graph],
    parameters: Sequence[str],
    *,
    minimize: ScoreLike | Sequence[ScoreLike] = (),
    maximize: ScoreLike | Sequence[ScoreLike] = (),
    seeds: Sequence[int] = (),
    seed_parameter: str | None = None,
    constraints: Constraints | None = None,
    method: str = "de",
    evaluations: int = 200,
    batch: int | None = None,
    seed: int = 1,
    until_s: float | None = None,
    processes: int | None = None,
    journal: str | os.PathLike[str] | None = None,
    patience_s: float | None = None,
    tell: Callable[[Evaluation], object] | None = None,
    told: Callable[[Told], object] | None = None,
) -> Tuning:
    """Search for the parameters that make a score smallest or largest.

    Each candidate runs in virtual time, once for each seed, on a fresh graph in a process of its own. The result is the
    same for any number of processes, as the size of a generation belongs to the search.

    Args:
      build: returns a new graph.
      parameters: each as in "pid.kp=0.1..10"; `hfg.tuning.read_parameter` describes the forms.
      minimize: scores that should be small: "plant.error.rms", a state "plant.cost", an output of the graph, or a
        function of `hfg.tuning.Finished`.
      maximize: scores that should be large. With several scores, the result is a Pareto front.
      seeds: a candidate runs once with each; its score is the mean.
      seed_parameter: gets the seed; by default every parameter with the name "seed".
      constraints: monitors that must hold, by name, or a function that returns them.
      method: "de" (differential evolution), "cma" (CMA-ES), "tpe" (Parzen estimators), "grid" or "random".
      evaluations: how many candidates at most, that with the values before included.
      batch: candidates of a generation; None for what is usual for the method.
      seed: of the method.
      until_s: ends each run.
      processes: how many runs at a time; None for as many as there are processors. The result does not depend on it.
      journal: a file for all runs, from which a search that was killed continues.
      patience_s: a run that takes longer on the clock of the wall is ended and counts as failed. It makes results
        depend on the machine.
      tell: called with each candidate.
      told: called with each run.

    Returns:
      All candidates, the best of them, and the front.

    Raises:
      UsageError: a parameter, score or option does not fit.
      OSError: the journal cannot be used.
    """
    graph = built(build)
    space = Space(read_parameter(graph, one) for one in parameters)
    if not space.tuned:
        raise UsageError("there is nothing to search: name at least one parameter, as in pid.kp=0..10")
    _need_count("evaluations", evaluations, "how many candidates to try")
    if batch is not None:
        _need_count("batch", batch, "how many candidates a generation has")
    every = read_seeds(seeds)
    paths = seed_parameters(graph, seed_parameter) if seeds else []
    problem = Problem(build, space, read_scores(minimize, maximize), paths, until_s, constraints or {})
    present = space.present(graph)
    first = space.units(present)
    search = make_method(method, space.cells, seed=seed, batch=batch, first=first, scores=len(problem.scores))
    header = header_of(problem, parameters, method, seed, batch, every, graph.name)
    before = Candidate(0, [-1.0] * len(space.cells) if first is None else first, present)
    with Searching(
        problem, every, journal_at(journal, header), processes or usual_processes(), patience_s, told or _ignore
    ) as searching:
        return Tuning(searching, list(_searched(searching, search, before, evaluations, tell or _ignore)))


def _searched(
    searching: Searching, search: Method, before: Candidate, most: int, tell: Callable[[Evaluation], object]
) -> Iterator[Evaluation]:
    """Yield the evaluation of the values before, then those of one generation after the other."""
    first, count = [before], 0
    while count < most:
        asked = search.ask()
        some = asked[: most - count - len(first)]
        at = count + len(first)
        candidates = [Candidate(at + i, one, searching.problem.space.values(one)) for i, one in enumerate(some)]
        found = searching.evaluate([*first, *candidates])
        for one in found:
            tell(one)
            yield one
        if not asked or len(some) < len(asked):
            return
        search.tell(asked, [searching.loss(one) for one in found[len(first) :]])
        first, count = [], at + len(some)


def _need_count(name: str, value: object, what: str) -> None:
    if type(value) is not int or value < 1:
        raise UsageError(f"{name}= is {what}, 1 at least, got {value!r}")


def built(build: Callable[[], Graph]) -> Graph:
    """Build the graph once, to see what parameters it has.

    Raises:
      UsageError: `build` is not a function that returns a graph.
    """
    given: object = build
    if isinstance(given, Graph) or not callable(given):
        raise UsageError(
            f"build is a function that returns a new graph for each run, got {build!r:.80}: write def build() -> "
            "hfg.Graph: ... around it"
        )
    graph: object = build()
    if not isinstance(graph, Graph):
        raise UsageError(f"build returned {graph!r:.80}, not a graph: let it return the graph that it builds")
    return graph


def read_scores(minimize: ScoreLike | Sequence[ScoreLike], maximize: ScoreLike | Sequence[ScoreLike]) -> list[Score]:
    """Return the scores as users name them.

    Raises:
      UsageError: there is none.
    """
    found = []
    for said, more_is_better in ((minimize, False), (maximize, True)):
        each = [said] if isinstance(said, str) or callable(said) else list(said)
        found += [read_score(one, maximize=more_is_better) for one in each]
    if not found:
        raise UsageError("there is nothing to judge by: name a score in minimize= or maximize=")
    return found


def read_seeds(seeds: Sequence[int]) -> list[int | None]:
    """Return the seeds of each candidate; without any, each runs once as it is.

    Raises:
      UsageError: a seed is negative, not an integer, or listed twice.
    """
    found = list(seeds)
    if len(found) > _MOST_SEEDS or any(type(one) is not int or one < 0 for one in found):
        raise UsageError(f"seeds= are whole numbers from 0, {_MOST_SEEDS:,} at most, got {seeds!r:.80}")
    if len(set(found)) < len(found):
        raise UsageError(f"seeds= has a number twice, which would be the same run: {seeds!r:.80}")
    return [*found] if found else [None]


def journal_at(path: str | os.PathLike[str] | None, header: Header) -> Journal:
    """Open the journal of a search.

    Raises:
      UsageError: it is the journal of another search, or no journal.
      OSError: it cannot be read or written.
    """
    return Journal(None if path is None else Path(path), header)


def header_of(
    problem: Problem,
    parameters: Sequence[str],
    method: str,
    seed: int,
    batch: int | None,
    seeds: list[int | None],
    graph: str = "",
) -> Header:
    """Return what identifies a search in its journal."""
    return Header(
        journal=_FORM,
        graph=graph,
        parameters=list(parameters),
        scores=[f"{'maximize' if one.maximize else 'minimize'} {one.name}" for one in problem.scores],
        seeds=seeds,
        constraints=list(_names(problem.properties())),
        happenings=[one.name for one in problem.happenings],
        method=method,
        seed=seed,
        batch=batch,
        until_s=problem.until_s,
    )


def _names(properties: Mapping[str, Any]) -> list[str]:
    return [f"{name}: {what}" for name, what in properties.items()]


def _ignore(told: object) -> None:
    """Do nothing."""
