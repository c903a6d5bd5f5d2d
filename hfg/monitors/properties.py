"""What is to hold of a whole run: patterns over formulas, and the state machine that judges each.

The patterns are those of Dwyer, Avrunin and Corbett (1999); formulas that look back express what they call scopes.
Only `leads_to`, `eventually` and `until` look ahead, and they do so up to one deadline. Depends on `compiling`.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Any

from hfg.errors import UsageError
from hfg.monitors.compiling import Atom, Step, compiled
from hfg.monitors.formulas import Formula, need_formula, once

__all__ = [
    "Judge",
    "Property",
    "Verdict",
    "always",
    "eventually",
    "leads_to",
    "never",
    "precedes",
    "until",
]


class Verdict(enum.Enum):
    """What is known of a property.

    Attributes:
      HOLDS: it has held so far; at the end of a run: it has held.
      VIOLATED: it did not hold.
      OPEN: something that it asks for has not come, and its time is not over.
      UNKNOWN: a condition has raised, so nothing is judged any more.
    """

    HOLDS = "holds"
    VIOLATED = "violated"
    OPEN = "not yet"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Property:
    """What is to hold of a run.

    Attributes:
      said: it in the words of the functions that made it.
      asks: the formula that holds where something must follow; for `always` the formula itself.
      answer: the formula that must hold then; None for `always`.
      within_s: how long that may take.
      meanwhile: what must hold until then, or None.
      from_start: what is asked for is asked once, at the start of the run.
    """

    said: str
    asks: Formula | None
    answer: Formula | None = None
    within_s: float = math.inf
    meanwhile: Formula | None = None
    from_start: bool = False

    def __str__(self) -> str:
        return self.said

    def judge(self, start: float) -> Judge:
        """Return what judges a run that starts at this time."""
        if self.answer is None:
            return _Always(self)
        return _Response(self, start)


def always(formula: Formula) -> Property:
    """It holds at every point."""
    return Property(f"always({formula})", need_formula(formula, "always"))


def never(formula: Formula) -> Property:
    """It holds at no point."""
    return Property(f"never({formula})", ~need_formula(formula, "never"))


def precedes(first: Formula, then: Formula) -> Property:
    """Whenever `then` holds, `first` holds or held before."""
    need_formula(first, "precedes")
    return Property(f"precedes({first}, {then})", need_formula(then, "precedes").implies(once(first)))


def leads_to(formula: Formula, answer: Formula, *, within_s: float = math.inf) -> Property:
    """Whenever the formula holds, the answer holds at that point or at most `within_s` seconds later."""
    asks, comes = need_formula(formula, "leads_to"), need_formula(answer, "leads_to")
    seconds = _seconds(within_s, "leads_to")
    return Property(f"leads_to({asks}, {comes}{_said(seconds)})", asks, comes, seconds)


def eventually(formula: Formula, *, within_s: float = math.inf) -> Property:
    """It holds at some point, at most `within_s` seconds after the start of the run."""
    comes = need_formula(formula, "eventually")
    seconds = _seconds(within_s, "eventually")
    return Property(f"eventually({comes}{_said(seconds)})", None, comes, seconds, from_start=True)


def until(holds: Formula, comes: Formula, *, within_s: float = math.inf) -> Property:
    """`comes` holds at some point, within these seconds from the start, and `holds` holds at every earlier point."""
    first, then = need_formula(holds, "until"), need_formula(comes, "until")
    seconds = _seconds(within_s, "until")
    return Property(f"until({first}, {then}{_said(seconds)})", None, then, seconds, first, from_start=True)


class Judge:
    """Judges one property in one run, point by point; the memory it needs is that of the formulas, and one number.

    Attributes:
      atoms: what its points consist of, in this order.
      verdict: what is known.
      due: the time after which it is violated if nothing comes; infinity if there is none.
    """

    due = math.inf

    def __init__(self, formulas: list[Formula]) -> None:
        self.atoms: list[Atom]
        self._step: Step
        self.atoms, self._step = compiled(formulas)
        self.verdict = Verdict.HOLDS

    def point(self, t: float, *truths: bool) -> bool:
        """Judge a point. Return whether it is now that the property is violated."""
        raise NotImplementedError

    def pass_to(self, t: float) -> bool:
        """Time has come to `t` without a point. Return whether it is now that the property is violated."""
        if t <= self.due:
            return False
        self.due = math.inf
        self.verdict = Verdict.VIOLATED
        return True

    def give_up(self) -> None:
        """Its condition has raised: nothing more is judged, and what holds is not known."""
        self.due = math.inf
        self.verdict = Verdict.UNKNOWN


class _Always(Judge):
    def __init__(self, what: Property) -> None:
        assert what.asks is not None
        super().__init__([what.asks])
        self._held = True

    def point(self, t: float, *truths: bool) -> bool:
        (holds,) = self._step(t, *truths)
        if holds == self._held:
            return False
        self._held = holds
        if holds:
            return False
        self.verdict = Verdict.VIOLATED
        return True


class _Response(Judge):
    """Keeps the time of the oldest question that is open: an answer answers all of them."""

    def __init__(self, what: Property, start: float) -> None:
        assert what.answer is not None
        self._asks = what.asks is not None
        self._holds = what.meanwhile is not None
        super().__init__([one for one in (what.answer, what.asks, what.meanwhile) if one is not None])
        self._within_s = what.within_s
        self._is_open = False
        if what.from_start:
            self._open(start)

    def _open(self, t: float) -> None:
        self._is_open = True
        self.due = t + self._within_s
        if self.verdict is not Verdict.VIOLATED:
            self.verdict = Verdict.OPEN

    def _close(self) -> None:
        self._is_open = False
        self.due = math.inf
        if self.verdict is not Verdict.VIOLATED:
            self.verdict = Verdict.HOLDS

    def point(self, t: float, *truths: bool) -> bool:
        comes, *others = self._step(t, *truths)
        violated = self.pass_to(t)
        if comes:
            if self._is_open:
                self._close()
        elif self._is_open:
            if self._holds and not others[-1]:
                self._close()
                self.verdict = Verdict.VIOLATED
                return True
        elif self._asks and others[0]:
            self._open(t)
        return violated

    def pass_to(self, t: float) -> bool:
        violated = super().pass_to(t)
        if violated:
            self._is_open = False
        return violated


def _said(within_s: float) -> str:
    return "" if within_s == math.inf else f", within_s={within_s:g}"


def _seconds(within_s: Any, what: str) -> float:
    if isinstance(within_s, bool) or not isinstance(within_s, int | float) or not within_s >= 0:
        raise UsageError(f"within_s of {what} is a time in seconds, from 0 on, got {within_s!r}")
    return float(within_s)
