"""The language of monitors: conditions over what happens in a run, and over what has happened before.

A *point* is a moment at which something happens that a formula names: a value passes a port, a node fires, the
activity of a node changes. A formula is true or false at each point. The operators look back only, so that its truth is
known at once: *past-time metric temporal logic* over points (Havelund and Roșu 2002; Thati and Roșu 2005). Depends on
`conditions`.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, Final, NoReturn, Self

from hfg.errors import HfgError, UsageError
from hfg.monitors.conditions import Condition, parse_condition

_PLAIN: Final = re.compile(r"[^\s,()&|~\"]+")

MOST_POINTS: Final = 1_000_000
"""That `at_least` counts: it remembers the time of each (rule L4)."""


class Formula:
    """What is true or false at each point; combine formulas with `&`, `|`, `~` and `implies`."""

    __slots__ = ()

    def __and__(self, other: Formula) -> Formula:
        """Both."""
        return And(self, need_formula(other, "&"))

    def __or__(self, other: Formula) -> Formula:
        """One of them, or both."""
        return Or(self, need_formula(other, "|"))

    def __invert__(self) -> Formula:
        """Not this one."""
        return Not(self)

    def implies(self, other: Formula) -> Formula:
        """Where this holds the other one holds as well."""
        return Or(Not(self), need_formula(other, "implies"))

    def __bool__(self) -> NoReturn:
        """Python's own operators ask at once, before there is a run."""
        raise UsageError("a formula has no truth before the run: combine formulas with & | ~ instead of and, or, not")

    def parts(self) -> tuple[Formula, ...]:
        """Return the formulas that it consists of."""
        return ()

    def moved(self, to: Callable[[str], str]) -> Self:
        """Return the same formula about other paths: `to` gives that of each."""
        changed: dict[str, Any] = {}
        for field in fields(self):  # type: ignore[arg-type]  # all formulas are dataclasses
            value = getattr(self, field.name)
            if isinstance(value, Formula):
                changed[field.name] = value.moved(to)
            elif field.name in ("node", "port"):
                changed[field.name] = to(value)
        return replace(self, **changed)  # type: ignore[type-var]


@dataclass(frozen=True, slots=True)
class Active(Formula):
    """A(node) holds."""

    node: str

    def __str__(self) -> str:
        return f"active({_quoted(self.node)})"


@dataclass(frozen=True, slots=True)
class Sent(Formula):
    """At this point a value passes a port that satisfies the condition."""

    port: str
    when: Callable[[Any], object] | None = None
    older_than_s: float | None = None

    def __str__(self) -> str:
        said = "" if self.when is None else f", {_named(self.when)}"
        said += "" if self.older_than_s is None else f", older_than_s={plain_number(self.older_than_s)}"
        return f"sent({_quoted(self.port)}{said})"


@dataclass(frozen=True, slots=True)
class Fired(Formula):
    """At this point a firing of the node is over in which its function ran."""

    node: str

    def __str__(self) -> str:
        return f"fired({_quoted(self.node)})"


@dataclass(frozen=True, slots=True)
class Not(Formula):
    """See `Formula.__invert__`."""

    of: Formula

    def parts(self) -> tuple[Formula, ...]:
        """See `Formula`."""
        return (self.of,)

    def __str__(self) -> str:
        return f"~{self.of}"


@dataclass(frozen=True, slots=True)
class And(Formula):
    """See `Formula.__and__`."""

    one: Formula
    other: Formula

    def parts(self) -> tuple[Formula, ...]:
        """See `Formula`."""
        return (self.one, self.other)

    def __str__(self) -> str:
        return f"({_first(self)} & {self.other})"


@dataclass(frozen=True, slots=True)
class Or(Formula):
    """See `Formula.__or__`."""

    one: Formula
    other: Formula

    def parts(self) -> tuple[Formula, ...]:
        """See `Formula`."""
        return (self.one, self.other)

    def __str__(self) -> str:
        return f"({_first(self)} | {self.other})"


@dataclass(frozen=True, slots=True)
class Previously(Formula):
    """See `previously`."""

    of: Formula

    def parts(self) -> tuple[Formula, ...]:
        """See `Formula`."""
        return (self.of,)

    def __str__(self) -> str:
        return f"previously({unbracketed(self.of)})"


@dataclass(frozen=True, slots=True)
class Since(Formula):
    """See `since`; `holds` is None where nothing has to hold since then."""

    holds: Formula | None
    began: Formula
    at_least_s: float
    within_s: float

    def parts(self) -> tuple[Formula, ...]:
        """See `Formula`."""
        return (self.began,) if self.holds is None else (self.holds, self.began)

    def __str__(self) -> str:
        said = "" if self.at_least_s == 0 else f", at_least_s={plain_number(self.at_least_s)}"
        said += "" if self.within_s == math.inf else f", within_s={plain_number(self.within_s)}"
        return (
            f"once({unbracketed(self.began)}{said})"
            if self.holds is None
            else f"since({unbracketed(self.holds)}, {unbracketed(self.began)}{said})"
        )


@dataclass(frozen=True, slots=True)
class Times(Formula):
    """See `at_least`."""

    number: int
    of: Formula
    within_s: float

    def parts(self) -> tuple[Formula, ...]:
        """See `Formula`."""
        return (self.of,)

    def __str__(self) -> str:
        said = "" if self.within_s == math.inf else f", within_s={plain_number(self.within_s)}"
        return f"at_least({self.number}, {unbracketed(self.of)}{said})"


def active(node: Any) -> Formula:
    """A(node): the node, or the subgraph, is active.

    Args:
      node: the node, or its path.
    """
    return Active(_path(node, "active", "a node"))


def sent(port: Any, when: Callable[[Any], object] | str | None = None, *, older_than_s: float | None = None) -> Formula:
    """A value passes a port now: an output sends it, an event is triggered with it, a slot or input is given it.

    Args:
      port: the port, or its path, such as "camera.image".
      when: a condition for the value, as a function or as text, "value > 3"; by default any value will do. Markers
        (NO_MESSAGE, END) are not values.
      older_than_s: only if its stamp is older than that; so `never(sent("steer.found", older_than_s=0.05))` is a
        deadline from the source, whose firing gave the stamp (rule T5), to this port.
    """
    if isinstance(when, str):
        when = parse_condition(when)
    if when is not None and not callable(when):
        raise UsageError(f"sent({port!r}, ...) takes a condition, such as lambda value: value > 3, got {when!r}")
    if older_than_s is not None:
        older_than_s, _ = _bounds("sent", older_than_s, math.inf)
    return Sent(_path(port, "sent", "a port"), when, older_than_s)


def fired(node: Any) -> Formula:
    """A firing of the node is over now, in which its function ran (rule A9, `processed`).

    Args:
      node: the node, or its path.
    """
    return Fired(_path(node, "fired", "a node"))


def previously(formula: Formula) -> Formula:
    """It held at the point before; false at the first one."""
    return Previously(need_formula(formula, "previously"))


def once(formula: Formula, *, within_s: float = math.inf, at_least_s: float = 0.0) -> Formula:
    """It holds, or held at an earlier point, at most `within_s` and at least `at_least_s` seconds ago."""
    return Since(None, need_formula(formula, "once"), *_bounds("once", at_least_s, within_s))


def since(holds: Formula, began: Formula, *, within_s: float = math.inf, at_least_s: float = 0.0) -> Formula:
    """`began` held at some point, within these seconds, and `holds` has held at each point after that one."""
    bounds = _bounds("since", at_least_s, within_s)
    return Since(need_formula(holds, "since"), need_formula(began, "since"), *bounds)


def throughout(formula: Formula, *, last_s: float = math.inf) -> Formula:
    """It has held at each point of the last `last_s` seconds, this one included; by default from the beginning."""
    return Not(Since(None, Not(need_formula(formula, "throughout")), *_bounds("throughout", 0.0, last_s)))


def at_least(number: int, formula: Formula, *, within_s: float = math.inf) -> Formula:
    """It has held at `number` points of the last `within_s` seconds, this one included: a count, or a rate."""
    if type(number) is not int or not 1 <= number <= MOST_POINTS:
        raise UsageError(f"at_least(number, ...) counts points, from 1 to {MOST_POINTS:,}, got {number!r:.40}")
    return Times(number, need_formula(formula, "at_least"), _bounds("at_least", 0.0, within_s)[1])


def atoms_of(formula: Formula) -> Iterator[Active | Sent | Fired]:
    """Yield what a formula names, each as often as it is named."""
    if isinstance(formula, Active | Sent | Fired):
        yield formula
    for part in formula.parts():
        yield from atoms_of(part)


def need_formula(given: object, what: str) -> Formula:
    """Return what was given.

    Raises:
      UsageError: it is not a formula.
    """
    if not isinstance(given, Formula):
        raise UsageError(f"{what} takes formulas, such as active(node) or sent(port), got {given!r}")
    return given


def _bounds(what: str, at_least_s: Any, within_s: Any) -> tuple[float, float]:
    numbers = all(isinstance(one, int | float) and not isinstance(one, bool) for one in (at_least_s, within_s))
    if not numbers or not 0 <= at_least_s <= within_s or at_least_s == math.inf:
        raise UsageError(
            f"{what} looks back by seconds from 0 on, the least first, got at least {at_least_s!r} and at most "
            f"{within_s!r}"
        )
    return float(at_least_s), float(within_s)


def _path(given: Any, what: str, expected: str) -> str:
    path = given if isinstance(given, str) else getattr(given, "path", None) or getattr(_place(given), "path", None)
    if not isinstance(path, str) or not path:
        raise UsageError(f"{what} takes {expected} of the graph, given itself or by path, got {given!r}")
    return path


def _place(given: Any) -> Any:
    """Return where a node is in its graph; None before it is added, and of what is not a node."""
    try:
        return getattr(given, "place", None)
    except HfgError:
        return None


def _first(joined: And | Or) -> str:
    """Return the text of what stands before the last sign; a chain needs one pair of brackets."""
    return unbracketed(joined.one) if isinstance(joined.one, type(joined)) else str(joined.one)


def unbracketed(formula: Formula) -> str:
    """Return the text of a formula where a comma or the bracket of a function ends it."""
    text = str(formula)
    return text[1:-1] if isinstance(formula, And | Or) else text


def _quoted(path: str) -> str:
    return path if _PLAIN.fullmatch(path) else json.dumps(path, ensure_ascii=False)


def plain_number(value: float) -> str:
    """Return the shortest text of a number that means exactly this number."""
    short = f"{value:g}"
    return short if float(short) == value else repr(value)


def _named(function: Callable[..., object]) -> str:
    if isinstance(function, Condition):
        return str(function)
    name = getattr(function, "__name__", "")
    return "..." if name in ("", "<lambda>") else name
