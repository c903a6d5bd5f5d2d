"""A trial: a stretch of a stream, and a number for it. Depends on nodetype, ports and the statistics of scores."""

from __future__ import annotations

from typing import Any

from annotated_types import Interval

from hfg.base.clock import now
from hfg.base.token import Token
from hfg.nodes._rounding import slack_s
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Parameter, State, slot
from hfg.tuning.scores import STATISTICS, Passed


class Trial(Node):
    """Judge a stretch of a stream by one number.

    A trial lasts from `begin` for a time, or until `finish`. Values between trials do not count. A trial without values
    triggers `empty` and has no score.

    Attributes:
      value: a number, such as the error of a controller.
      by: which statistic of the values is the score.
      duration_s: how long a trial lasts.
      begin: starts a trial; a trial in progress starts over.
      finish: ends the trial now.
      began: a trial has started; connect it to nodes that start over with it, such as `plant.reset`.
      score: the score of a trial.
      empty: a trial is over in which no value came.

    Raises:
      ValueError: a value is not a number.
    """

    value = Input(float)
    by = Parameter("rms", choices=tuple(STATISTICS))
    duration_s = Parameter(5.0, Interval(gt=0, le=1e9), unit="s")
    began = Event()
    score = Event(float)
    empty = Event()
    passed: State[Any] = State(None)
    since = State(0.0)

    def process(self, value: Token[float]) -> None:
        """Count a value, and look at the clock."""
        if self.passed is None:
            return
        self.passed.put(value)
        if self.passed.wrong:
            raise ValueError(self.passed.wrong)
        if now() - self.since >= self.duration_s - slack_s(self.duration_s, now()):
            self._end()

    @slot
    def begin(self) -> None:
        """Begin a trial."""
        self.passed, self.since = Passed(), now()
        self.began.trigger(activity=0)

    @slot
    def finish(self) -> None:
        """End the trial."""
        if self.passed is not None:
            self._end()

    def _end(self) -> None:
        passed, self.passed = self.passed, None
        if passed.count:
            self.score.trigger(STATISTICS[self.by](passed))
        else:
            self.empty.trigger()
