"""What a run is judged by: a number that a node has at its end, or a statistic of what passes a port.

Depends on the engine.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from hfg.base.token import Marker, Token
from hfg.engine import Report, Run
from hfg.errors import GraphError, HfgError, UsageError
from hfg.graph import Graph
from hfg.graph.structure.naming import suggest


@dataclass(frozen=True)
class Finished:
    """A run that is over, for functions that give a score.

    Attributes:
      graph: the graph, whose nodes have the states in which they ended.
      report: of the run.
      seed: of the run; None without seeds.
    """

    graph: Graph
    report: Report
    seed: int | None


ScoreLike: TypeAlias = str | Callable[[Finished], float]
"""A score as users name it: a text, or a function of the finished run."""


class Passed:
    """Statistics of the values that have passed a port."""

    def __init__(self) -> None:
        self.count = 0
        self.last = self.total = self.squares = self.sizes = math.nan
        self.least = self.most = math.nan
        self.wrong = ""

    def put(self, token: Token[Any]) -> None:
        """Take in a token."""
        value = token.value
        if type(value) is Marker:
            return
        self.count += 1
        try:
            number = float(value)
        except (TypeError, ValueError):
            self.wrong = self.wrong or f"{value!r:.80} is not a number"
            return
        if math.isnan(self.last):
            self.total = self.squares = self.sizes = 0.0
            self.least = self.most = number
        self.last = number
        self.total += number
        self.squares += number * number
        self.sizes += abs(number)
        self.least, self.most = min(self.least, number), max(self.most, number)

    def end(self) -> None:
        """See `Looker` of the engine."""


STATISTICS: Final[dict[str, Callable[[Passed], float]]] = {
    "last": lambda passed: passed.last,
    "mean": lambda passed: passed.total / passed.count,
    "mean_size": lambda passed: passed.sizes / passed.count,
    "rms": lambda passed: math.sqrt(passed.squares / passed.count),
    "sum": lambda passed: passed.total,
    "min": lambda passed: passed.least,
    "max": lambda passed: passed.most,
    "count": lambda passed: float(passed.count),
}
"""What can follow a port: "plant.error.rms"."""


@dataclass(frozen=True)
class Score:
    """One score.

    Attributes:
      name: as users write it.
      maximize: whether more is better.
      function: of the finished run; None if it is read from a port or a node.
    """

    name: str
    maximize: bool
    function: Callable[[Finished], float] | None = None

    def loss(self, value: float) -> float:
        """Return the value so that less is better."""
        return -value if self.maximize else value


def read_score(said: ScoreLike, *, maximize: bool) -> Score:
    """Return a score as users name it.

    Raises:
      UsageError: it is neither a text nor a function.
    """
    if isinstance(said, str) and said.strip():
        return Score(said.strip(), maximize)
    if callable(said):
        return Score(getattr(said, "__name__", "score"), maximize, said)
    raise UsageError(
        f'a score is a text such as "plant.error.rms", or a function of the finished run, got {said!r:.80}'
    )


class Listening:
    """Reads scores from one run: made when it begins, asked when it is over."""

    def __init__(self, run: Run, scores: list[Score]) -> None:
        self._run, self._scores = run, scores
        self._passed: dict[str, tuple[Passed, str]] = {}
        for score in scores:
            if score.function is None:
                self._find(score.name)

    def values(self, report: Report, seed: int | None) -> list[float]:
        """Return the scores.

        Raises:
          UsageError: a score is not a number.
        """
        finished = Finished(self._run.graph, report, seed)
        found = []
        for score in self._scores:
            value = self._value(score, finished)
            if isinstance(value, bool) or not isinstance(value, int | float):
                try:
                    value = float(value)  # of numpy
                except (TypeError, ValueError):
                    raise UsageError(f'score "{score.name}" is {value!r:.80}, not a number') from None
            found.append(float(value))
        return found

    def _value(self, score: Score, finished: Finished) -> Any:
        if score.function is not None:
            return score.function(finished)
        name = score.name
        if name in self._passed:
            passed, statistic = self._passed[name]
            if passed.wrong:
                raise UsageError(f'score "{name}": {passed.wrong}')
            if not passed.count:
                raise UsageError(f'score "{name}": no value passed the port')
            return STATISTICS[statistic](passed)
        if name in finished.report.outputs:
            sent = finished.report.outputs[name]
            if not sent:
                raise UsageError(f'score "{name}": the output of the graph has sent nothing')
            return sent[-1]
        if name in _OF_REPORT:
            return getattr(finished.report, name)
        place, _, attribute = name.rpartition(".")
        node: Any = finished.graph[place]
        return getattr(node, attribute)

    def _find(self, name: str) -> None:
        """Listen at a port, or see that the score can be read at the end.

        Raises:
          UsageError: there is no such port, state or output.
        """
        graph = self._run.graph
        outputs = self._run._parts.outputs
        if name in outputs or name in _OF_REPORT:
            return
        path, dot, last = name.rpartition(".")
        if dot and "." in path and last in STATISTICS:
            self._listen(name, path, last)
        elif dot and self._is_port(name):
            self._listen(name, name, "last")
        elif not dot or not self._has_state(path, last):
            there = [*outputs, *_OF_REPORT, *(f"{one}.…" for one in graph.nodes)]
            raise UsageError(
                f'there is no score "{name}": name a port such as "node.port", with a statistic '
                f"({', '.join(STATISTICS)}) if you like, a state of a node, or an output of the graph; "
                f"{suggest(name, there)}"
            )

    def _is_port(self, path: str) -> bool:
        try:
            return hasattr(self._run.graph[path], "kind")
        except (HfgError, LookupError):
            return False

    def _has_state(self, path: str, attribute: str) -> bool:
        try:
            node = self._run.graph[path]
        except (HfgError, LookupError):
            return False
        return not attribute.startswith("_") and hasattr(node, attribute)

    def _listen(self, name: str, path: str, statistic: str) -> None:
        looker = Passed()
        try:
            port = self._run.graph[path]
            taps = self._run._parts.taps
            try:
                taps.look(port, looker)
            except UsageError:  # an output without an edge: its event shows what it sends
                taps.look(port.sent, looker)
        except (GraphError, LookupError, AttributeError) as error:
            raise UsageError(f'score "{name}": there is no port "{path}"; {error}') from None
        self._passed[name] = looker, statistic


_OF_REPORT: Final = ("duration_s", "firings")
