"""How far a run is from violating a property: its margin, a number where a monitor has only a verdict.

A condition such as `value < 3` has the margin 3 - value, `&` the smaller one, `|` the larger one, "always" the smallest
of all points: the robustness of Fainekos and Pappas (2009) and of Donzé and Maler (2010) with the operators of
monitors. Above 0 the property holds, below 0 it is violated. Conditions that have no size, such as activity, are
infinitely far from their opposites. Depends on `properties`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any, Final

from hfg.errors import UsageError
from hfg.monitors.compiling import Atom
from hfg.monitors.conditions import Condition, part_of
from hfg.monitors.formulas import And, Formula, Not, Or, Previously, Sent, Since, Times
from hfg.monitors.properties import Judge, Property, Verdict

_Step = Callable[[float, dict[Atom, float]], float]
"""Called at each point with its time and the margin of each atom; returns that of the formula."""

_INF: Final = math.inf


def measured(what: Property) -> Property:
    """The same property, of which `Monitors.margins` has the margin: how far the run is from violating it.

    It needs about ten times as long for a point as a verdict needs, and remembers all points of the times that the
    property names.

    Args:
      what: the property. Conditions are measured if they are text that compares with a number, "value < 3".

    Returns:
      The property, for `watch`.

    Raises:
      UsageError: it is not a property, or it can never be violated, because no time limits the answer.
    """
    if not isinstance(what, Property):
        raise UsageError(f"measured takes a property, such as never(formula), got {what!r:.80}")
    if what.answer is not None and what.within_s == _INF:
        raise UsageError(f"{what} can never be violated, so it has no margin: give it a time, within_s=")
    return _Measured(what.maker, what.given, what.within_s)


class _Measured(Property):
    __slots__ = ()

    def judge(self, start: float) -> Judge:
        """See `Property`."""
        return MarginJudge(self, start)


@dataclass(eq=False, slots=True)
class _Size:
    """Stands for the condition of an atom, and keeps the margin of the last value until it is taken."""

    when: Callable[[Any], object]
    last: float = -_INF  # where no value has come

    def __call__(self, value: Any) -> bool:
        if isinstance(self.when, Condition):
            self.last = _margin(self.when.test, value)
        else:
            self.last = _INF if self.when(value) else -_INF
        return True

    def take(self) -> float:
        found, self.last = self.last, -_INF
        return found


class MarginJudge(Judge):
    """Measures the margin of a property, point by point, and judges by its sign."""

    def __init__(self, what: Property, start: float) -> None:
        named = list(dict.fromkeys(what.atoms()))
        self._sizes = [_Size(atom.when) if isinstance(atom, Sent) and atom.when is not None else None for atom in named]
        self._named = named
        self.atoms = [
            replace(atom, when=size) if isinstance(atom, Sent) and size is not None else atom
            for atom, size in zip(named, self._sizes, strict=True)
        ]
        self.verdict = Verdict.OPEN if what.from_start else Verdict.HOLDS
        self._asks, self._answer, self._meanwhile = (
            None if formula is None else _step(formula) for formula in (what.asks, what.answer, what.meanwhile)
        )
        self._within_s = what.within_s
        self._least = self._held = _INF
        # the questions that are open: their deadline, and the best of their answers
        self._open: deque[list[float]] = deque([[start + what.within_s, -_INF]] if what.from_start else [])
        self.due = self._open[0][0] if self._open else _INF

    @property
    def margin(self) -> float:
        """The margin so far; of an open question it counts that no answer can help any more."""
        beyond_help = (max(best, self._held) for _, best in self._open)
        return min(self._least, *(one for one in beyond_help if one < 0), _INF)

    def point(self, t: float, *truths: bool) -> bool:
        """See `Judge`."""
        margins: dict[Atom, float] = {}
        for atom, size, truth in zip(self._named, self._sizes, truths, strict=True):
            margin = _INF if size is None else size.take()
            margins[atom] = margin if truth else -_INF
        return self.take(t, margins)

    def take(self, t: float, margins: dict[Atom, float]) -> bool:
        """Take in a point, as `point` does, with the margin of each atom."""
        asks = _INF if self._asks is None else self._asks(t, margins)
        if self._answer is None:
            self._least = min(self._least, asks)
            return self._settle()
        answer = self._answer(t, margins)
        violated = self.pass_to(t)
        if self._asks is not None and asks > -_INF:
            self._open.append([t + self._within_s, -asks])
        for question in self._open:
            question[1] = max(question[1], min(answer, self._held))
        if self._meanwhile is not None:
            self._held = min(self._held, self._meanwhile(t, margins))
        return self._settle() or violated

    def pass_to(self, t: float) -> bool:
        """See `Judge`."""
        while self._open and self._open[0][0] < t:
            self._least = min(self._least, self._open.popleft()[1])
        return self._settle()

    def _settle(self) -> bool:
        """Set the verdict and the next deadline. Return whether it is now that the property is violated."""
        self.due = self._open[0][0] if self._open else _INF
        if self.verdict is Verdict.VIOLATED:
            return False
        waits = any(best < 0 for _, best in self._open)
        self.verdict = Verdict.VIOLATED if self.margin < 0 else Verdict.OPEN if waits else Verdict.HOLDS
        return self.verdict is Verdict.VIOLATED


def _margin(test: tuple[Any, ...], value: Any) -> float:
    """Return the margin of a condition, see `Condition.test`."""
    match test:
        case ("&", one, other):
            return min(_margin(one, value), _margin(other, value))
        case ("|", one, other):
            return max(_margin(one, value), _margin(other, value))
        case ("~", one):
            return -_margin(one, value)
        case (("<" | "<=" | ">" | ">=") as sign, ("value", steps), literal):
            found = part_of(value, steps)
            if _is_number(found) and _is_number(literal):
                return float(literal - found if sign[0] == "<" else found - literal)
    return _INF if Condition(test)(value) else -_INF


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _step(formula: Formula) -> _Step:
    """Return what measures a formula; it remembers."""
    match formula:
        case Not(of):
            inner = _step(of)
            return lambda t, margins: -inner(t, margins)
        case And(one, other):
            first, second = _step(one), _step(other)
            return lambda t, margins: min(first(t, margins), second(t, margins))
        case Or(one, other):
            first, second = _step(one), _step(other)
            return lambda t, margins: max(first(t, margins), second(t, margins))
        case Previously(of):
            return _previously(_step(of))
        case Times(number, of, within_s):
            return _times(number, _step(of), within_s)
        case Since(holds, began, at_least_s, within_s):
            return _since(None if holds is None else _step(holds), _step(began), at_least_s, within_s)
    atom: Any = formula
    return lambda t, margins: margins[atom]


def _previously(of: _Step) -> _Step:
    before = -_INF

    def step(t: float, margins: dict[Atom, float]) -> float:
        nonlocal before
        found, before = before, of(t, margins)
        return found

    return step


def _times(number: int, of: _Step, within_s: float) -> _Step:
    """The margin of "n times" is the n-th largest; without a time limit only the n largest count forever."""
    recent: deque[tuple[float, float]] = deque()
    best = [-_INF] * number

    def step(t: float, margins: dict[Atom, float]) -> float:
        nonlocal best
        found = of(t, margins)
        if within_s == _INF:
            best = sorted([*best, found], reverse=True)[:number]
            return best[-1]
        recent.append((t, found))
        while t - recent[0][0] > within_s:
            recent.popleft()
        return sorted([*(one for _, one in recent), *best], reverse=True)[number - 1]

    return step


def _since(holds: _Step | None, began: _Step, at_least_s: float, within_s: float) -> _Step:
    """The best of all witnesses, each of which counts as much as what has held since allows."""
    recent: deque[list[float]] = deque()
    old = -_INF  # the best of all that are old enough, where they count forever

    def step(t: float, margins: dict[Atom, float]) -> float:
        nonlocal old
        limit = _INF if holds is None else holds(t, margins)
        old = min(old, limit)
        for witness in recent:
            witness[1] = min(witness[1], limit)
        recent.append([t, began(t, margins)])
        while recent and within_s == _INF and t - recent[0][0] >= at_least_s:
            old = max(old, recent.popleft()[1])
        while recent and t - recent[0][0] > within_s:
            recent.popleft()
        return max([old, *(margin for begun, margin in recent if t - begun >= at_least_s)])

    return step
