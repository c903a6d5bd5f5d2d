"""Value types for parameters that Python lacks, and two operations on any value: equality and copying.

For receivers, `Colour` and `Span` are plain tuples. Depends on numpy, not on types or ports.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping
from typing import Any, Final, Generic, NamedTuple, TypeVar

import msgspec
import numpy as np

T = TypeVar("T")

_HEX: Final = re.compile(r"#([0-9a-fA-F]{6}|[0-9a-fA-F]{3})")


class Colour(NamedTuple):
    """A colour: red, green and blue, 0 to 255 each.

    Examples:
      >>> Colour.of("#ff8000")
      Colour(red=255, green=128, blue=0)
      >>> Colour(255, 128, 0).bgr  # as OpenCV wants it
      (0, 128, 255)
    """

    red: int
    green: int
    blue: int

    @classmethod
    def of(cls, text: str) -> Colour:
        """Read "#rrggbb", or "#rgb" for short.

        Raises:
          ValueError: the text has another form.
        """
        found = _HEX.fullmatch(text.strip())
        if found is None:
            raise ValueError(f'{text!r:.80} is not a colour; write "#rrggbb", as in "#ff8000"')
        digits = found[1] if len(found[1]) == 6 else "".join(2 * digit for digit in found[1])
        return cls(*bytes.fromhex(digits))

    @property
    def hex(self) -> str:
        """The colour as "#rrggbb"."""
        return f"#{self.red:02x}{self.green:02x}{self.blue:02x}"

    @property
    def bgr(self) -> tuple[int, int, int]:
        """Blue, green and red, the order of OpenCV."""
        return (self.blue, self.green, self.red)


class Span(NamedTuple, Generic[T]):
    """An interval of numbers, low <= high; as a parameter, limits hold for both ends.

    Examples:
      >>> band = Span(0.2, 0.8)
      >>> 0.5 in band, band.low
      (True, 0.2)
    """

    low: T
    high: T

    def __contains__(self, value: Any) -> bool:
        """Return whether a number is in the interval, ends included."""
        return bool(self.low <= value <= self.high)


_ATOMS: Final = frozenset({bool, int, str, bytes, type(None), complex})
_CONTAINERS: Final = frozenset({list, tuple, dict, set, frozenset})


def same(one: Any, other: Any) -> bool:
    """Return whether two values are equal, including their types.

    Arrays need equal dtype, shape and elements; nan equals nan. Values that cannot be compared are equal only to
    themselves.
    """
    if one is other:
        return True
    if isinstance(one, np.generic):
        one = one.item()
    if isinstance(other, np.generic):
        other = other.item()
    kind = type(one)
    if kind is not type(other):
        return False
    if kind is float:
        return bool(one == other) or (math.isnan(one) and math.isnan(other))
    if kind is complex:
        return same(one.real, other.real) and same(one.imag, other.imag)
    if kind in _ATOMS:
        return bool(one == other)
    try:
        if isinstance(one, np.ndarray):
            equal = one.dtype == other.dtype and one.shape == other.shape
            return equal and np.array_equal(one, other, equal_nan=one.dtype.kind in "fc")
        if isinstance(one, list | tuple):
            return len(one) == len(other) and all(map(same, one, other))
        if isinstance(one, Mapping):
            return len(one) == len(other) and all(key in other and same(one[key], other[key]) for key in one)
        parts = _fields(one)
        if parts is not None:  # an object that contains an array cannot decide itself whether it is equal
            return all(same(getattr(one, name), getattr(other, name)) for name in parts)
        return bool(one == other)
    except Exception:  # users' values may raise anything
        return False


def _fields(value: Any) -> tuple[str, ...] | None:
    """Return the fields that define a value; None if it has none, or does not compare by them."""
    if isinstance(value, msgspec.Struct):
        return value.__struct_fields__ if value.__struct_config__.eq else None
    if dataclasses.is_dataclass(value):
        parameters: Any = getattr(type(value), "__dataclass_params__", None)
        if parameters is not None and parameters.eq:
            return tuple(item.name for item in dataclasses.fields(value) if item.compare)
    return None


def own_copy(value: Any) -> Any:
    """Return a value that other code cannot change: containers are copied, and arrays are copied and read-only.

    Other objects are returned unchanged.
    """
    kind = type(value)
    if kind in _ATOMS or kind is float:
        return value
    if isinstance(value, np.ndarray):
        if not value.flags.writeable and value.flags.owndata:
            return value
        value = value.copy()
        value.flags.writeable = False
        return value
    if kind not in _CONTAINERS:
        return value
    if kind is dict:
        return {key: own_copy(one) for key, one in value.items()}
    if kind is tuple:
        parts = tuple(map(own_copy, value))
        return value if all(a is b for a, b in zip(parts, value, strict=True)) else parts
    if kind is list:
        return list(map(own_copy, value))
    return kind(value)
