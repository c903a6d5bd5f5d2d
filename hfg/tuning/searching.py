"""Runs candidates of one problem in processes, and keeps the journal: what a tuning and a sweep have in common.

Depends on `evaluating`, `workers` and `journal`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import TracebackType
from typing import Any

import msgspec

from hfg.errors import UsageError
from hfg.tuning.evaluating import Problem, Told, evaluate
from hfg.tuning.figures import Mean, mean_of
from hfg.tuning.journal import Journal, Line
from hfg.tuning.losses import Loss
from hfg.tuning.workers import Died, Workers

Seed = int | None


@dataclass(frozen=True)
class Candidate:
    """What is to be evaluated.

    Attributes:
      number: from 0.
      at: numbers from 0 to 1, for the journal.
      values: of the parameters, by path.
      happening: the number of what happens in its runs; -1 for nothing.
    """

    number: int
    at: Sequence[float]
    values: Mapping[str, Any]
    happening: int = -1


@dataclass(frozen=True)
class Evaluation:
    """A candidate, and how its runs went.

    Attributes:
      candidate: what was evaluated.
      runs: by seed.
      means: of each score over the runs, in the order of the scores; nothing if a run failed.
    """

    candidate: Candidate
    runs: Mapping[Seed, Told]
    means: Sequence[Mean]

    @property
    def number(self) -> int:
        """The number of the candidate."""
        return self.candidate.number

    @property
    def values(self) -> Mapping[str, Any]:
        """The values of the parameters, by path."""
        return self.candidate.values

    @property
    def failed(self) -> float:
        """The share of the runs that have no score."""
        return sum(one.outcome != "ok" for one in self.runs.values()) / len(self.runs)

    @property
    def why(self) -> str:
        """Why the first of the failed runs failed, with its seed; "" if none has."""
        for seed, one in self.runs.items():
            if one.outcome != "ok":
                return f"{one.outcome}{'' if seed is None else f' with seed {seed}'}: {one.why}"
        return ""

    def scores(self, number: int = 0) -> list[float]:
        """Return one score of each run that has it, in the order of the seeds."""
        return [one.scores[number] for one in self.runs.values() if one.outcome == "ok"]

    def over_good(self, scores: int) -> Evaluation:
        """Return the same with means over the runs that have scores, even if others failed.

        Args:
          scores: how many there are.
        """
        return replace(self, means=[mean_of(self.scores(number)) for number in range(scores)])


@dataclass
class Effort:
    """What evaluations have cost.

    Attributes:
      runs: that were not in the journal.
      simulated_s: how long they lasted on their own clocks.
      worked_s: how long they took, each by itself.
      took_s: how long all took together, on the clock of the wall.
    """

    runs: int = 0
    simulated_s: float = 0.0
    worked_s: float = 0.0
    took_s: float = 0.0

    def add(self, told: Told, waited_s: float) -> None:
        """Count one more run, and how long its result was waited for."""
        self.runs += 1
        self.simulated_s += told.simulated_s
        self.worked_s += told.took_s
        self.took_s += waited_s

    def __str__(self) -> str:
        """Say it in a line."""
        if not self.runs:
            return "all runs were in the journal"
        lasted = self.simulated_s / self.runs
        each, speed = self.worked_s / self.runs, self.simulated_s / max(self.worked_s, 1e-9)
        return (
            f"{self.runs} runs in {self.took_s:.1f} s; a run takes {each:.3g} s for {lasted:.4g} s "
            f"of virtual time, {speed:.3g} times as fast as real time"
        )


@dataclass
class Searching:
    """Evaluates candidates; use it in a `with` block.

    Attributes:
      problem: what is searched for.
      seeds: of the runs of each candidate.
      journal: answers for what was run before, and keeps what is run.
      processes: how many runs at a time.
      patience_s: a run that takes longer is ended.
      told: called after each run.
      effort: so far.
    """

    problem: Problem
    seeds: Sequence[Seed]
    journal: Journal
    processes: int
    patience_s: float | None = None
    told: Callable[[Told], object] = lambda told: None
    effort: Effort = field(default_factory=Effort)

    def __post_init__(self) -> None:
        self._known: dict[bytes, Told] = {}
        self._workers: Workers | None = None

    def __enter__(self) -> Searching:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._workers is not None:
            self._workers.__exit__(kind, error, trace)
            self._workers = None
        self.journal.close()

    def evaluate(self, candidates: Sequence[Candidate]) -> list[Evaluation]:
        """Evaluate candidates, as many runs at a time as there are processes; equal runs are carried out once."""
        runs = [(one, seed, self._task(one, seed)) for one in candidates for seed in self.seeds]
        lines = [self.journal.find(one.number, seed, one.at) for one, seed, _ in runs]
        for (_, _, task), line in zip(runs, lines, strict=True):
            if line is not None:
                self._known[task] = Told(line.outcome, line.scores, line.why, line.simulated_s)
        missing = dict.fromkeys(task for _, _, task in runs if task not in self._known)
        results = self._started().in_order(missing) if missing else iter(())
        found: dict[tuple[int, Seed], Told] = {}
        for (candidate, seed, task), line in zip(runs, lines, strict=True):
            told = found[candidate.number, seed] = self._told(candidate, task, results)
            if line is None:
                self.journal.add(self._line(candidate, seed, told))
            self.told(told)
        return [self._evaluation(one, {seed: found[one.number, seed] for seed in self.seeds}) for one in candidates]

    def loss(self, evaluation: Evaluation) -> Loss:
        """Return how bad a candidate is."""
        if evaluation.failed:
            return Loss(evaluation.failed)
        pairs = zip(self.problem.scores, evaluation.means, strict=True)
        return Loss(0.0, tuple(score.loss(mean.value) for score, mean in pairs))

    def _task(self, candidate: Candidate, seed: Seed) -> bytes:
        return msgspec.json.encode((self._plain(candidate), seed, candidate.happening))

    def _told(self, candidate: Candidate, task: bytes, results: Iterator[bytes | Died]) -> Told:
        """Return what is known of a run, or wait for the next result, which is that of the run."""
        if task in self._known:
            return self._known[task]
        began = time.monotonic()
        result = next(results)
        if isinstance(result, Died):
            told = Told("late" if result.late else "crashed", why=str(result))
        else:
            told = msgspec.json.decode(result, type=Told)
        if told.outcome == "refused" and candidate.number == 0:
            raise UsageError(told.why)  # the values are not the reason
        self._known[task] = told
        self.effort.add(told, time.monotonic() - began)
        return told

    def _line(self, candidate: Candidate, seed: Seed, told: Told) -> Line:
        said = (told.outcome, told.scores, told.why, told.simulated_s)
        plain = msgspec.Raw(msgspec.json.encode(self._plain(candidate)))
        return Line(candidate.number, seed, list(candidate.at), *said, plain)

    def _started(self) -> Workers:
        """Return the processes; they are started when the first of them is needed."""
        if self._workers is None:
            self._workers = Workers(self._work, self.processes, self.patience_s, apart=self.journal.files)
            self._workers.__enter__()
        return self._workers

    def _work(self, task: bytes) -> bytes:
        """Do this in a process of its own."""
        plain, seed, number = msgspec.json.decode(task)
        values = {one.path: one.spec.decode(plain[one.path]) for one in self.problem.space.tuned}
        also = self.problem.happenings[number].begin if number >= 0 else None
        return msgspec.json.encode(evaluate(self.problem, values, seed, also))

    def _plain(self, candidate: Candidate) -> dict[str, Any]:
        return self.problem.space.as_data(candidate.values)

    def _evaluation(self, candidate: Candidate, runs: Mapping[Seed, Told]) -> Evaluation:
        means: list[Mean] = []
        if all(one.outcome == "ok" for one in runs.values()):
            columns = zip(*(one.scores for one in runs.values()), strict=True)
            means = [mean_of(column) for column in columns]
        return Evaluation(candidate, runs, means)
