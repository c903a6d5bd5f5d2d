"""Judges candidates one by one, for searches that are nodes of a graph. Depends on `evaluating` and `workers`."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence

import msgspec

from hfg.errors import HfgError, UsageError
from hfg.graph import Graph
from hfg.graph.structure.naming import suggest
from hfg.tuning.evaluating import Constraints, Problem, Told, evaluate, seed_parameters
from hfg.tuning.scores import ScoreLike
from hfg.tuning.space import Space, Tuned, find_parameters
from hfg.tuning.tuning import built, read_scores, read_seeds
from hfg.tuning.workers import Died, in_process


class Judge:
    """Sets numbers in a graph, runs it, and returns its score.

    A node calls it for each candidate that `hfg.nodes.optimization.Optimize` sends. It waits for processes, so put the
    node into a group with threads.

    Examples:
      >>> import hfg
      >>> from hfg.testing.nodes import sink
      >>> @hfg.node
      ... def square(*, x: float = 0.0):
      ...     yield x * x
      >>> def build() -> hfg.Graph:
      ...     graph = hfg.Graph()
      ...     graph.connect(graph.add(square()).out, graph.output("squared", float))
      ...     return graph
      >>> Judge(build, ["square.x"], score="squared")([3.0])
      9.0
    """

    def __init__(
        self,
        build: Callable[[], Graph],
        parameters: Sequence[str],
        *,
        score: ScoreLike,
        seeds: Sequence[int] = (),
        seed_parameter: str | None = None,
        constraints: Constraints | None = None,
        until_s: float | None = None,
        patience_s: float | None = None,
    ) -> None:
        """Look at the graph once.

        Args:
          build: returns a new graph for each run.
          parameters: the paths of those that get the numbers, in order; whole numbers are rounded.
          score: what a run is judged by; see `tune`.
          seeds: each candidate runs once with each; its score is the mean.
          seed_parameter: gets the seed; by default every parameter with the name "seed".
          constraints: monitors that must hold.
          until_s: ends each run.
          patience_s: a run that takes longer on the clock of the wall is ended.

        Raises:
          UsageError: a parameter, score or seed does not fit.
        """
        graph = built(build)
        known = find_parameters(graph)
        for path in parameters:
            if path not in known:
                raise UsageError(f'graph "{graph.name}" has no parameter "{path}"; {suggest(path, known)}')
            if known[path].spec.kind not in ("int", "float"):
                raise UsageError(f'parameter "{path}" is of kind {known[path].spec.kind}, and a candidate has numbers')
        space = Space(Tuned(path, (path,), known[path].spec, (), tuple, list) for path in parameters)
        paths = seed_parameters(graph, seed_parameter) if seeds else []
        self._problem = Problem(build, space, read_scores(score, ()), paths, until_s, constraints or {})
        self._seeds, self._patience_s = read_seeds(seeds), patience_s

    def __call__(self, candidate: Sequence[float]) -> float:
        """Return the score of a candidate.

        Raises:
          UsageError: the candidate has more or fewer numbers than there are parameters.
          HfgError: a run has no score; the text says why.
        """
        tuned = self._problem.space.tuned
        if len(candidate) != len(tuned):
            raise UsageError(f"a candidate has {len(tuned)} numbers, one for each parameter, got {len(candidate)}")
        return statistics.fmean(self._run(msgspec.json.encode((list(candidate), seed))) for seed in self._seeds)

    def _run(self, task: bytes) -> float:
        answer = in_process(self._work, task, self._patience_s)
        if isinstance(answer, Died):
            raise answer
        told = msgspec.json.decode(answer, type=Told)
        if told.outcome != "ok":
            raise HfgError(f"the candidate has no score, {told.outcome}: {told.why}")
        return told.scores[0]

    def _work(self, task: bytes) -> bytes:
        """Do this in a process of its own."""
        candidate, seed = msgspec.json.decode(task)
        values = {
            one.path: round(number) if one.spec.kind == "int" else float(number)
            for one, number in zip(self._problem.space.tuned, candidate, strict=True)
        }
        return msgspec.json.encode(evaluate(self._problem, values, seed))
