"""A search as a node: each score allows the next candidate. Depends on nodetype, ports and the methods of tuning."""

from __future__ import annotations

import math
from collections import deque
from typing import Any, NamedTuple

from annotated_types import Interval

from hfg.nodetypes.node import Node
from hfg.ports import Event, Events, Parameter, State, slot
from hfg.tuning.losses import Loss
from hfg.tuning.methods import METHODS, Method, make_method
from hfg.tuning.space import Space, read_range


class Found(NamedTuple):
    """A candidate and its score.

    Attributes:
      values: its numbers.
      score: as it came.
    """

    values: list[float]
    score: float


class Optimize(Node):
    """Search for the numbers that make a score smallest or largest: each score allows the next candidate.

    A candidate leaves by `values`, one number each, for parameters of other nodes, and then as a list by `evaluate`.
    Scores come in the order in which candidates left. A generation is told to the method at once, so the result does
    not depend on how many candidates are out. At the end the best one leaves by `values` once more.

    With active edges the search is a state of the graph: let `begin` bring the activity, `evaluate` pass it to a trial,
    `score` bring it back, and `finished` lead it on. Then one candidate is out at a time.

    Attributes:
      ranges: what to search, one text for each number: "0.1..10", "0.1..10:log", "0..1/5" or "1,2,5".
      method: de (differential evolution), cma (CMA-ES), tpe (Parzen estimators), grid or random.
      evaluations: how many candidates at most.
      batch: candidates of a generation; 0 for what is usual for the method.
      maximize: whether a large score is good.
      seed: of the method.
      ahead: how many candidates may be out at once.
      begin: starts the search, or starts it over.
      score: of the oldest candidate that has none; one that is not finite is a failure.
      failure: the oldest candidate that has no score gets none: it is worse than all others.
      stop: ends the search now. Scores of candidates that are out are ignored.
      values: the numbers of a candidate.
      evaluate: a candidate, to be judged.
      improved: a candidate is better than all before.
      finished: the best candidate, when the search is over.
      best: the best candidate so far.

    Raises:
      ValueError: `values` is not as long as `ranges`, a score comes though no candidate is out, or no candidate has a
        score at the end.
      UsageError: the package that the method needs is not installed, or a range cannot be read.
    """

    ranges = Parameter[tuple[str, ...]](("0..1",))
    method = Parameter("de", choices=tuple(METHODS))
    evaluations = Parameter(200, Interval(ge=1, le=1_000_000))
    batch = Parameter(0, Interval(ge=0, le=10_000))
    maximize = Parameter(False)
    seed = Parameter(1)
    ahead = Parameter(1, Interval(ge=1, le=10_000))
    values = Events(float, 1)
    evaluate = Event(list[float])
    improved = Event(Found)
    finished = Event(Found)
    best: State[Found | None] = State(None)
    search: State[Any] = State(None)

    @slot
    def begin(self) -> None:
        """Begin."""
        if len(self.values) != len(self.ranges):
            raise ValueError(
                f"values has {len(self.values)} events for {len(self.ranges)} ranges: write values={len(self.ranges)}"
            )
        self.search, self.best = _Search(self), None
        self._go_on()

    @slot
    def score(self, score: float) -> None:
        """Take a score, and send the next candidate."""
        self._take(float(score))

    @slot
    def failure(self) -> None:
        """Take note that there is no score."""
        self._take(math.nan)

    @slot
    def stop(self) -> None:
        """End the search."""
        if self.search is not None and not self.search.is_over:
            self._finish()

    def _take(self, score: float) -> None:
        if self.search is None or (not self.search.out and not self.search.is_over):
            raise ValueError("a score came, though no candidate is out: connect evaluate to what sends scores")
        if self.search.is_over:
            return
        found = self.search.take(score)
        if found is not None and (self.best is None or self._is_better(found.score, self.best.score)):
            self.best = found
            self.improved.trigger(found, activity=0)
        self._go_on()

    def _go_on(self) -> None:
        while len(self.search.out) < self.ahead:
            candidate = self.search.next()
            if candidate is None:
                break
            self._send(candidate)
            self.evaluate.trigger(candidate)
        if not self.search.out:
            self._finish()

    def _finish(self) -> None:
        self.search.is_over = True
        if self.best is None:
            raise ValueError("no candidate has a score, so there is no best one")
        self._send(self.best.values)
        self.finished.trigger(self.best)

    def _is_better(self, one: float, other: float) -> bool:
        return one > other if self.maximize else one < other

    def _send(self, candidate: list[float]) -> None:
        for port, number in zip(self.values, candidate, strict=True):
            port.trigger(number, activity=0)


class _Search:
    """The candidates of a generation, and which of them are out.

    Attributes:
      out: the candidates that have no score yet, the oldest first, by their place in the generation.
      is_over: it has ended.
    """

    def __init__(self, node: Optimize) -> None:
        self._space = Space(read_range(f"ranges[{index}]", text) for index, text in enumerate(node.ranges))
        self._method: Method = make_method(
            node.method, self._space.cells, seed=node.seed, batch=node.batch or None, first=None, scores=1
        )
        self._sign = -1.0 if node.maximize else 1.0
        self._left = node.evaluations
        self._asked: list[list[float]] = []
        self._losses: list[Loss] = []
        self._given = 0
        self.out: deque[int] = deque()
        self.is_over = False

    def next(self) -> list[float] | None:
        """Return the next candidate; None if scores are missing first, or there is no other."""
        if not self._left:
            return None
        if self._given == len(self._asked):
            if self.out:
                return None
            if self._asked:
                self._method.tell(self._asked, self._losses)
            self._asked, self._given = self._method.ask(), 0
            self._losses = [Loss(1.0)] * len(self._asked)
            if not self._asked:
                return None
        self.out.append(self._given)
        self._given += 1
        self._left -= 1
        return self._values(self.out[-1])

    def take(self, score: float) -> Found | None:
        """Take the score of the oldest candidate that is out. Return both, if the score is finite."""
        index = self.out.popleft()
        if not math.isfinite(score):
            return None
        self._losses[index] = Loss(0.0, (self._sign * score,))
        return Found(self._values(index), score)

    def _values(self, index: int) -> list[float]:
        return [float(value) for value in self._space.values(self._asked[index]).values()]
