"""Values at the edges of what a type hint allows: NaN and infinity, empty and huge, strange layouts of memory.

`values` draws what is ordinary, so that nodes do their work; this module draws what native code falls over. Nothing
shrinks: a value belongs to its seed, and is made again from it. Arrays may end right before a page that cannot be
touched, so that code which reads or writes beyond them ends at once and not some time later. Knows no nodes.
"""

from __future__ import annotations

import collections
import ctypes
import enum
import mmap
import os
import random
import sys
import types
import typing
from collections import abc
from pathlib import Path, PurePath
from typing import Any, Final, Literal

import annotated_types
import numpy as np

from hfg.base.generics import callable_parts
from hfg.base.values import Colour, Span
from hfg.encoding.records import names_of
from hfg.ports.specs import ParameterSpec
from hfg.testing.opening import opened
from hfg.testing.samples import PATHS
from hfg.types import ArrayFacts, array_facts, bare_type

__all__ = ["Hostile"]

_SIDES: Final = (1, 1, 2, 3, 3, 4, 5, 7, 8, 9, 12, 15, 16, 17, 24, 31, 32, 33, 48, 63, 64, 65, 100)
_SMALL: Final = (1, 2, 3, 3, 4, 5)
_LENGTHS: Final = (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 12, 16, 24, 31, 64, 100)
_INTEGERS: Final = (0, 1, -1, 2, 3, 5, 7, 8, 16, 31, 64, 127, 255, 256, 1000, 2**15, 2**16, 2**31 - 1, -(2**31), 2**31)
_FAR: Final = (2**32, 2**63 - 1, -(2**63), 2**63, 2**64, 10**30)
_FLOATS: Final = (
    *(0.0, -0.0, 1.0, -1.0, 0.5, 2.0, 1e-9, 1e-40, 5e-324, 1e9, -1e9, 1e30, -1e30, 3.4e38, 1e300, 1.7e308),
    *(float("nan"), float("inf"), float("-inf"), 32767.0, 2.0**31, 2.0**63),
)
_LETTERS: Final = "aB1 .,:;-+_/\\'\"{}[]()%$\n\t\0\x7f\x1b\u00e9\u00df\u6f22\U0001f642\ud800\udfff\ufeff\u202e"
_TEXTS: Final = ("", "1", "-2.5", "nan", "a, b", '{"a": 1}', "\ud800", "a\udcff", "\0", "x" * 5000, "%s%n", "\u0000a")
_DTYPES: Final = (
    "u1",
    "i1",
    "u2",
    "i2",
    "i4",
    "u4",
    "i8",
    "u8",
    "f2",
    "f4",
    "f8",
    "?",
    "c8",
    "c16",
    "O",
    "U3",
    "M8[s]",
)
_DEEPEST: Final = 3


class _Guarded:
    """Memory between two pages that cannot be touched; the process ends if code does.

    A block is used again and again, so arrays in it are for one call.
    """

    SIZE: Final = 1 << 18
    ROOM: Final = 64
    """Bytes; what nodes for OpenCV leave behind an array."""

    def __init__(self) -> None:
        page = mmap.PAGESIZE
        self._map = mmap.mmap(-1, self.SIZE + 2 * page)
        address = ctypes.addressof(ctypes.c_char.from_buffer(self._map))
        library = ctypes.CDLL(None, use_errno=True)
        for place in (address, address + page + self.SIZE):
            if library.mprotect(ctypes.c_void_p(place), ctypes.c_size_t(page), 0) != 0:
                raise OSError(ctypes.get_errno(), "mprotect")
        # like memory that another library has mapped, whose end is unknown
        self._memory = np.frombuffer(memoryview((ctypes.c_ubyte * self.SIZE).from_address(address + page)), np.uint8)

    def hold(self, array: Any, *, at_end: bool, room: bool) -> Any:
        """Return a copy of an array that touches a page at its end, or at its start, or nearly so."""
        apart = self.ROOM if room and array.nbytes + self.ROOM <= self.SIZE else 0
        start = self.SIZE - array.nbytes - apart if at_end else apart
        copy = self._memory[start : start + array.nbytes].view(array.dtype).reshape(array.shape)
        copy[...] = array
        return copy


class Hostile:
    """Draws the values of one call.

    Args:
      seed: the same seed gives the same values.
      guards: whether arrays are placed before pages that cannot be touched.

    Examples:
      >>> Hostile("7", guards=False).value(Literal["fast"])
      'fast'
    """

    _blocks: typing.ClassVar[list[_Guarded]] = []

    def __init__(self, seed: str, *, guards: bool = sys.platform == "linux") -> None:
        self._random = random.Random(seed)
        self._numbers = np.random.Generator(np.random.PCG64(self._random.getrandbits(64)))
        self._guards = guards and self.chance(60)
        self._held = 0
        self._rows = self._one(_SIDES)
        self._columns = self._rows if self.chance(25) else self._one(_SIDES)
        if self.number(300) == 0:
            self._rows, self._columns = self._one([(1, 40_000), (40_000, 1), (400, 500)])
        self._count = self._one(_LENGTHS)
        self._channels = self._one((1, 1, 1, 3, 3, 2, 4))
        self._kind = self._one(("u1", "u1", "f4", "f4", "f8", "i2", "u2", "i4", "i1", "f2"))
        self._fill = self._one(_FILLS)
        self._same_sizes = self.chance(80)
        self._layout = self._one(("plain", "plain", "plain", "mixed"))
        self._tame = self.chance(30)

    def chance(self, percent: int) -> bool:
        """Return True that often."""
        return self._random.randrange(100) < percent

    def number(self, below: int) -> int:
        """Return a number from 0 on."""
        return self._random.randrange(below)

    def _one(self, choices: Any) -> Any:
        return choices[self._random.randrange(len(choices))]

    # --- parameters ---

    def parameter(self, spec: ParameterSpec) -> Any:
        """Return a value that the parameter allows, at its limits if possible; its default if none is found."""
        for _ in range(8):
            value = self._parameter(spec)
            if spec.check(value) is None:
                return value
        return spec.default

    def _parameter(self, spec: ParameterSpec) -> Any:
        if spec.size:
            return self._one((1, 1, 2, 3, 5))
        if spec.kind == "choices":
            chosen = [one for one in spec.choices or () if self.chance(40)]
            kept = typing.get_origin(bare_type(spec.type)) or list
            return chosen if kept is list else frozenset(chosen) if kept is frozenset else kept(chosen)
        if spec.choices is not None:
            return self._one(list(spec.choices))
        if spec.kind == "path":
            text = self._one((*PATHS, "folder", "new", "a\udcff.png", "x" * 300, "a\0b"))
            return Path(text) if isinstance(spec.default, Path) or bare_type(spec.type) is not str else text
        return self._of(spec.type, spec.limits, 0)

    # --- values ---

    def value(self, hint: Any) -> Any:
        """Return a value of a type hint; one of any other type now and then."""
        if self.chance(2):
            return self._anything(0)
        return self._of(hint, (), 0)

    def _of(self, hint: Any, limits: tuple[Any, ...], depth: int) -> Any:
        facts = array_facts(hint)
        if facts is not None:
            return self._array(facts)
        hint, more = opened(hint)
        limits += more
        if hint is None or hint is type(None):
            return None
        origin, arguments = typing.get_origin(hint) or hint, typing.get_args(hint)
        if origin is Literal:
            return self._one(arguments)
        if origin in (typing.Union, types.UnionType):
            return self._of(self._one(arguments), limits, depth)
        if origin is abc.Callable:
            result = callable_parts(hint)[1]
            return lambda *values, **named: self._of(result, (), depth + 1)
        if isinstance(origin, type):
            return self._of_class(origin, arguments, limits, depth)
        return self._anything(depth)

    def _of_class(self, origin: type, arguments: tuple[Any, ...], limits: tuple[Any, ...], depth: int) -> Any:
        if issubclass(origin, enum.Enum):
            return self._one(list(origin))
        if origin is bool:
            return self.chance(50)
        if origin in (int, float, complex):
            return origin(self._number(origin, limits))
        if origin is str:
            return self._text(limits)
        if origin in (bytes, bytearray):
            return origin(self._random.randbytes(self._one((0, 1, 3, 64, 5000))))
        if issubclass(origin, np.generic):
            return np.array(self._one((0, 1, 100))).astype(origin)[()]
        if issubclass(origin, PurePath) or origin is os.PathLike:
            return Path(self._one((*PATHS, "a\udcff.png", "x" * 300)))
        if origin is Colour:
            return Colour(*(self._one((0, 255, 128)) for _ in range(3)))
        return self._composed(origin, arguments, limits, depth)

    def _composed(self, origin: type, arguments: tuple[Any, ...], limits: tuple[Any, ...], depth: int) -> Any:
        if origin is Span:
            part = arguments[0] if arguments else float
            return Span(*sorted((self._of(part, limits, depth + 1), self._of(part, limits, depth + 1))))
        if origin is tuple and arguments and not (len(arguments) == 2 and arguments[1] is ...):
            return tuple(self._of(one, limits, depth + 1) for one in arguments)
        if issubclass(origin, (dict, abc.Mapping)):
            key, part = arguments if len(arguments) == 2 else (str, Any)
            return {
                _hashable(self._of(key, (), depth + 1)): self._of(part, (), depth + 1) for _ in range(self._few(limits))
            }
        if issubclass(origin, (abc.Collection, abc.Iterable)) and origin is not np.ndarray:
            part = arguments[0] if arguments else Any
            items = [self._of(part, limits, depth + 1) for _ in range(self._few(limits))]
            if issubclass(origin, abc.Set):
                return frozenset(map(_hashable, items)) if origin is not set else set(map(_hashable, items))
            return (
                tuple(items) if origin is tuple else collections.deque(items) if origin is collections.deque else items
            )
        return self._record(origin, depth)

    def _record(self, kind: type, depth: int) -> Any:
        if kind.__module__.partition(".")[0] == "cv2":
            return self._of_opencv(kind)
        names, hints = names_of(kind, given=True), typing.get_type_hints(kind, include_extras=True)
        if names is None:
            return self._anything(depth)
        try:
            return kind(**{name: self._of(hints[name], (), depth + 1) for name in names})
        except (ValueError, TypeError):  # what the record itself refuses
            return None

    def _of_opencv(self, kind: type) -> Any:
        number = self._single
        if kind.__name__ == "KeyPoint":
            return kind(number(), number(), number(), number(), number(), self._of(int, _INT32, 0), 0)
        if kind.__name__ == "DMatch":
            return kind(self._of(int, _INT32, 0), self._of(int, _INT32, 0), number())
        return None

    def _single(self) -> float:
        return float(np.float32(self._number(float, ()) if self.chance(20) else self._random.uniform(-5, 70)))

    def _number(self, kind: type, limits: tuple[Any, ...]) -> Any:
        least, most = _bounds(limits)
        way = self._random.randrange(6)
        if way == 0 and least is not None:
            return least
        if way == 1 and most is not None:
            return most
        if way <= 3:
            low = least if least is not None else (most - 20 if most is not None else -10)
            if way == 3:  # what is ordinary: a few around 0
                low = max(low, min(-10, most if most is not None else 0))
            high = min(most, low + 40) if most is not None else low + 40
            return (
                self._random.randint(int(low), max(int(low), int(high)))
                if kind is int
                else self._random.uniform(low, high)
            )
        if kind is int:
            found = self._one(_INTEGERS if self.chance(95) else _FAR)
        else:
            found = self._one(_FLOATS)
        return found

    def _text(self, limits: tuple[Any, ...]) -> str:
        if self.chance(50):
            return str(self._one(_TEXTS))
        return "".join(self._one(_LETTERS) for _ in range(self._one((1, 2, 5, 12))))

    def _few(self, limits: tuple[Any, ...]) -> int:
        lengths = [one.min_length for one in limits if isinstance(one, annotated_types.MinLen)]
        lengths += [one.max_length for one in limits if isinstance(one, annotated_types.MaxLen)]
        if lengths and self.chance(70):
            return int(
                self._random.randint(min(lengths), min(max(lengths), 12)) if min(lengths) <= 12 else min(lengths)
            )
        return int(self._one((0, 1, 1, 2, 2, 3, 5, 9, 40)))

    def _anything(self, depth: int) -> Any:
        way = self._random.randrange(8)
        if way == 0 and depth < _DEEPEST:
            return [self._anything(depth + 1) for _ in range(self._one((0, 1, 3)))]
        if way == 1 and depth < _DEEPEST:
            return {self._text(()): self._anything(depth + 1)}
        if way == 2:
            return self._text(())
        if way == 3:
            return self._number(int, ())
        if way == 4:
            return self._number(float, ())
        shape = tuple(self._one((0, 1, 2, 3, 4, 17)) for _ in range(self._one((0, 1, 2, 2, 3, 3, 4, 5))))
        return self._numbers.integers(0, 100, shape).astype(self._one(_DTYPES))

    # --- arrays ---

    def _array(self, facts: ArrayFacts) -> Any:
        kinds = [np.dtype(one) for one in facts.dtypes if np.dtype(one).kind in "uifb"] or [np.dtype(np.uint8)]
        kind = next((one for one in kinds if one == np.dtype(self._kind)), None) if self._same_sizes else None
        shape = self._shape(facts.shapes)
        array = self._laid_out(self._filled(shape, kind if kind is not None else self._one(kinds)))
        if self.chance(10):
            array.flags.writeable = False
        return array

    def _shape(self, shapes: tuple[tuple[int | None, ...], ...]) -> tuple[int, ...]:
        shape = self._one(shapes or ((None,), (None, None), (None, None, None)))
        matching = [one for one in shapes if len(one) == (2 if self._channels == 1 else 3)]
        if self._same_sizes and matching:
            wanted = [one for one in matching if len(one) == 2 or one[2] in (None, self._channels)]
            shape = self._one(wanted or matching)
        open_ = iter(self._open_sides(shape))
        return tuple(side if side is not None else next(open_) for side in shape)

    def _open_sides(self, shape: tuple[int | None, ...]) -> list[int]:
        if self.chance(2):
            return [self._one((0, 1, 5)) for _ in shape]
        if self.chance(15):  # a kernel, which most functions want smaller than the picture
            return [self._one(_SMALL) for _ in shape]
        if not self._same_sizes or self.chance(3):
            return [self._one(_SIDES) if number < 2 else self._one((1, 2, 3, 4)) for number in range(len(shape))]
        if shape.count(None) == 1:
            return [self._count]
        return [self._rows, self._columns, *[self._channels] * len(shape)]

    def _filled(self, shape: tuple[int, ...], kind: np.dtype[Any]) -> Any:
        fill = self._fill if self.chance(80) else self._one(_FILLS)
        if fill == "plain" or self._tame:
            scale = 255 if kind.kind in "ui" else self._one((1.0, 1.0, 255.0, 60.0))
            limit = min(scale, np.iinfo(kind).max) if kind.kind in "ui" else scale
            return self._numbers.uniform(0, limit, shape).astype(kind)
        if fill == "constant":
            return np.full(shape, self._one((0, 1)), kind)
        if kind.kind == "b":
            return self._numbers.integers(0, 2, shape).astype(bool)
        if kind.kind in "ui":
            ends = np.iinfo(kind)
            marks = np.array([ends.min, ends.max, 0, 1, ends.max // 2], kind)
            return self._sprinkled(self._numbers.integers(0, 100, shape).astype(kind), marks)
        reals = np.finfo(kind)
        few = {
            "nan": [np.nan],
            "inf": [np.inf, -np.inf],
            "mixed": [np.nan, np.inf, -np.inf, 0.0, -0.0],
            "tiny": [reals.smallest_subnormal, reals.tiny, -reals.smallest_subnormal, 0.0],
            "large": [reals.max, reals.min, reals.max / 2],
            "far": [1e30 if kind.itemsize > 2 else 6e4, 2.0**31, -(2.0**31), 1e9, 32768.0],
        }[fill]
        with np.errstate(over="ignore"):
            return self._sprinkled(self._numbers.uniform(-2, 70, shape).astype(kind), np.array(few).astype(kind))

    def _sprinkled(self, array: Any, marks: Any) -> Any:
        share = self._one((0.01, 0.2, 1.0))
        where = self._numbers.random(array.shape) < share
        if array.size:
            where.reshape(-1)[self._random.randrange(array.size)] = True
        return np.where(where, marks[self._numbers.integers(0, len(marks), array.shape)], array).astype(array.dtype)

    def _laid_out(self, array: Any) -> Any:
        """Place an array in memory in some way; its numbers stay what they are."""
        if self._layout == "plain" or array.ndim == 0:
            return self._guarded(array)
        axis = self._random.randrange(array.ndim)
        way = self._random.randrange(5)
        if way == 0:  # negative strides
            return np.flip(self._guarded(np.flip(array, axis).copy()), axis)
        if way == 1:
            return np.asfortranarray(array)
        if way == 2:  # every second one of a larger array
            wide = np.zeros(
                [2 * side if number == axis else side for number, side in enumerate(array.shape)], array.dtype
            )
            part = wide[tuple(slice(None, None, 2) if number == axis else slice(None) for number in range(array.ndim))]
            part[...] = array
            return part
        if way == 3:  # a region of a larger array, which ends where that ends
            wide = np.zeros([side + 3 for side in array.shape], array.dtype)
            part = self._guarded(wide)[tuple(slice(3, None) for _ in array.shape)]
            part[...] = array
            return part
        off = np.zeros(array.nbytes + 1, np.uint8)[1:].view()  # at an odd address
        off = np.ndarray(array.shape, array.dtype, off.data) if array.size else array
        off[...] = array
        return off

    def _guarded(self, array: Any) -> Any:
        if not self._guards or not 0 < array.nbytes <= _Guarded.SIZE:
            return array
        if self._held == len(self._blocks):
            if self._held == 32:
                return array
            self._blocks.append(_Guarded())
        self._held += 1
        return self._blocks[self._held - 1].hold(array, at_end=self.chance(75), room=self.chance(60))


_FILLS: Final = ("plain", "plain", "constant", "nan", "inf", "mixed", "tiny", "large", "far")
_INT32: Final = (annotated_types.Ge(-(2**31)), annotated_types.Le(2**31 - 1))


def _bounds(limits: tuple[Any, ...]) -> tuple[Any, Any]:
    least: list[Any] = [one.ge for one in limits if isinstance(one, annotated_types.Ge)]
    least += [one.gt for one in limits if isinstance(one, annotated_types.Gt)]
    most: list[Any] = [one.le for one in limits if isinstance(one, annotated_types.Le)]
    most += [one.lt for one in limits if isinstance(one, annotated_types.Lt)]
    return max(least, default=None), min(most, default=None)


def _hashable(value: Any) -> Any:
    try:
        hash(value)
    except TypeError:
        return repr(value)[:50]
    return value
