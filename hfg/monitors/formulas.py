"""The language of monitors: conditions over what happens in a run, and over what has happened before.

A *point* is a moment at which something happens that a formula names: a value passes a port, a node fires, the
activity of a node changes. A formula is true or false at each point. The operators look back only, so that its truth is
known at once: *past-time metric temporal logic* over points (Havelund and Roșu 2002; Thati and Roșu 2005). Depends on
`errors`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NoReturn

from hfg.errors import HfgError, UsageError

__all__ = [
    "Active",
    "And",
    "Fired",
    "Formula",
    "Not",
    "Or",
    "Previously",
    "Sent",
    "Since",
    "Times",
    "active",
    "at_least",
    "atoms_of",
    "fired",
    "need_formula",
    "once",
    "previously",
    "sent",
    "since",
    "throughout",
]


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


@dataclass(frozen=True, slots=True)
class Active(Formula):
    """A(node) holds."""

    node: str

    def __str__(self) -> str:
        return f"active({self.node})"


@dataclass(frozen=True, slots=True)
class Sent(Formula):
    """At this point a value passes a port that satisfies the condition."""

    port: str
    when: Callable[[Any], object] | None = None

    def __str__(self) -> str:
        return f"sent({self.port})" if self.when is None else f"sent({self.port}, {_named(self.when)})"


@dataclass(frozen=True, slots=True)
class Fired(Formula):
    """At this point a firing of the node is over in which its function ran."""

    node: str

    def __str__(self) -> str:
        return f"fired({self.node})"


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
        return f"({self.one} & {self.other})"


@dataclass(frozen=True, slots=True)
class Or(Formula):
    """See `Formula.__or__`."""

    one: Formula
    other: Formula

    def parts(self) -> tuple[Formula, ...]:
        """See `Formula`."""
        return (self.one, self.other)

    def __str__(self) -> str:
        return f"({self.one} | {self.other})"


@dataclass(frozen=True, slots=True)
class Previously(Formula):
    """See `previously`."""

    of: Formula

    def parts(self) -> tuple[Formula, ...]:
        """See `Formula`."""
        return (self.of,)

    def __str__(self) -> str:
        return f"previously({self.of})"


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
        said = "" if self.at_least_s == 0 else f", at_least_s={self.at_least_s:g}"
        said += "" if self.within_s == math.inf else f", within_s={self.within_s:g}"
        return f"once({self.began}{said})" if self.holds is None else f"since({self.holds}, {self.began}{said})"


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
        return f"at_least({self.number}, {self.of}, within_s={self.within_s:g})"


def active(node: Any) -> Formula:
    """A(node): the node, or the subgraph, is active.

    Args:
      node: the node, or its path.
    """
    return Active(_path(node, "active", "a node"))


def sent(port: Any, when: Callable[[Any], object] | None = None) -> Formula:
    """A value passes a port now: an output sends it, an event is triggered with it, a slot or input is given it.

    Args:
      port: the port, or its path, such as "camera.image".
      when: a condition for the value; by default any value will do. Markers (NO_MESSAGE, END) are not values.
    """
    if when is not None and not callable(when):
        raise UsageError(f"sent({port!r}, ...) takes a condition, such as lambda value: value > 3, got {when!r}")
    return Sent(_path(port, "sent", "a port"), when)


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
    if type(number) is not int or number < 1:
        raise UsageError(f"at_least(number, ...) counts points, from 1 on, got {number!r}")
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


def _named(function: Callable[..., object]) -> str:
    name = getattr(function, "__name__", "")
    return "..." if name in ("", "<lambda>") else name
