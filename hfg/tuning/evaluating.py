"""One run of one candidate: a fresh graph in virtual time, with values set, judged by scores and monitors.

Depends on `space`, `scores`, `happenings`, monitors and the engine.
"""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Literal, TypeAlias

import msgspec
import numpy as np

from hfg.engine import Run, run
from hfg.errors import GraphError, HfgError, MonitorViolated, UsageError, in_words
from hfg.graph import Graph
from hfg.monitors import Property, watch
from hfg.tuning.happenings import Happening
from hfg.tuning.scores import Listening, Score
from hfg.tuning.space import Space, find_parameters, set_values

Outcome: TypeAlias = Literal["ok", "violated", "failed", "no score", "crashed", "late", "refused"]
"""How a run went: it has scores, a monitor was violated, an error ended it, a score is no number, its process died, it
took longer than allowed, or it could not begin."""

Constraints: TypeAlias = Mapping[str, Property] | Callable[[], Mapping[str, Property]]

_MOST_WORDS: Final = 400
_LARGEST_SEED: Final = 2**32 - 1


class Told(msgspec.Struct, frozen=True):
    """The result of one run of a candidate.

    Attributes:
      outcome: how it went.
      scores: one number each; nothing if there are none.
      why: a sentence, if it went wrong.
      simulated_s: how long the run has lasted on its own clock.
      took_s: how long that took.
    """

    outcome: Outcome
    scores: list[float] = []
    why: str = ""
    simulated_s: float = 0.0
    took_s: float = 0.0


@dataclass(frozen=True)
class Problem:
    """What is searched for, and how a candidate is judged.

    Attributes:
      build: returns a new graph for each run.
      space: the parameters.
      scores: numbers that the search makes small or large.
      seed_paths: the parameters that get the seed.
      until_s: each run ends at this time; None: by itself.
      constraints: monitors that must hold.
      happenings: what may happen; a candidate names one.
    """

    build: Callable[[], Graph]
    space: Space
    scores: list[Score]
    seed_paths: Sequence[str] = ()
    until_s: float | None = None
    constraints: Constraints = field(default_factory=dict)
    happenings: Sequence[Happening] = ()

    def properties(self) -> Mapping[str, Property]:
        """Return the monitors."""
        return self.constraints() if callable(self.constraints) else self.constraints


def seed_parameters(graph: Graph, said: str | None) -> list[str]:
    """Return the parameters that get the seed of a run: the named one, or all whose name is "seed".

    Raises:
      UsageError: there is none.
    """
    known = find_parameters(graph)
    if said is not None:
        if said not in known:
            raise UsageError(f'graph "{graph.name}" has no parameter "{said}" for the seed')
        return [said]
    found = [path for path, port in known.items() if port.name == "seed" and port.spec.check(1) is None]
    if not found:
        raise UsageError(
            f'graph "{graph.name}" has no parameter "seed", so all seeds would give the same run: leave out seeds, or '
            "name the parameter that decides what looks like chance"
        )
    return found


def evaluate(
    problem: Problem, values: Mapping[str, Any], seed: int | None, also: Callable[[Run], object] | None = None
) -> Told:
    """Run a candidate once. An error of the run is in the result.

    Args:
      problem: what is searched for.
      values: of the parameters, by path.
      seed: of the run, and of the modules random and numpy.random. None: parameters stay as they are.
      also: called with the run before its nodes are set up.
    """
    began = time.perf_counter()
    listening: list[Listening] = []
    runs: list[Run] = []
    if seed is not None:
        random.seed(seed)
        np.random.seed(seed % _LARGEST_SEED)  # for code that uses it

    def begin(one: Run) -> None:
        runs.append(one)
        listening.append(Listening(one, problem.scores))
        properties = problem.properties()
        if properties:
            watch(one, on_violation="fail", **properties)
        if also is not None:
            also(one)

    def told(outcome: Outcome, scores: Sequence[float] = (), why: str = "") -> Told:
        simulated_s = runs[0].elapsed() if runs else 0.0
        return Told(outcome, list(scores), why[:_MOST_WORDS], simulated_s, time.perf_counter() - began)

    try:
        graph = problem.build()
        problem.space.apply(graph, values)
        if seed is not None:
            set_values(graph, dict.fromkeys(problem.seed_paths, seed))
        report = run(graph, clock="virtual", until_s=problem.until_s, begin=begin, block_warning_s=0)
    except MonitorViolated as error:
        return told("violated", why=str(error).partition("\n")[0])
    except (UsageError, GraphError) as error:
        return told("refused", why=str(error))
    except Exception as error:
        return told("failed", why=str(error) if isinstance(error, HfgError) else in_words(error))
    try:
        scores = listening[0].values(report, seed)
    except Exception as error:
        return told("no score", why=str(error) if isinstance(error, HfgError) else in_words(error))
    for score, value in zip(problem.scores, scores, strict=True):
        if not math.isfinite(value):
            return told("no score", why=f'score "{score.name}" is {value}')
    return told("ok", scores)
