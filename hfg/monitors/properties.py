"""What is to hold of a whole run: patterns over formulas, and the state machine that judges each.

The patterns are those of Dwyer, Avrunin and Corbett (1999); formulas that look back express what they call scopes.
Only `leads_to`, `eventually` and `until` look ahead, and they do so up to one deadline. Depends on `compiling`.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from hfg.errors import UsageError
from hfg.monitors.compiling import Atom, Step, compiled
from hfg.monitors.formulas import Formula, atoms_of, need_formula, once, plain_number, unbracketed


class Verdict(enum.Enum):
    """What is known of a property.

    Attributes:
      HOLDS: it has held so far; at the end of a run: it has held.
      VIOLATED: it did not hold.
      OPEN: something that it asks for has not come, and its time is not over.
      UNKNOWN: a condition has raised, so nothing is judged any more; or a process has died, so what happened there is
        not known.
    """

    HOLDS = "holds"
    VIOLATED = "violated"
    OPEN = "not yet"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Property:
    """What is to hold of a run.

    Attributes:
      maker: the function that made it, such as "never".
      given: the formulas that it was given.
      within_s: how long the answer may take, if the function takes that.
    """

    maker: str
    given: tuple[Formula, ...]
    within_s: float = math.inf

    def __str__(self) -> str:
        said = "" if self.within_s == math.inf else f", within_s={plain_number(self.within_s)}"
        return f"{self.maker}({', '.join(map(unbracketed, self.given))}{said})"

    @property
    def asks(self) -> Formula | None:
        """The formula that holds where something must follow; where nothing has to follow, what must always hold."""
        match self.maker, self.given:
            case "never", (formula,):
                return ~formula
            case "precedes", (first, then):
                return then.implies(once(first))
            case "always" | "leads_to", (formula, *_):
                return formula
        return None

    @property
    def answer(self) -> Formula | None:
        """The formula that must hold then; None if nothing has to follow."""
        return self.given[-1] if self.maker in ("leads_to", "eventually", "until") else None

    @property
    def meanwhile(self) -> Formula | None:
        """The formula that must hold until then, or None."""
        return self.given[0] if self.maker == "until" else None

    @property
    def from_start(self) -> bool:
        """Whether what is asked for is asked once, at the start of the run."""
        return self.maker in ("eventually", "until")

    def atoms(self) -> Iterator[Atom]:
        """Yield what it names, each as often as it is named."""
        for formula in self.given:
            yield from atoms_of(formula)

    def moved(self, to: Callable[[str], str]) -> Property:
        """Return the same property about other paths: `to` gives that of each."""
        return replace(self, given=tuple(formula.moved(to) for formula in self.given))

    def judge(self, start: float) -> Judge:
        """Return what judges a run that starts at this time."""
        if self.answer is None:
            return _Always(self)
        return _Response(self, start)


def always(formula: Formula) -> Property:
    """It holds at every point."""
    return _made("always", formula)


def never(formula: Formula) -> Property:
    """It holds at no point."""
    return _made("never", formula)


def precedes(first: Formula, then: Formula) -> Property:
    """Whenever `then` holds, `first` holds or held before."""
    return _made("precedes", first, then)


def leads_to(formula: Formula, answer: Formula, *, within_s: float = math.inf) -> Property:
    """Whenever the formula holds, the answer holds at that point or at most `within_s` seconds later."""
    return _made("leads_to", formula, answer, within_s=within_s)


def eventually(formula: Formula, *, within_s: float = math.inf) -> Property:
    """It holds at some point, at most `within_s` seconds after the start of the run."""
    return _made("eventually", formula, within_s=within_s)


def until(holds: Formula, comes: Formula, *, within_s: float = math.inf) -> Property:
    """`comes` holds at some point, within these seconds from the start, and `holds` holds at every earlier point."""
    return _made("until", holds, comes, within_s=within_s)


def _made(maker: str, *given: Formula, within_s: float = math.inf) -> Property:
    return Property(maker, tuple(need_formula(one, maker) for one in given), _seconds(within_s, maker))


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


def _seconds(within_s: Any, what: str) -> float:
    if isinstance(within_s, bool) or not isinstance(within_s, int | float) or not within_s >= 0:
        raise UsageError(f"within_s of {what} is a time in seconds, from 0 on, got {within_s!r}")
    return float(within_s)
