"""Limits of values, in the words of annotated-types, and what a value says to them.

A limit on numbers holds for every element of a list, set, tuple or array; `Len` and `Predicate` for the whole. Stands
on values and types; knows no parameter.
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

__all__ = ["LIMITS", "Inside", "breaks", "kept_metadata", "limits_of", "limits_within", "numbers_within", "step_within"]


class Inside(msgspec.Struct, frozen=True, repr_omit_defaults=True):
    """Limits that a type has further in, as in `list[Annotated[float, Ge(0)]]`."""

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
    """Open groups such as `Interval` and keep what is a limit; other metadata is somebody else's."""
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
    """Give what the parts of a type ask for, as one limit; nothing if they ask for nothing."""
    return (Inside(hint),) if any(map(_asks, typing.get_args(_bare(hint)))) else ()


def _bare(hint: Any) -> Any:
    return typing.get_args(hint)[0] if typing.get_origin(hint) is Annotated else hint


def _asks(hint: Any) -> bool:
    own = limits_of(getattr(hint, "__metadata__", ())) if typing.get_origin(hint) is Annotated else ()
    return bool(own) or any(map(_asks, typing.get_args(_bare(hint))))


def breaks(limit: Any, value: Any) -> str | None:
    """Say which limit a value breaks: "must be <= 1"; None if it keeps it."""
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
    """Whether a value is a multiple; 0.3 is one of 0.1, for all that the computer knows."""
    if isinstance(value, np.ndarray) and (value.dtype.kind == "f" or isinstance(step, float)):
        return np.abs(value / step - np.round(value / step)) <= 1e-9 * np.maximum(1, np.abs(value / step))
    if isinstance(value, float) or isinstance(step, float):
        return math.isfinite(value) and abs(math.remainder(value, step)) <= 1e-9 * max(abs(value), abs(step))
    return value % step == 0


def _breaks_within(hint: Any, value: Any) -> str | None:
    """Say what a part of the value breaks, and which part."""
    bare = _bare(hint)
    arguments = typing.get_args(bare)
    for place, part, asked in _parts(bare, arguments, value):
        own = limits_of(getattr(asked, "__metadata__", ())) if typing.get_origin(asked) is Annotated else ()
        wrong = next((wrong for limit in own if (wrong := breaks(limit, part))), None) or _breaks_within(asked, part)
        if wrong is not None:
            return f"{place}{wrong}" if wrong.startswith("[") or not place else f"{place} {wrong}"
    return None


def _parts(hint: Any, arguments: tuple[Any, ...], value: Any) -> list[tuple[str, Any, Any]]:
    """Where, what, and of which type the parts of a value are."""
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
    """Give the smallest and the largest number that limits speak of, allowed or just not; None for no end."""
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
    """Give what values are multiples of; None without such a limit."""
    return next((limit.multiple_of for limit in limits if isinstance(limit, at.MultipleOf)), None)


def kept_metadata(hint: Any) -> Any:
    """Take what limits said off a type, and keep what belongs to it: the layout of an array, and its name."""
    if typing.get_origin(hint) is not Annotated:
        return hint
    bare = typing.get_args(hint)[0]
    for item in hint.__metadata__:
        if isinstance(item, Shape | Named):
            bare = Annotated[bare, item]
    return bare
