"""The forms in which values of a type are written: the basis of encoding, decoding and the schemas of files.

Depends on `records` of the encoding.
"""

from __future__ import annotations

import enum
import types
import typing
from collections import abc
from typing import Annotated, Any, Final, Literal, NamedTuple

import numpy as np

from hfg.encoding.records import hints_of, names_of

PLAIN_TYPES: Final = frozenset({bool, int, float, str})
"""Types whose values are immutable and can be written as JSON."""


def bare(hint: Any) -> Any:
    """Return a type without its metadata."""
    while True:
        if typing.get_origin(hint) is Annotated:
            hint = typing.get_args(hint)[0]
        elif isinstance(hint, typing.NewType):
            hint = hint.__supertype__
        elif type(hint).__name__ == "TypeAliasType":
            hint = hint.__value__
        else:
            return hint


def is_plain(hint: Any) -> bool:
    """Return whether values of a type are numbers, booleans or strings, and so can be kept without a copy."""
    hint = bare(hint)
    if typing.get_origin(hint) is Literal:
        return all(type(one) in PLAIN_TYPES for one in typing.get_args(hint))
    return hint in PLAIN_TYPES


def reference(kind: type) -> str:
    """Return the name by which a class can be found."""
    return f"{kind.__module__}:{kind.__qualname__}"


def fields_of(kind: Any) -> dict[str, Any] | None:
    """Return the fields of a struct, dataclass or NamedTuple with their types; None for other classes."""
    names = names_of(kind)
    hints = {} if names is None else hints_of(kind)
    return None if names is None else {name: hints.get(name, Any) for name in names}


class Form(NamedTuple):
    """How values of a type are written; other values are written together with their own types.

    Attributes:
      kind: "any" if nothing is known about the type.
      of: the type of values other than None, of the items of a list, or of the values of a dict whose keys are names;
        the types of fields by name; the types of a tuple's items.
    """

    kind: Literal["optional", "fields", "enum", "bytes", "list", "tuple", "dict", "array", "any"]
    of: Any = None


def form_of(hint: Any) -> Form:
    """Return the form of a type that is `bare`."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    other = _optional(hint)
    if other is not None:
        return Form("optional", other)
    fields = fields_of(hint)
    if fields is not None:
        return Form("fields", fields)
    if isinstance(hint, type) and issubclass(hint, enum.Enum):
        return Form("enum")
    if hint is bytes:
        return Form("bytes")
    if hint in (list, abc.Sequence) or origin in (list, abc.Sequence):
        return Form("list", arguments[0] if arguments else Any)
    if hint is tuple or origin is tuple:
        return Form("tuple", arguments)
    if origin is dict and arguments and bare(arguments[0]) is str:
        return Form("dict", arguments[1])
    if hint is np.ndarray or origin is np.ndarray:
        return Form("array")
    return Form("any")


def _optional(hint: Any) -> Any:
    """Return the only other member of a union with None."""
    if typing.get_origin(hint) not in (typing.Union, types.UnionType):
        return None
    others = [one for one in typing.get_args(hint) if one is not types.NoneType]
    return others[0] if len(others) == 1 else None
