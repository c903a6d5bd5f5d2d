"""Which port types match, and which values a type accepts (rule P3).

We compare types ourselves instead of using beartype's `is_subhint`, which raises on every `NDArray`, does not accept
int as float or arrays with a layout, and does not treat bare generics as open. Metadata of `Annotated` is removed,
except our own: `Shape` and `Pixels` describe the layout of an array, `Named` the name of a type. Types that cannot be
compared are reported, never guessed. Depends on `generics`, numpy and beartype, not on ports or nodes. `hfg.images` has
the types of images.
"""

from __future__ import annotations

import enum
import functools
import operator
import types
import typing
from collections import abc
from collections.abc import Callable, Collection, Iterable, Mapping
from itertools import islice
from typing import Annotated, Any, Final, Literal, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from typing_extensions import is_protocol

from hfg.base import generics
from hfg.errors import shown

__all__ = [
    "Array",
    "ArrayFacts",
    "Named",
    "Pixels",
    "Shape",
    "Widget",
    "accepts",
    "array_facts",
    "bare_type",
    "compatible",
    "describe",
    "describe_value",
    "is_hint",
    "why_not",
]


class Shape:
    """Metadata of an array type: one number per axis, `None` for an axis of any length.

    Examples:
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
        """Return every allowed shape, `None` for an axis of any length."""
        return (self.axes,)

    def accepts(self, shape: tuple[int, ...]) -> bool:
        """Return whether an array of this shape matches."""
        return any(_axes_meet(shape, allowed) for allowed in self.shapes())

    def meets(self, other: Shape) -> bool:
        """Return whether some array could match both; open axes are checked on the value."""
        return any(_axes_meet(mine, theirs) for mine in self.shapes() for theirs in other.shapes())


class Pixels(Shape):
    """Metadata of an image: height x width, or height x width x channels; one channel needs no third axis.

    Without numbers there may be 1 to 4 channels, as in OpenCV; `Pixels(1, 3)` are one or three.
    """

    __slots__ = ()

    def __init__(self, *channels: int) -> None:
        super().__init__(*channels)

    def shapes(self) -> tuple[tuple[int | None, ...], ...]:
        """Return every allowed shape, `None` for an axis of any length."""
        counts = self.axes or (1, 2, 3, 4)
        flat: tuple[tuple[int | None, ...], ...] = ((None, None),) if 1 in counts else ()
        return flat + tuple((None, None, count) for count in counts)


class Named:
    """Metadata that names a type in messages and lists; it does not affect matching.

    Examples:
      >>> from typing import Annotated
      >>> describe(Annotated[npt.NDArray[np.float32], Pixels(1), Named("Depth")])
      'Depth'
    """

    __slots__ = ("name",)

    def __init__(self, name: str) -> None:
        self.name = name

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Named) and other.name == self.name

    def __hash__(self) -> int:
        return hash((Named, self.name))

    def __repr__(self) -> str:
        return f"Named({self.name!r})"


class Widget:
    """Metadata of a port's type: how editors should show its values; it does not affect matching.

    Editors find it in the catalogue. Those that do not know the kind ignore it.

    Examples:
      >>> from typing import Annotated
      >>> Widget.of(Annotated[float, Widget("gauge")])
      'gauge'
    """

    __slots__ = ("kind",)

    def __init__(self, kind: str) -> None:
        self.kind = kind

    @staticmethod
    def of(hint: Any) -> str:
        """Return the kind of widget of a type; "" if it has none."""
        return next((one.kind for one in getattr(hint, "__metadata__", ()) if isinstance(one, Widget)), "")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Widget) and other.kind == self.kind

    def __hash__(self) -> int:
        return hash((Widget, self.kind))

    def __repr__(self) -> str:
        return f"Widget({self.kind!r})"


def _axes_meet(mine: tuple[int | None, ...], theirs: tuple[int | None, ...]) -> bool:
    return len(mine) == len(theirs) and all(a is None or b is None or a == b for a, b in zip(mine, theirs, strict=True))


Array: TypeAlias = npt.NDArray[Any]
"""A numpy array of any shape and dtype."""

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
"""Scalar classes that represent several dtypes."""
_TOWER: Final[dict[type, tuple[type, ...]]] = {float: (int, bool), complex: (int, bool, float)}
"""Other number types that a number type accepts (PEP 484)."""

_CALLABLE: Final[Any] = abc.Callable

_NUMBERS: Final = (
    np.bool_,
    np.uint8,
    np.int8,
    np.uint16,
    np.int16,
    np.uint32,
    np.int32,
    np.uint64,
    np.int64,
    np.float16,
    np.float32,
    np.float64,
)
"""Number types to use for an array of an open dtype when values are made."""

_LOOKED_AT: Final = 1000
"""How many items of a container are checked: the first ones, so that the same value always gets the same result."""


def compatible(source: Any, target: Any) -> bool:
    """Return whether every value that a port of type `source` sends matches a port of type `target`."""
    return why_not(source, target) is None


def why_not(source: Any, target: Any) -> str | None:
    """Return the reason why `source` does not match `target` in a few words, or None if it matches.

    Hints that cannot be compared are a reason, too, which names them.
    """
    if source is target or target is Any or source is Any:
        return None
    try:
        return _why_not(source, target)
    except TypeError:  # a hint with an unhashable part, such as Annotated[int, []]: compared each time
        return _judge(source, target)
    except RecursionError:
        return (
            f"hfg cannot compare {describe(source)} with {describe(target)} because one of them contains itself; "
            "use Any"
        )


@functools.lru_cache(maxsize=4096)
def _why_not(source: Any, target: Any) -> str | None:
    return _judge(source, target)


def _judge(source: Any, target: Any) -> str | None:
    opened, _ = _open(source)
    if _is_union(opened):  # None in an output is silence (rule T2), so it never arrives
        members = [member for member in typing.get_args(opened) if member is not _NONE]
        return next((reason for member in members if (reason := _judge(member, target))), None)
    return _fits(source, target)


def _fits(source: Any, target: Any) -> str | None:
    """Do the same for types inside other types, where None is a value: a list may hold some."""
    source, source_layouts = _open(source)
    target, target_layouts = _open(target)
    if source is Any or target is Any or target is object or source in (typing.Never, typing.NoReturn):
        return None
    if _is_union(source):
        return _first(_fits(member, target) for member in typing.get_args(source))
    if _is_union(target):
        if any(_fits(source, member) is None for member in typing.get_args(target)):
            return None
        return f"{describe(source)} is not one of {describe(target)}"
    arrays = _judge_arrays(source, source_layouts, target, target_layouts)
    return _judge_plain(source, target) if arrays is _NOT_ARRAYS else arrays


def _first(reasons: Iterable[str | None]) -> str | None:
    return next((reason for reason in reasons if reason is not None), None)


def _judge_plain(source: Any, target: Any) -> str | None:
    if source == target or (isinstance(target, type) and source in _TOWER.get(target, ())):
        return None
    if typing.get_origin(source) is Literal or typing.get_origin(target) is Literal:
        return _judge_literals(source, target)
    if isinstance(source, typing.NewType):
        return _fits(source.__supertype__, target)
    wanted, found = generics.class_of(target), generics.class_of(source)
    if wanted is _CALLABLE:
        return _judge_callables(source, target)
    if wanted is None or found is None or _is_unpacked(source) or _is_unpacked(target):
        return _ask_beartype(source, target)
    if typing.is_typeddict(wanted):
        return _judge_keys(source, target)
    return _judge_classes(source, found, target, wanted)


def _judge_literals(source: Any, target: Any) -> str | None:
    values = typing.get_args(source) if typing.get_origin(source) is Literal else _all_values(source)
    if values is None:
        return f"{describe(source)} is not {describe(target)}"
    if typing.get_origin(target) is not Literal:
        return _first(_fits(type(value), target) for value in values)
    allowed = {(type(value), value) for value in typing.get_args(target)}
    wrong = [value for value in values if (type(value), value) not in allowed]
    return f"{wrong[0]!r} is not {describe(target)}" if wrong else None


def _all_values(hint: Any) -> tuple[Any, ...] | None:
    """Return all values of a type that has few; None for other types."""
    if hint is bool:
        return (False, True)
    if hint is _NONE:
        return (None,)
    return tuple(hint) if isinstance(hint, type) and issubclass(hint, enum.Enum) else None


def _judge_keys(source: Any, target: Any) -> str | None:
    """Compare a dict that has known keys with another; the keys of a plain dict are unknown."""
    refused = f"{describe(source)} is not {describe(target)}"
    if not typing.is_typeddict(source):
        return refused
    has, wanted = typing.get_type_hints(source), typing.get_type_hints(target)
    missing = next((key for key in wanted if key not in has), None)
    if missing is not None:
        return f'{refused}: it has no key "{missing}"'
    wrong = _first(_fits(has[key], hint) for key, hint in wanted.items())
    return None if wrong is None else f"{refused}: {wrong}"


def _judge_callables(source: Any, target: Any) -> str | None:
    found = generics.class_of(source)
    if found not in (_CALLABLE, type) and not (found and any("__call__" in vars(one) for one in found.__mro__)):
        return f"{describe(source)} cannot be called"
    (given, result), (wanted, expected) = generics.callable_parts(source), generics.callable_parts(target)
    if given is not None and wanted is not None:
        if len(given) != len(wanted):
            return f"{describe(source)} takes {len(given)} arguments, not {len(wanted)}"
        wrong = _first(_fits(theirs, mine) for mine, theirs in zip(given, wanted, strict=True))
        if wrong is not None:
            return f"{describe(source)} does not accept the arguments of {describe(target)}: {wrong}"
    return _fits(result, expected)


def _judge_classes(source: Any, found: type, target: Any, wanted: type) -> str | None:
    """Compare two classes, generic or not.

    Their parts may be of a narrower type because a value that was sent is never changed (rule T1).
    """
    refused = f"{describe(source)} is not {describe(target)}"
    if not _is_or_has(found, wanted):
        missing = generics.lacks(found, wanted)
        return refused if missing is None else f'{refused}: it has no "{missing}"'
    inner = _judge_tuples(source, target) if wanted is tuple else _judge_parts(source, target, wanted)
    return None if inner is None else f"{refused}: {inner}"


def _is_or_has(found: type, wanted: type) -> bool:
    """Return whether a class is derived from another one, or has the members of a protocol."""
    return generics.lacks(found, wanted) is None if is_protocol(wanted) else issubclass(found, wanted)


def _judge_parts(source: Any, target: Any, wanted: type) -> str | None:
    expected = typing.get_args(target)
    parts = generics.parts_as(source, wanted) if expected else generics.UNKNOWN
    if parts is generics.UNKNOWN or len(parts) != len(expected):
        return None
    names = getattr(wanted, "__parameters__", ()) or (None,) * len(expected)
    return _first(
        _fits(theirs, mine) if getattr(name, "__contravariant__", False) else _fits(mine, theirs)
        for name, mine, theirs in zip(names, parts, expected, strict=False)
    )


def _judge_tuples(source: Any, target: Any) -> str | None:
    items, expected = generics.tuple_items(source), generics.tuple_items(target)
    if items is generics.UNKNOWN or expected is generics.UNKNOWN:
        return None
    if expected[1:] == (...,):
        return _first(_fits(item, expected[0]) for item in items if item is not ...)
    if items[1:] == (...,):
        return "its length is open"
    if len(items) != len(expected):
        return f"it has {len(items)} items, not {len(expected)}"
    return _first(_fits(mine, theirs) for mine, theirs in zip(items, expected, strict=True))


def _is_unpacked(hint: Any) -> bool:
    return any(
        typing.get_origin(part) is typing.Unpack or getattr(part, "__unpacked__", False)
        for part in typing.get_args(hint)
    )


def _ask_beartype(source: Any, target: Any) -> str | None:
    """Ask beartype about types that we know nothing about."""
    # imported here because it takes a fifth of hfg's import time, and few programs need it
    from beartype.door import TypeHint
    from beartype.roar import BeartypeException

    try:
        fits = TypeHint(source).is_subhint(TypeHint(target))
    except (BeartypeException, TypeError, ValueError) as error:
        culprit = next((hint for hint in (source, target) if not _is_hint(hint)), source)
        return f"hfg cannot compare the type {describe(culprit)} ({type(error).__name__}); use a simpler type, or Any"
    return None if fits else f"{describe(source)} is not {describe(target)}"


def _is_hint(hint: Any) -> bool:
    from beartype.door import TypeHint
    from beartype.roar import BeartypeException

    try:
        TypeHint(hint)
    except (BeartypeException, TypeError, ValueError):
        return False
    return True


_NOT_ARRAYS: Final = "not arrays"


def _judge_arrays(
    source: Any, source_layouts: tuple[Shape, ...], target: Any, target_layouts: tuple[Shape, ...]
) -> str | None:
    """Compare two arrays by dtype and layout. Return `_NOT_ARRAYS` if the target is not an array, or both are plain."""
    target_dtype = _dtype_of(target)
    if target_dtype is None:
        return _NOT_ARRAYS if _dtype_of(source) is None or target is np.ndarray else _judge_as_container(target)
    source_dtype = _dtype_of(source)
    if source_dtype is None:
        return f"{describe(source)} is not an array"
    if not _dtypes_meet(source_dtype, target_dtype):
        return f"an array of {describe(source_dtype)} is not an array of {describe(target_dtype)}"
    for mine in source_layouts:
        for theirs in target_layouts:
            if not mine.meets(theirs):
                return f"the layout {mine!r} never matches {theirs!r}"
    return None


def _judge_as_container(target: Any) -> str | None:
    """Compare an array with a type that is not an array: an Iterable, a Protocol.

    Its items are checked on the value.
    """
    wanted = generics.class_of(target)
    if wanted is not None and _is_or_has(np.ndarray, wanted):
        return None
    return f"an array is not {describe(target)}"


def _dtypes_meet(source: Any, target: Any) -> bool:
    """Compare scalar classes.

    An open dtype (Any, np.generic, np.floating ...) matches every dtype that it may hold, and is checked on the value.
    """
    source, target = (np.generic if dtype is Any else dtype for dtype in (source, target))
    if _is_union(source) or _is_union(target):
        sources = typing.get_args(source) if _is_union(source) else (source,)
        targets = typing.get_args(target) if _is_union(target) else (target,)
        return all(any(_dtypes_meet(one, other) for other in targets) for one in sources)
    return issubclass(source, target) or (issubclass(target, source) and source in _OPEN_DTYPES)


def _dtype_of(hint: Any) -> Any:
    """Return the scalar class of an array type (Any if it is open), or None if the hint is not an array."""
    if hint is np.ndarray:
        return Any
    if typing.get_origin(hint) is not np.ndarray:
        return None
    arguments = typing.get_args(hint)
    dtype = arguments[1] if len(arguments) > 1 else Any
    scalars = typing.get_args(dtype)
    return _scalar(scalars[0]) if scalars else Any


def _scalar(hint: Any) -> Any:
    """Return the scalar class, or a union of them; `np.floating[Any]` is `np.floating`."""
    hint, _ = _open(hint)
    if _is_union(hint):
        return functools.reduce(operator.or_, map(_scalar, typing.get_args(hint)))
    hint = typing.get_origin(hint) or hint
    return hint if isinstance(hint, type) else Any


def _open(hint: Any) -> tuple[Any, tuple[Shape, ...]]:
    """Remove aliases, NewTypes around metadata, type variables and metadata; keep the layouts."""
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


def bare_type(hint: Any) -> Any:
    """Return a type hint without aliases, type variables and the metadata of `Annotated`."""
    return _open(hint)[0]


_QUALIFIERS: Final = (Annotated, typing.ClassVar, typing.Final, typing.Required, typing.NotRequired)


def _is_union(hint: Any) -> bool:
    return typing.get_origin(hint) in (typing.Union, types.UnionType)


def accepts(value: Any, hint: Any) -> bool:
    """Return whether a value is of a type.

    Arrays are checked with their dtype and layout; an int is accepted as a float. A value that raises while it is
    inspected is of no type, whatever it claims.
    """
    try:
        fits = _checker(hint)
    except TypeError:  # an unhashable hint
        fits = _make_checker(hint)
    try:
        return fits(value)
    except Exception:
        return False


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
        return _array_checker(dtype, layouts)
    if hint in _TOWER:
        allowed = (hint, *_TOWER[hint])
        return lambda value: isinstance(value, allowed)
    if _is_plain_class(hint):
        return lambda value: isinstance(value, hint)
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is typing.Literal:
        kinds = tuple(set(map(type, arguments)))
        return lambda value: isinstance(value, kinds) and value in arguments
    return _items_checker(origin, arguments) or _bearable(hint)


def _array_checker(dtype: Any, layouts: tuple[Shape, ...]) -> Callable[[Any], bool]:
    dtypes = typing.get_args(dtype) if _is_union(dtype) else (np.generic if dtype is Any else dtype,)

    @functools.lru_cache(maxsize=64)  # cameras send arrays of the same few shapes, again and again
    def fits(shape: tuple[int, ...]) -> bool:
        return all(layout.accepts(shape) for layout in layouts)

    return lambda value: isinstance(value, np.ndarray) and issubclass(value.dtype.type, dtypes) and fits(value.shape)


def _is_plain_class(hint: Any) -> bool:
    """Return whether `isinstance` decides membership; it does not for a protocol or a `TypedDict`."""
    is_class = isinstance(hint, type) and typing.get_origin(hint) is None
    return is_class and not typing.is_typeddict(hint) and not getattr(hint, "_is_protocol", False)


def _items_checker(origin: Any, arguments: tuple[Any, ...]) -> Callable[[Any], bool] | None:
    """Make the check of a container. Beartype checks one item chosen at random, so no two runs would agree."""
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


def _bearable(hint: Any) -> Callable[[Any], bool]:
    from beartype.door import is_bearable
    from beartype.roar import BeartypeException

    def check(value: Any) -> bool:
        try:
            return is_bearable(value, hint)
        except BeartypeException:
            return True  # types that cannot be compared were refused where they were connected; here they pass

    return check


class ArrayFacts(NamedTuple):
    """Facts about the arrays of a type, for code that makes or describes them.

    Attributes:
      dtypes: scalar classes that an array may hold; for an open dtype the usual numbers.
      shapes: the allowed shapes, with `None` for an axis of any length; empty if any shape is allowed.
    """

    dtypes: tuple[type[np.generic], ...]
    shapes: tuple[tuple[int | None, ...], ...]


def array_facts(hint: Any) -> ArrayFacts | None:
    """Return dtypes and shapes of an array type; None if the hint is not an array.

    Examples:
      >>> array_facts(Annotated[npt.NDArray[np.uint8 | np.float32], Pixels(1)])
      ArrayFacts(dtypes=(<class 'numpy.uint8'>, <class 'numpy.float32'>), shapes=((None, None), (None, None, 1)))
    """
    hint, layouts = _open(hint)
    dtype = _dtype_of(hint)
    if dtype is None:
        return None
    allowed = typing.get_args(dtype) if _is_union(dtype) else (np.generic if dtype is Any else dtype,)
    concrete = [one for one in allowed if one not in _OPEN_DTYPES]
    opened = tuple(one for one in allowed if one in _OPEN_DTYPES)
    dtypes = (*concrete, *(one for one in _NUMBERS if opened and issubclass(one, opened) and one not in concrete))
    shapes = layouts[0].shapes() if layouts else ()
    return ArrayFacts(dtypes, tuple(one for one in shapes if all(Shape(*one).meets(other) for other in layouts[1:])))


def describe_value(value: Any) -> str:
    """Return what a value is, in a few words: "int: 3", "an array of float64, 480 x 640"."""
    if issubclass(type(value), np.ndarray):  # a value may pretend to be of another class, or raise
        return f"an array of {value.dtype}, {' x '.join(map(str, value.shape)) or 'without axes'}"
    return f"{describe(type(value))}: {shown(value)}"


@functools.lru_cache(maxsize=4096)
def _describe(hint: Any) -> str:
    return _words(hint)


def is_hint(value: Any) -> bool:
    """Return whether a value can be a type hint at all; a plain value, a quoted name, a function or a module cannot."""
    return not isinstance(value, str | bytes | int | float | complex | list | tuple | dict | set) and not isinstance(
        value, types.FunctionType | types.BuiltinFunctionType | types.ModuleType
    )


def describe(hint: Any) -> str:
    """Return a type in a few words, as a user would write it."""
    try:
        return _describe(hint)
    except TypeError:
        return _words(hint)


def _words(hint: Any) -> str:
    name = next((item.name for item in getattr(hint, "__metadata__", ()) if isinstance(item, Named)), None)
    if name is not None:
        return name
    if hint is None or hint is _NONE:
        return "None"
    if _is_union(hint):
        return " | ".join(describe(member) for member in typing.get_args(hint))
    dtype = _dtype_of(_open(hint)[0])  # NDArray is an alias from Python 3.12 on
    if dtype is not None:
        return "Array" if dtype is Any else f"Array[{describe(dtype)}]"
    if typing.get_origin(hint) is Annotated:
        return describe(typing.get_args(hint)[0])
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is None and isinstance(hint, type):
        return hint.__name__
    if isinstance(origin, type) and origin is not _CALLABLE and arguments:
        return f"{origin.__name__}[{', '.join('...' if one is ... else describe(one) for one in arguments)}]"
    return str(hint).replace("typing.", "").replace("collections.abc.", "")
