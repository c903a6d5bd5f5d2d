"""Conditions of breakpoints as data, for nothing that a page says is ever run as code. Depends on `messages`."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from typing import Any, Final

from hfg.errors import shown
from hfg.studio.messages import Condition

__all__ = ["condition_text", "holds", "part_of"]

_COMPARISONS: Final[Mapping[str, Callable[[Any, Any], Any]]] = {
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
    return bool(_COMPARISONS[condition.op](part_of(value, condition.field), condition.value))


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
