"""The kind of a parameter, derived from its type: it determines what an editor shows.

Depends on types and values, not on parameters.
"""

from __future__ import annotations

import enum
import os
import types
import typing
from collections import abc
from collections.abc import Iterable
from typing import Annotated, Any, Final, Literal, TypeAlias

import numpy as np

from hfg.base.values import Colour, Span
from hfg.types import Shape, bare_type

__all__ = [
    "ParameterKind",
    "choices_of",
    "kind_of_type",
    "shape_of",
    "type_of_choices",
    "type_of_default",
    "without_none",
]

ParameterKind: TypeAlias = Literal[
    "bool",
    "int",
    "float",
    "text",
    "choice",
    "choices",
    "interval",
    "colour",
    "path",
    "trigger",
    "list",
    "vector",
    "matrix",
    "progress",
    "output text",
    "any",
]

_SETS: Final = (set, frozenset, abc.Set, abc.MutableSet)
_LISTS: Final = (list, tuple, abc.Sequence, abc.MutableSequence, abc.Collection, abc.Iterable, *_SETS)
_NUMBERS: Final = (int, float)


def without_none(hint: Any) -> Any:
    """Return a union without None."""
    bare = bare_type(hint)
    if typing.get_origin(bare) in (typing.Union, types.UnionType):
        members = [one for one in typing.get_args(bare) if one is not type(None)]
        return typing.Union[tuple(members)] if members else hint  # noqa: UP007 - known at run time only
    return hint


def choices_of(hint: Any) -> dict[str, Any] | None:
    """Return the values that a type allows, by label, for a Literal, an enum, or a set of these; None for others."""
    hint = bare_type(without_none(hint))
    if typing.get_origin(hint) in _SETS and typing.get_args(hint):
        hint = bare_type(typing.get_args(hint)[0])
    if typing.get_origin(hint) is Literal:
        return {_label(one): one for one in typing.get_args(hint)}
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        return {one.name or str(one): one for one in hint}
    return None


def type_of_choices(hint: Any) -> Any:
    """Return the type of one choice of a parameter of this type: for a set or list, the type of its members."""
    bare = bare_type(without_none(hint))
    members = typing.get_args(bare) if typing.get_origin(bare) in (*_SETS, list) else ()
    return members[0] if members else hint


def _label(value: Any) -> str:
    return value.name if isinstance(value, enum.Enum) else str(value)


def kind_of_type(hint: Any, has_choices: bool = False) -> ParameterKind:
    """Return the kind of values of a type.

    Args:
      hint: the type.
      has_choices: the declaration lists the allowed values.
    """
    hint = without_none(hint)
    bare = bare_type(hint)
    origin, arguments = typing.get_origin(bare), typing.get_args(bare)
    if (origin or bare) in _SETS and (has_choices or choices_of(bare) is not None):
        return "choices"
    if isinstance(bare, type) and issubclass(bare, enum.Flag):
        return "choices"
    if has_choices and (origin or bare) is list:
        return "choices"
    if has_choices or choices_of(bare) is not None:
        return "choice"
    if (origin or bare) is Span:
        return "interval"
    if (origin or bare) is np.ndarray:
        shape = shape_of(hint)
        return "vector" if shape is not None and len(shape) == 1 else "matrix"
    if origin is tuple and arguments and ... not in arguments:
        return "vector" if all(bare_type(one) in _NUMBERS for one in arguments) else "any"
    if (origin or bare) in _LISTS:
        return "list"
    if origin in (typing.Union, types.UnionType):
        return "float" if set(map(bare_type, arguments)) == set(_NUMBERS) else "any"
    return _kind_of_class(bare)


def _kind_of_class(bare: Any) -> ParameterKind:
    if not isinstance(bare, type):
        return "any"
    if issubclass(bare, Colour):
        return "colour"
    if issubclass(bare, os.PathLike):
        return "path"
    for cls, kind in ((bool, "bool"), (int, "int"), (float, "float"), (str, "text")):
        if issubclass(bare, cls):
            return typing.cast(ParameterKind, kind)
    return "any"


def shape_of(hint: Any) -> tuple[int | None, ...] | None:
    """Return the shape that a type of arrays or numbers requires, with None for an axis of any length.

    Returns None if the type does not require a shape.
    """
    hint = without_none(hint)
    bare = bare_type(hint)
    if typing.get_origin(bare) is tuple:
        arguments = typing.get_args(bare)
        return (len(arguments),) if arguments and ... not in arguments else None
    layouts = [one for one in getattr(hint, "__metadata__", ()) if isinstance(one, Shape)]
    shapes = layouts[0].shapes() if layouts else ()
    return shapes[0] if len(shapes) == 1 else None


def type_of_default(default: Any) -> Any:
    """Return the type that a default implies: a path implies any path, an array its dtype and shape."""
    if default is None:
        return Any
    if isinstance(default, os.PathLike):
        bases = [
            one for one in type(default).__mro__ if one.__module__.startswith("pathlib") and one.__name__ == "Path"
        ]
        return bases[0] if bases else type(default)
    if isinstance(default, np.ndarray):
        return Annotated[np.ndarray[Any, np.dtype[default.dtype.type]], Shape(*default.shape)]
    if isinstance(default, Span):
        return Span[_number_of(default)]  # type: ignore[misc]
    if type(default) is tuple and len(default) > 1 and all(type(one) in _NUMBERS for one in default):
        return tuple[(_number_of(default),) * len(default)]  # type: ignore[misc]
    return type(default)


def _number_of(values: Iterable[Any]) -> type:
    return float if any(isinstance(one, float) for one in values) else int
