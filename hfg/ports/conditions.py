"""Conditions for showing a parameter: values of other parameters of the same node, in a form that files can hold.

Depends on limits and values.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, TypeAlias, cast

import annotated_types as at
import msgspec

from hfg.base.limits import Inside, breaks, limits_of
from hfg.base.values import same
from hfg.errors import DeclarationError

__all__ = ["Condition", "ShownIf", "conditions_of"]

ShownIf: TypeAlias = str | Mapping[str, Any]
"""The name of a parameter that must be on; or a mapping from names to a value, a list or set of values, or a limit."""


class Condition(msgspec.Struct, frozen=True):
    """A condition on one parameter: it has one of some values and keeps some limits.

    Attributes:
      parameter: its name.
      values: the values that it may have; if empty, only the limits count.
      limits: annotated-types limits other than `Predicate`, which is code.
      on: the parameter must be on: neither False, 0, empty nor None.
    """

    parameter: str
    values: tuple[Any, ...] = ()
    limits: tuple[Any, ...] = ()
    on: bool = False

    def holds(self, value: Any) -> bool:
        """Return whether the condition holds if the parameter has this value."""
        if self.on:
            return bool(value.any()) if hasattr(value, "any") else bool(value)
        if self.values and not any(_equal(value, one) for one in self.values):
            return False
        return all(breaks(limit, value) is None for limit in self.limits)

    def in_words(self) -> str:
        """Return the condition in words: `mode is "custom"`."""
        if self.on:
            return f"{self.parameter} is on"
        said = [f"is {' or '.join(map(repr, self.values))}"] if self.values else []
        return f"{self.parameter} {' and '.join(said + [str(_in_words(limit)) for limit in self.limits])}"


def _equal(value: Any, wanted: Any) -> bool:
    """Return whether two values are equal; 1 and 1.0 are the same number here."""
    numbers = isinstance(value, int | float) and isinstance(wanted, int | float)
    return bool(value == wanted) if numbers else same(value, wanted)


def _in_words(limit: Any) -> str:
    """Return a limit in words, as its error message shows it: "> 3"."""
    match limit:
        case at.Gt(bound):
            return f"> {bound!r}"
        case at.Ge(bound):
            return f">= {bound!r}"
        case at.Lt(bound):
            return f"< {bound!r}"
        case at.Le(bound):
            return f"<= {bound!r}"
        case at.MultipleOf(step):
            return f"is a multiple of {step!r}"
        case at.MinLen(length):
            return f"has at least {length} items"
        case at.MaxLen(length):
            return f"has at most {length} items"
    return repr(limit)


def conditions_of(said: ShownIf | None, where: str) -> tuple[Condition, ...]:
    """Return the conditions of a declaration.

    Raises:
      DeclarationError: it is not a condition, or a file could not hold it.
    """
    if said is None:
        return ()
    if isinstance(said, str):
        return (Condition(said, on=True),)
    if not isinstance(cast(object, said), Mapping) or not said or not all(isinstance(name, str) for name in said):
        raise DeclarationError(
            f"{where}: shown_if names parameters of the same node and what they must be, got {said!r:.80}; write "
            'shown_if={"mode": "custom"}, or shown_if="mode" for one that must be on'
        )
    return tuple(_condition(name, wanted, where) for name, wanted in said.items())


def _condition(name: str, wanted: Any, where: str) -> Condition:
    limits = limits_of([wanted])
    is_code = any(isinstance(limit, at.Predicate | Inside) for limit in limits)
    if is_code or (callable(wanted) and not limits):
        raise DeclarationError(
            f'{where}: shown_if has a condition on "{name}" that only code can decide, {wanted!r:.80}, and '
            "files hold no code; use the values, as a list, or a limit such as annotated_types.Gt(3)"
        )
    if limits:
        return Condition(name, limits=limits)
    if isinstance(wanted, list | set | frozenset):
        several: Collection[Any] = wanted
        return Condition(name, values=tuple(several if isinstance(several, list) else sorted(several, key=repr)))
    return Condition(name, values=(wanted,))
