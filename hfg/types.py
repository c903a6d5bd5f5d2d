"""Which port types fit together, and which values fit a type (rule P3).

Our own comparison instead of beartype's `is_subhint`, which raises on every `NDArray` and knows neither int -> float
nor arrays with a layout. Metadata of `Annotated` is taken off, apart from our own: `Shape` and `Pixels` say how an
array is laid out. What cannot be judged is said, never guessed. Stands on numpy and beartype; knows neither ports nor
nodes.
"""

from __future__ import annotations

import functools
import operator
import types
import typing
from collections.abc import Callable, Collection, Mapping
from itertools import islice
from typing import Annotated, Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt
from beartype.door import TypeHint, is_bearable
from beartype.roar import BeartypeException

__all__ = [
    "Array",
    "ColorImage",
    "GrayImage",
    "Image",
    "Pixels",
    "Shape",
    "accepts",
    "compatible",
    "describe",
    "is_hint",
    "why_not",
]


class Shape:
    """Metadata of an array type: one number for each axis, `None` for an axis of any length.

    Example:
      >>> from typing import Annotated
      >>> Points = Annotated[npt.NDArray[np.float64], Shape(None, 3)]
      >>> accepts(np.zeros((7, 3)), Points), accepts(np.zeros(3), Points)
      (True, False)
    """

    __slots__ = ("axes",)

    def __init__(self, *axes: int | None) -> None:
        self.axes = axes

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Shape) and type(other) is type(self) and other.axes == self.axes

    def __hash__(self) -> int:
        return hash((type(self), self.axes))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(map(str, self.axes))})"

    def shapes(self) -> tuple[tuple[int | None, ...], ...]:
        """Give every allowed shape, `None` for an axis of any length."""
        return (self.axes,)

    def accepts(self, shape: tuple[int, ...]) -> bool:
        """Say whether an array of this shape fits."""
        return any(_axes_meet(shape, allowed) for allowed in self.shapes())

    def meets(self, other: Shape) -> bool:
        """Say whether some array could fit both; open axes are checked on the value."""
        return any(_axes_meet(mine, theirs) for mine in self.shapes() for theirs in other.shapes())


class Pixels(Shape):
    """Metadata of an image: height x width, or height x width x channels; one channel needs no third axis."""

    __slots__ = ()

    def __init__(self, channels: int | None = None) -> None:
        super().__init__(channels)

    def shapes(self) -> tuple[tuple[int | None, ...], ...]:
        """Give every allowed shape; open channels mean 1 to 4, as in OpenCV."""
        (channels,) = self.axes
        counts = (1, 2, 3, 4) if channels is None else (channels,)
        flat: tuple[tuple[int | None, ...], ...] = ((None, None),) if 1 in counts else ()
        return flat + tuple((None, None, count) for count in counts)


def _axes_meet(mine: tuple[int | None, ...], theirs: tuple[int | None, ...]) -> bool:
    return len(mine) == len(theirs) and all(a is None or b is None or a == b for a, b in zip(mine, theirs, strict=True))


Array: TypeAlias = npt.NDArray[Any]
"""A numpy array of any shape and dtype."""

Image: TypeAlias = Annotated[npt.NDArray[Any], Pixels()]
"""An image as OpenCV makes it: height x width, with or without an axis of 1 to 4 channels, of any dtype."""

GrayImage: TypeAlias = Annotated[npt.NDArray[Any], Pixels(1)]
"""An image of one channel."""

ColorImage: TypeAlias = Annotated[npt.NDArray[Any], Pixels(3)]
"""An image of three channels."""

_NONE: Final = type(None)
_OPEN_DTYPES: Final = frozenset(
    {
        np.generic,
        np.number,
        np.integer,
        np.signedinteger,
        np.unsignedinteger,
        np.inexact,
        np.floating,
        np.complexfloating,
        np.flexible,
        np.character,
    }
)
"""Scalar classes that stand for several dtypes."""
_TOWER: Final[dict[type, tuple[type, ...]]] = {float: (int, bool), complex: (int, bool, float)}
"""What a number type takes besides itself (PEP 484)."""

_ITEMS: Final[dict[type, type]] = {str: str, bytes: int, bytearray: int, range: int}
"""What is in a plain sequence; beartype knows it of generic ones only."""

_LOOKED_AT: Final = 1000
"""How many items of a container are checked; the first ones, for the same value must always get the same answer."""


def compatible(source: Any, target: Any) -> bool:
    """Say whether every value a port of type `source` sends fits a port of type `target`."""
    return why_not(source, target) is None


def why_not(source: Any, target: Any) -> str | None:
    """Give the reason why `source` does not fit `target` in a few words, or None if it fits.

    Hints that cannot be judged are a reason too, which names them.
    """
    if source is target or target is Any or source is Any:
        return None
    try:
        return _why_not(source, target)
    except TypeError:  # a hint with an unhashable part, such as Annotated[int, []]: judged each time
        return _judge(source, target)


@functools.lru_cache(maxsize=4096)
def _why_not(source: Any, target: Any) -> str | None:
    return _judge(source, target)


def _judge(source: Any, target: Any) -> str | None:
    source, source_layouts = _open(source)
    target, target_layouts = _open(target)
    if source is Any or target is Any or target is object:
        return None
    if _is_union(source):  # needs all its members; None in an output is silence
        members = [member for member in typing.get_args(source) if member is not _NONE]
        return next((reason for member in members if (reason := _judge(member, target))), None)
    if _is_union(target):
        members = list(typing.get_args(target))
        if any(_judge(source, member) is None for member in members):
            return None
        return f"{describe(source)} is none of {describe(target)}"
    arrays = _judge_arrays(source, source_layouts, target, target_layouts)
    if arrays is not _NOT_ARRAYS:
        return arrays
    return _judge_plain(source, target)


def _judge_plain(source: Any, target: Any) -> str | None:
    origin, arguments = typing.get_origin(target), typing.get_args(target)
    if source in _ITEMS and len(arguments) == 1 and isinstance(origin, type) and issubclass(source, origin):
        return _judge(_ITEMS[source], arguments[0])
    if (isinstance(target, type) and source in _TOWER.get(target, ())) or source == target:
        return None
    try:
        fits = TypeHint(source).is_subhint(TypeHint(target))
    except (BeartypeException, TypeError, ValueError) as error:
        if _same_generic(source, target):  # beartype raises on every NDArray, also inside list[...]
            pairs = zip(typing.get_args(source), typing.get_args(target), strict=True)
            return next((reason for mine, theirs in pairs if (reason := _judge(mine, theirs))), None)
        culprit = next((hint for hint in (source, target) if not _is_hint(hint)), source)
        return f"hfg cannot judge the type {describe(culprit)} ({type(error).__name__}); use a plainer type, or Any"
    return None if fits else f"{describe(source)} is no {describe(target)}"


def _same_generic(source: Any, target: Any) -> bool:
    origin = typing.get_origin(source)
    return (
        isinstance(origin, type)
        and origin is typing.get_origin(target)
        and len(typing.get_args(source)) == len(typing.get_args(target))
    )


def _is_hint(hint: Any) -> bool:
    try:
        TypeHint(hint)
    except (BeartypeException, TypeError, ValueError):
        return False
    return True


_NOT_ARRAYS: Final = "not arrays"


def _judge_arrays(
    source: Any, source_layouts: tuple[Shape, ...], target: Any, target_layouts: tuple[Shape, ...]
) -> str | None:
    """Compare two arrays by dtype and layout; `_NOT_ARRAYS` if the target is none, or both are plain."""
    target_dtype = _dtype_of(target)
    if target_dtype is None:
        return _NOT_ARRAYS if _dtype_of(source) is None or target is np.ndarray else _subclass(np.ndarray, target)
    source_dtype = _dtype_of(source)
    if source_dtype is None:
        return f"{describe(source)} is no array"
    if not _dtypes_meet(source_dtype, target_dtype):
        return f"an array of {describe(source_dtype)} is no array of {describe(target_dtype)}"
    for mine in source_layouts:
        for theirs in target_layouts:
            if not mine.meets(theirs):
                return f"the layout {mine!r} never fits {theirs!r}"
    return None


def _subclass(source: type, target: Any) -> str | None:
    if isinstance(target, type) and issubclass(source, target):
        return None
    return f"an array is no {describe(target)}"


def _dtypes_meet(source: Any, target: Any) -> bool:
    """Compare scalar classes.

    An open dtype (Any, np.generic, np.floating ...) fits what it may hold and is checked on the value.
    """
    source, target = (np.generic if dtype is Any else dtype for dtype in (source, target))
    if _is_union(source) or _is_union(target):
        sources = typing.get_args(source) if _is_union(source) else (source,)
        targets = typing.get_args(target) if _is_union(target) else (target,)
        return all(any(_dtypes_meet(one, other) for other in targets) for one in sources)
    return issubclass(source, target) or (issubclass(target, source) and source in _OPEN_DTYPES)


def _dtype_of(hint: Any) -> Any:
    """Give the scalar class of an array type (Any if it is open), or None if the hint is no array."""
    if hint is np.ndarray:
        return Any
    if typing.get_origin(hint) is not np.ndarray:
        return None
    arguments = typing.get_args(hint)
    dtype = arguments[1] if len(arguments) > 1 else Any
    scalars = typing.get_args(dtype)
    return _scalar(scalars[0]) if scalars else Any


def _scalar(hint: Any) -> Any:
    """Give the scalar class, or a union of them; `np.floating[Any]` is `np.floating`."""
    hint, _ = _open(hint)
    if _is_union(hint):
        return functools.reduce(operator.or_, map(_scalar, typing.get_args(hint)))
    hint = typing.get_origin(hint) or hint
    return hint if isinstance(hint, type) else Any


def _open(hint: Any) -> tuple[Any, tuple[Shape, ...]]:
    """Take aliases, NewTypes' wrappers of metadata, type variables and metadata off; keep the layouts."""
    layouts: tuple[Shape, ...] = ()
    while True:
        if hint is None:
            return _NONE, layouts
        if typing.get_origin(hint) in _QUALIFIERS:
            metadata = getattr(hint, "__metadata__", ())
            layouts += tuple(item for item in metadata if isinstance(item, Shape))
            hint = typing.get_args(hint)[0]
        elif type(hint).__name__ == "TypeAliasType":  # PEP 695, and typing_extensions' for older Pythons
            hint = hint.__value__
        elif type(typing.get_origin(hint)).__name__ == "TypeAliasType":
            hint = typing.get_origin(hint).__value__[typing.get_args(hint)]
        elif isinstance(hint, typing.TypeVar):
            constraints = hint.__constraints__
            hint = typing.Union[constraints] if constraints else hint.__bound__ or Any  # noqa: UP007 - known at run time
        else:
            return hint, layouts


_QUALIFIERS: Final = (Annotated, typing.ClassVar, typing.Final, typing.Required, typing.NotRequired)


def _is_union(hint: Any) -> bool:
    return typing.get_origin(hint) in (typing.Union, types.UnionType)


def accepts(value: Any, hint: Any) -> bool:
    """Say whether a value is of a type; arrays with their dtype and layout, ints as floats."""
    try:
        return _checker(hint)(value)
    except TypeError:  # an unhashable hint
        return _make_checker(hint)(value)


@functools.lru_cache(maxsize=4096)
def _checker(hint: Any) -> Callable[[Any], bool]:
    return _make_checker(hint)


def _make_checker(hint: Any) -> Callable[[Any], bool]:
    hint, layouts = _open(hint)
    if hint is Any or hint is object:
        return lambda value: True
    if _is_union(hint):
        checkers = [_checker(member) for member in typing.get_args(hint)]
        return lambda value: any(check(value) for check in checkers)
    dtype = _dtype_of(hint)
    if dtype is not None:
        dtypes = typing.get_args(dtype) if _is_union(dtype) else (np.generic if dtype is Any else dtype,)
        return lambda value: (
            isinstance(value, np.ndarray)
            and issubclass(value.dtype.type, dtypes)
            and all(layout.accepts(value.shape) for layout in layouts)
        )
    if hint in _TOWER:
        allowed = (hint, *_TOWER[hint])
        return lambda value: isinstance(value, allowed)
    items = _items_checker(typing.get_origin(hint), typing.get_args(hint))
    return items or (lambda value: _bearable(value, hint))


def _items_checker(origin: Any, arguments: tuple[Any, ...]) -> Callable[[Any], bool] | None:
    """Make the check of a container, which beartype does on one item chosen at random: no two runs would agree."""
    if not (isinstance(origin, type) and issubclass(origin, Collection)) or not arguments:
        return None
    if issubclass(origin, Mapping) and len(arguments) == 2:
        key, item = map(_checker, arguments)
        return lambda value: (
            isinstance(value, origin) and all(key(k) and item(v) for k, v in islice(value.items(), _LOOKED_AT))
        )
    if origin is tuple and not (len(arguments) == 2 and arguments[1] is Ellipsis):
        checkers = [_checker(argument) for argument in arguments if argument != ()]
        return lambda value: (
            isinstance(value, tuple)
            and len(value) == len(checkers)
            and all(check(item) for check, item in zip(checkers, value, strict=True))
        )
    if origin is tuple or len(arguments) == 1:
        item = _checker(arguments[0])
        return lambda value: isinstance(value, origin) and all(map(item, islice(value, _LOOKED_AT)))
    return None


def _bearable(value: Any, hint: Any) -> bool:
    try:
        return is_bearable(value, hint)
    except BeartypeException:
        return True  # what cannot be judged was refused where it was connected; here it is let through


@functools.lru_cache(maxsize=4096)
def _describe(hint: Any) -> str:
    return _words(hint)


def is_hint(value: Any) -> bool:
    """Say whether this can be a type hint at all; a value, a name in quotes, a function or a module cannot."""
    return not isinstance(value, str | bytes | int | float | complex | list | tuple | dict | set) and not isinstance(
        value, types.FunctionType | types.BuiltinFunctionType | types.ModuleType
    )


def describe(hint: Any) -> str:
    """Give a type in few words, as a user would write it."""
    try:
        return _describe(hint)
    except TypeError:
        return _words(hint)


def _words(hint: Any) -> str:
    for word, alias in (("Image", Image), ("GrayImage", GrayImage), ("ColorImage", ColorImage)):
        if hint == alias:
            return word
    if hint is None or hint is _NONE:
        return "None"
    if _is_union(hint):
        return " | ".join(describe(member) for member in typing.get_args(hint))
    dtype = _dtype_of(_open(hint)[0])  # NDArray is an alias from Python 3.12 on
    if dtype is not None:
        return "Array" if dtype is Any else f"Array[{describe(dtype)}]"
    if typing.get_origin(hint) is Annotated:
        return describe(typing.get_args(hint)[0])
    if typing.get_origin(hint) is None and isinstance(hint, type):
        return hint.__name__
    return str(hint).replace("typing.", "").replace("collections.abc.", "")
