"""The parts of a type, including its parts when it is seen as another type: a `str` as a Sequence of `str`.

This module only reads type hints; `types` judges them. Depends only on typing.
"""

from __future__ import annotations

import typing
from collections import Counter, abc
from types import FunctionType
from typing import Any, Final

from typing_extensions import get_protocol_members, is_protocol

UNKNOWN: Final = None
"""The parts of a bare generic type: `list` may hold anything, so its values are checked instead."""

_PARTS: Final[dict[type, tuple[Any, ...]]] = {
    str: (str,),
    bytes: (int,),
    bytearray: (int,),
    memoryview: (int,),
    range: (int,),
}
"""Item types of containers that are not generic."""

_FIRST: Final = (abc.Generator, abc.AsyncGenerator, abc.KeysView, abc.ValuesView)
"""Generic types whose iteration yields the first part."""


def class_of(hint: Any) -> type | None:
    """Return the class of a plain or generic type; None for hints that are not classes, such as a Literal."""
    origin = typing.get_origin(hint) or hint
    return origin if isinstance(origin, type) else None


def parts_as(source: Any, wanted: type) -> tuple[Any, ...] | None:
    """Return the parts of `source` when it is seen as `wanted`, a base or abstract type of it.

    For `dict[str, int]` as an Iterable, that is only `str`. Returns `UNKNOWN` if the parts are not declared.
    """
    cls = class_of(source)
    if cls is None:
        return UNKNOWN
    parts: tuple[Any, ...] | None = typing.get_args(source) or None
    if cls is wanted:
        return parts
    if cls in _PARTS:
        return _PARTS[cls]
    if issubclass(cls, tuple):
        items = tuple_items(source)
        return UNKNOWN if items is UNKNOWN else (_union(items),)
    if typing.is_typeddict(cls):
        parts = (str, _union(_fields(cls)))
    elif cls.__module__ not in ("builtins", "collections", "collections.abc"):
        return _parts_of_bases(cls, parts, wanted)
    return UNKNOWN if parts is None else _builtin_parts(cls, parts, wanted)


def _builtin_parts(cls: type, parts: tuple[Any, ...], wanted: type) -> tuple[Any, ...] | None:
    """Do the same for Python's own containers."""
    if cls is Counter:
        parts = (parts[0], int)
    if issubclass(cls, abc.Coroutine):
        return parts[-1:]
    if issubclass(cls, abc.Mapping) and not issubclass(wanted, abc.Mapping):
        return parts[:1]
    if issubclass(cls, abc.ItemsView) and len(parts) == 2 and wanted is not abc.ItemsView:
        return (tuple[parts],)  # type: ignore[valid-type]  # made at run time
    return (
        parts[:1] if issubclass(cls, _FIRST) and not issubclass(wanted, (abc.Generator, abc.AsyncGenerator)) else parts
    )


def _parts_of_bases(cls: type, parts: tuple[Any, ...] | None, wanted: type) -> tuple[Any, ...] | None:
    """Do the same for a user's class, which declares the parts in its bases: `class Poses(list[Pose])`."""
    names = getattr(cls, "__parameters__", ())
    for base in cls.__dict__.get("__orig_bases__", cls.__bases__):
        base_class = class_of(base)
        if (
            base_class is None
            or base_class in (object, typing.Generic, typing.Protocol)
            or not _derives(base_class, wanted)
        ):
            continue
        unknown = getattr(base, "__parameters__", ())
        if parts is not None and unknown and typing.get_origin(base) is not None:
            given = dict(zip(names, parts, strict=False))
            base = base[tuple(given.get(name, Any) for name in unknown)]
        return parts_as(base, wanted)
    return UNKNOWN


def _derives(cls: type, wanted: type) -> bool:
    try:
        return issubclass(cls, wanted)
    except TypeError:  # a protocol with data
        return wanted in cls.__mro__


def tuple_items(source: Any) -> tuple[Any, ...] | None:
    """Return the types of a tuple's items, with `...` after the only one if the tuple has any length.

    Returns `UNKNOWN` if the types are not declared, or the source is not a tuple.
    """
    cls = class_of(source)
    if cls is None or not issubclass(cls, tuple):
        return UNKNOWN
    if cls is tuple:
        # A bare `tuple` has no origin; `tuple[()]` has one, and no arguments either.
        return UNKNOWN if source is tuple or source is typing.Tuple else typing.get_args(source)  # noqa: UP006
    if hasattr(cls, "_fields") and tuple in cls.__bases__:
        known = dict(zip(getattr(cls, "__parameters__", ()), typing.get_args(source), strict=False))
        return tuple(known.get(one, one) for one in _fields(cls))
    for base in cls.__dict__.get("__orig_bases__", cls.__bases__):
        if class_of(base) is not None:
            return tuple_items(base)
    return UNKNOWN


def _fields(cls: type) -> tuple[Any, ...]:
    try:
        hints = typing.get_type_hints(cls)
    except Exception:  # names that exist only for type checkers
        hints = {}
    return tuple(hints.get(name, Any) for name in getattr(cls, "_fields", hints))


def _union(hints: tuple[Any, ...]) -> Any:
    members = [hint for hint in hints if hint is not Ellipsis]
    return typing.Union[tuple(members)] if members else typing.Never  # noqa: UP007 - some hints know no |


def callable_parts(hint: Any) -> tuple[list[Any] | None, Any]:
    """Return the argument types of a callable, None if they are open, and its result type."""
    arguments = typing.get_args(hint)
    if typing.get_origin(hint) is type:
        return None, arguments[0]
    if typing.get_origin(hint) is not abc.Callable or len(arguments) != 2:
        return None, Any
    return (arguments[0] if isinstance(arguments[0], list) else None), arguments[1]


def lacks(cls: type, protocol: type) -> str | None:
    """Return the first member of a protocol that a class visibly lacks; None if it has all.

    Attributes that `__init__` assigns count as members, as they do for type checkers.
    """
    if not is_protocol(protocol) or protocol in cls.__mro__:
        return None
    wanted = sorted(get_protocol_members(protocol))
    return next((name for name in wanted if not _has(cls, name)), None)


def _has(cls: type, name: str) -> bool:
    for one in cls.__mro__:
        own = vars(one)
        if name in own:
            return own[name] is not None  # `__hash__ = None` removes it
        begin = own.get("__init__")
        if name in own.get("__annotations__", ()) or (
            isinstance(begin, FunctionType) and name in begin.__code__.co_names
        ):
            return True
    return False
