"""Limits of values, in the terms of annotated-types, and checks of values against them.

A limit on numbers holds for every element of a list, set, tuple or array; `Len` and `Predicate` hold for the whole.
Depends on values and types, not on parameters.
"""

from __future__ import annotations

import math
import types
import typing
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Annotated, Any, Final

import annotated_types as at
import msgspec
import numpy as np

from hfg.types import Named, Shape, accepts


class Inside(msgspec.Struct, frozen=True, repr_omit_defaults=True):
    """Limits of a type's parts, as in `list[Annotated[float, Ge(0)]]`."""

    hint: Any


LIMITS: Final = (
    at.Gt,
    at.Ge,
    at.Lt,
    at.Le,
    at.MultipleOf,
    at.MinLen,
    at.MaxLen,
    at.Predicate,
    Inside,
)


def limits_of(metadata: Iterable[Any]) -> tuple[Any, ...]:
    """Open groups such as `Interval` and keep only limits; other metadata is ignored."""
    limits: list[Any] = []
    for item in metadata:
        if isinstance(item, at.GroupedMetadata):
            limits.extend(limits_of(list(item)))
        elif isinstance(item, slice):  # the short form of Len
            limits.extend(limits_of([at.Len(item.start or 0, item.stop)]))
        elif isinstance(item, LIMITS):
            limits.append(item)
    return tuple(limits)


def limits_within(hint: Any) -> tuple[Any, ...]:
    """Return the limits of the parts of a type, as one limit; empty if there are none."""
    return (Inside(hint),) if any(map(_asks, typing.get_args(_bare(hint)))) else ()


def _bare(hint: Any) -> Any:
    return typing.get_args(hint)[0] if typing.get_origin(hint) is Annotated else hint


def _asks(hint: Any) -> bool:
    own = limits_of(getattr(hint, "__metadata__", ())) if typing.get_origin(hint) is Annotated else ()
    return bool(own) or any(map(_asks, typing.get_args(_bare(hint))))


def breaks(limit: Any, value: Any) -> str | None:
    """Return which limit a value violates: "must be <= 1"; None if it violates none."""
    try:
        match limit:
            case at.Gt(gt):
                return None if _all(value, lambda one: one > gt) else f"must be > {gt!r}"
            case at.Ge(ge):
                return None if _all(value, lambda one: one >= ge) else f"must be >= {ge!r}"
            case at.Lt(lt):
                return None if _all(value, lambda one: one < lt) else f"must be < {lt!r}"
            case at.Le(le):
                return None if _all(value, lambda one: one <= le) else f"must be <= {le!r}"
            case at.MultipleOf(step):
                return None if _all(value, lambda one: _divides(step, one)) else f"must be a multiple of {step!r}"
            case at.MinLen(length):
                return None if len(value) >= length else f"must have at least {length} items"
            case at.MaxLen(length):
                return None if len(value) <= length else f"must have at most {length} items"
            case at.Predicate(func):
                return None if func(value) else f"must satisfy {getattr(func, '__name__', func)}"
            case Inside(hint):
                return _breaks_within(hint, value)
    except Exception as error:
        return f"cannot be compared with {limit!r} ({type(error).__name__}: {error})"
    return None


def _all(value: Any, holds: Callable[[Any], Any]) -> bool:
    if isinstance(value, np.ndarray):
        return bool(np.all(holds(value)))
    if isinstance(value, list | tuple | set | frozenset):
        return all(_all(one, holds) for one in value)
    return bool(holds(value))


def _divides(step: Any, value: Any) -> Any:
    """Return whether a value is a multiple; 0.3 counts as a multiple of 0.1 despite rounding."""
    if isinstance(value, np.ndarray) and (value.dtype.kind == "f" or isinstance(step, float)):
        return np.abs(value / step - np.round(value / step)) <= 1e-9 * np.maximum(1, np.abs(value / step))
    if isinstance(value, float) or isinstance(step, float):
        return math.isfinite(value) and abs(math.remainder(value, step)) <= 1e-9 * max(abs(value), abs(step))
    return value % step == 0


def _breaks_within(hint: Any, value: Any) -> str | None:
    """Return what a part of the value violates, and which part."""
    bare = _bare(hint)
    arguments = typing.get_args(bare)
    for place, part, asked in _parts(bare, arguments, value):
        own = limits_of(getattr(asked, "__metadata__", ())) if typing.get_origin(asked) is Annotated else ()
        wrong = next((wrong for limit in own if (wrong := breaks(limit, part))), None) or _breaks_within(asked, part)
        if wrong is not None:
            return f"{place}{wrong}" if wrong.startswith("[") or not place else f"{place} {wrong}"
    return None


def _parts(hint: Any, arguments: tuple[Any, ...], value: Any) -> list[tuple[str, Any, Any]]:
    """Yield place, value and type of each part of a value."""
    if not arguments:
        return []
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        return [("", value, member) for member in arguments if accepts(value, member)][:1]
    if isinstance(value, Mapping) and len(arguments) == 2:
        keys = [(f"[{key!r:.40}]", key, arguments[0]) for key in value]
        return keys + [(f"[{key!r:.40}]", one, arguments[1]) for key, one in value.items()]
    if isinstance(value, tuple) and arguments[1:] != (...,):
        return [(f"[{number}]", *both) for number, both in enumerate(zip(value, arguments, strict=False))]
    if isinstance(value, Collection) and not isinstance(value, str | bytes | np.ndarray):
        return [(f"[{number}]", one, arguments[0]) for number, one in enumerate(value)]
    return []


def numbers_within(limits: Iterable[Any]) -> tuple[Any, Any]:
    """Return the smallest and the largest number in limits, whether included or excluded; None for no limit."""
    low: list[Any] = []
    high: list[Any] = []
    for limit in limits:
        match limit:
            case at.Ge(bound) | at.Gt(bound):
                low.append(bound)
            case at.Le(bound) | at.Lt(bound):
                high.append(bound)
    return max(low, default=None), min(high, default=None)


def step_within(limits: Iterable[Any]) -> Any:
    """Return the step that values must be multiples of; None without such a limit."""
    return next((limit.multiple_of for limit in limits if isinstance(limit, at.MultipleOf)), None)


def kept_metadata(hint: Any) -> Any:
    """Remove limits from a type, and keep metadata that belongs to the type: the layout of an array, and its name."""
    if typing.get_origin(hint) is not Annotated:
        return hint
    bare = typing.get_args(hint)[0]
    for item in hint.__metadata__:
        if isinstance(item, Shape | Named):
            bare = Annotated[bare, item]
    return bare
