"""Conditions of breakpoints as data, for nothing that a page says is ever run as code. Depends on `messages`."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from typing import Any, Final

from hfg.base.token import Token
from hfg.errors import in_words, shown
from hfg.studio.messages import Condition

__all__ = ["COMPARISONS", "Looked", "condition_text", "holds", "part_of"]

COMPARISONS: Final[Mapping[str, Callable[[Any, Any], Any]]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "contains": operator.contains,
}


def holds(condition: Condition, value: object) -> bool:
    """Say whether a condition holds of a value."""
    return bool(COMPARISONS[condition.op](part_of(value, condition.field), condition.value))


class Looked:
    """Looks at each token whether a condition holds; what cannot be compared does not hold.

    Attributes:
      why_not: why the last value could not be compared; "" if it could.
    """

    def __init__(self, condition: Condition, failed: Callable[[], None]) -> None:
        self._condition = condition
        self._failed = failed
        self.why_not = ""

    def __call__(self, token: Token[Any]) -> bool:
        """Return whether it holds; say once if values cannot be compared."""
        try:
            found, why_not = holds(self._condition, token.value), ""
        except Exception as error:  # of the values' own code, too
            found, why_not = False, in_words(error)
        if why_not != self.why_not:
            self.why_not = why_not
            self._failed()
        return found


def part_of(value: object, field: str) -> Any:
    """Return a part of a value: "pose.x", "0.name"; "" is the value itself.

    Only fields of data are read: keys, numbers of elements, attributes without underscore, except methods.

    Raises:
      LookupError: it has no such part.
    """
    found: Any = value
    for name in field.split(".") if field else ():
        if isinstance(found, Mapping):
            found = found[name]
        elif name.isdecimal():
            found = found[int(name)]
        else:
            part = None if name.startswith("_") else getattr(found, name, None)
            if part is None or callable(part):
                raise LookupError(f'{shown(found, 40)} has no part "{name}"')
            found = part
    return found


def condition_text(condition: Condition | None) -> str:
    """Return a condition in words."""
    if condition is None:
        return ""
    return f"{condition.field or 'value'} {condition.op} {shown(condition.value, 40)}"
