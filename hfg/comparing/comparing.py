"""Compares two sides: scores, tokens, counts, activity and graphs. Depends on `sides` and `tokens`."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, Final

import msgspec

from hfg.comparing.sides import Side, Spans
from hfg.comparing.tokens import Difference, PortTokens, Said, compare_tokens
from hfg.engine.observing.tables import seconds, table
from hfg.tuning.figures import Mean, mean_of, paired

_MOST_ROWS: Final = 20
_CHARACTERS: Final = 60
_ROUNDED_S: Final = 1e-9


class ScoreRow(msgspec.Struct, frozen=True):
    """One score on both sides.

    Attributes:
      name: of the score.
      a: its mean on the first side.
      b: on the second.
      change: the mean of the differences of runs with the same seed, b - a.
    """

    name: str
    a: Mean
    b: Mean
    change: Mean

    @property
    def is_certain(self) -> bool:
        """Whether the difference is outside the noise: its confidence interval does not contain 0."""
        return abs(self.change.value) > self.change.within


class CountRow(msgspec.Struct, frozen=True):
    """Something that was counted differently; None on the side that does not have it."""

    what: str
    a: int | None
    b: int | None


class ActivityRow(msgspec.Struct, frozen=True):
    """When a node was active.

    Attributes:
      node: its path.
      a: begin and end of each time on the first side, in seconds of the run.
      b: on the second.
      differs_at_s: the first time that differs; None if all are equal.
    """

    node: str
    a: list[tuple[float, float]]
    b: list[tuple[float, float]]
    differs_at_s: float | None


class Comparison(msgspec.Struct, frozen=True):
    """The differences of two sides.

    Attributes:
      sides: both, by themselves.
      scores: of both.
      first: the first token that differs; None if none does, or tokens are not known.
      ports: the tokens of each port that both have recorded; None if they are not known.
      counts: what was counted differently; None if one side has no counts.
      activity: a row for each node that was ever active; None if it is not known.
      graph: commands that only one side has, as "- " or "+ " and JSON; None if a graph is not known.
      notes: what is not compared.
    """

    sides: tuple[Side, Side]
    scores: list[ScoreRow]
    first: Difference | None
    ports: list[PortTokens] | None
    counts: list[CountRow] | None
    activity: list[ActivityRow] | None
    graph: list[str] | None
    notes: list[str]

    @property
    def differs(self) -> bool:
        """Whether anything differs."""
        a, b = self.sides
        activity = any(row.differs_at_s is not None for row in self.activity or ())
        return bool(self.first or self.counts or self.graph or activity or a.scores != b.scores) or (
            (a.outcome, a.why) != (b.outcome, b.why)
        )

    @property
    def duration_s(self) -> float:
        """How long the longer run lasted."""
        return max((side.duration_s or 0.0 for side in self.sides), default=0.0)

    def lines(self) -> Iterator[str]:
        """Return the comparison as a person reads it."""
        for letter, side in zip("AB", self.sides, strict=True):
            lasted = "" if side.duration_s is None else f" after {seconds(side.duration_s)}"
            yield f"{letter}: {side.name}, {side.outcome}{lasted}{'; ' + side.why if side.why else ''}"
        if not self.differs:
            yield "nothing differs"
        if self.scores:
            yield ""
            rows = [(row.name, str(row.a), str(row.b), str(row.change), _certain(row)) for row in self.scores]
            yield from table(("score", "A", "B", "B - A", "is"), rows)
        yield from _of_tokens(self.first)
        yield from _of_counts(self.counts or [])
        yield from self._of_activity()
        if self.graph:
            yield from ("", "the graphs differ in", *self.graph[:_MOST_ROWS], *_more(self.graph))
        if self.notes:
            yield from ("", *(f"not compared: {note}" for note in self.notes))

    def _of_activity(self) -> Iterator[str]:
        rows = [row for row in self.activity or () if row.differs_at_s is not None]
        if not rows:
            return
        yield ""
        yield f"active (one character is {seconds(self.duration_s / _CHARACTERS)})"
        width = max(len(row.node) for row in rows[:_MOST_ROWS])
        for row in rows[:_MOST_ROWS]:
            for letter, name, spans in (("A", row.node, row.a), ("B", "", row.b)):
                yield f"{name:{width}} {letter} {_bar(spans, self.duration_s)}".rstrip()
            yield f"{'':{width}}   differs from {seconds(row.differs_at_s or 0.0)} on"
        yield from _more(rows)


def compare(a: Side, b: Side) -> Comparison:
    """Compare two sides, as far as both know something.

    Raises:
      UsageError: a recording cannot be read.
    """
    notes = [f"{side.name}: {note}" for side in (a, b) for note in side.notes]
    ports, first = None, None
    if a.recording is not None and b.recording is not None:
        ports, first, more = compare_tokens(a.recording, b.recording)
        notes += more
    else:
        notes.append("tokens, because not both sides are recorded")
    counts = None if a.counts is None or b.counts is None else _counts(a.counts, b.counts)
    if counts is None and ports is not None:
        counts = [CountRow(f"{one.port}: tokens", one.a, one.b) for one in ports if one.a != one.b]
    activity = None if a.activity is None or b.activity is None else _activity(a.activity, b.activity)
    graph = None if a.graph is None or b.graph is None else _graph(a.graph, b.graph)
    return Comparison((a, b), _scores(a, b), first, ports, counts, activity, graph, notes)


def _scores(a: Side, b: Side) -> list[ScoreRow]:
    found = []
    for name, ones in a.scores.items():
        others = b.scores.get(name, [])
        pairs = [pair for pair in zip(ones, others, strict=False) if all(map(math.isfinite, pair))]
        change = paired([other for _, other in pairs], [one for one, _ in pairs])
        good = [[value for value in values if math.isfinite(value)] for values in (ones, others)]
        found.append(ScoreRow(name, mean_of(good[0]), mean_of(good[1]), change))
    return found


def _counts(a: dict[str, int], b: dict[str, int]) -> list[CountRow]:
    return [CountRow(what, a.get(what), b.get(what)) for what in {**a, **b} if a.get(what) != b.get(what)]


def _activity(a: Spans, b: Spans) -> list[ActivityRow]:
    return [
        ActivityRow(node, a.get(node, []), b.get(node, []), _differ_at(a.get(node, []), b.get(node, [])))
        for node in {**a, **b}
    ]


def _differ_at(a: Sequence[tuple[float, float]], b: Sequence[tuple[float, float]]) -> float | None:
    ones, others = ([time for span in spans for time in span] for spans in (a, b))
    for one, other in zip(ones, others, strict=False):
        if abs(one - other) > _ROUNDED_S:
            return min(one, other)
    rest = ones[len(others) :] or others[len(ones) :]
    return rest[0] if rest else None


def _graph(a: list[Any], b: list[Any]) -> list[str]:
    ones, others = (Counter(msgspec.json.encode(one).decode() for one in side) for side in (a, b))
    return [f"- {one}" for one in (ones - others).elements()] + [f"+ {one}" for one in (others - ones).elements()]


# --- as text ----------------------------------------------------------------------------------------------------------


def _certain(row: ScoreRow) -> str:
    if not row.change.value:
        return "equal"
    if not math.isfinite(row.change.within):
        return "different"
    return "different" if row.is_certain else "within the noise"


def _of_tokens(first: Difference | None) -> Iterator[str]:
    if first is None:
        return
    yield ""
    over = f", over {', '.join(first.edges)}" if first.edges else ""
    yield f'first difference: token {first.turn} of "{first.port}"{over}'
    for letter, said in (("A", first.a), ("B", first.b)):
        yield f"  {letter}: {said_of(said)}"


def said_of(said: Said | None) -> str:
    """Return a token as text."""
    if said is None:
        return "has no such token"
    modifier = f" ({said.activity:+d})" if said.activity else ""
    stamp = "" if abs(said.stamp_s - said.sent_s) < _ROUNDED_S else f", stamp {said.stamp_s:.6f} s"
    return f"number {said.number}, sent at {said.sent_s:.6f} s{stamp}: {said.value}{modifier}"


def _of_counts(counts: Sequence[CountRow]) -> Iterator[str]:
    if not counts:
        return
    yield ""
    rows = [(row.what, *("none" if one is None else one for one in (row.a, row.b))) for row in counts[:_MOST_ROWS]]
    yield from table(("counted differently", "A", "B"), rows)
    yield from _more(counts)


def _more(rows: Sequence[object]) -> list[str]:
    more = len(rows) - _MOST_ROWS
    return [f"and {more} more; --json and --report have all"] if more > 0 else []


def _bar(spans: Sequence[tuple[float, float]], duration_s: float) -> str:
    """Return when a node was active as a bar of characters."""
    cells = [" "] * _CHARACTERS
    for begin, end in spans:
        first, last = (min(int(time / max(duration_s, 1e-12) * _CHARACTERS), _CHARACTERS - 1) for time in (begin, end))
        cells[first : last + 1] = "█" * (last - first + 1)
    return "".join(cells)
