"""Classes with fields: structs, dataclasses, named tuples. Their names, and the names and types of their fields.

Depends on msgspec.
"""

from __future__ import annotations

import dataclasses
import inspect
import operator
import sys
import types
import typing
from collections.abc import Callable, Sequence
from typing import Any

import msgspec


def names_of(kind: Any, *, given: bool = False) -> tuple[str, ...] | None:
    """Return the names of the fields of a class; None if it is not a class with fields.

    Args:
      kind: the class.
      given: leave out fields of a dataclass that its constructor does not take.
    """
    if not isinstance(kind, type):
        return None
    if issubclass(kind, msgspec.Struct):
        return kind.__struct_fields__
    if dataclasses.is_dataclass(kind):
        return tuple(one.name for one in dataclasses.fields(kind) if one.init or not given)
    names = getattr(kind, "_fields", None)
    return names if issubclass(kind, tuple) and isinstance(names, tuple) else None


def hints_of(kind: type) -> dict[str, Any]:
    """Return the types of the fields of a class; nothing if they exist only for type checkers."""
    try:
        return typing.get_type_hints(kind, include_extras=True)
    except Exception:  # any error in an annotation
        return {}


def imported(reference: str) -> Any:
    """Return the object for "module:name" if its module is imported; otherwise, or for a module, None."""
    module, _, name = reference.partition(":")
    first, *nested = name.split(".")
    found: Any = getattr(sys.modules.get(module), first, None)
    for part in nested:  # classes in classes, never names that the module has itself imported
        found = getattr(found, part, None) if isinstance(found, type) else None
    return None if isinstance(found, types.ModuleType) else found


def required_keys(cls: Any) -> frozenset[str]:
    """Return the keys that are required. With quoted annotations, the class itself does not know them."""
    hints = typing.get_type_hints(cls, include_extras=True)
    marked = {name: typing.get_origin(hint) for name, hint in hints.items()}
    required = {name for name in cls.__required_keys__ if marked.get(name) is not typing.NotRequired}
    return frozenset(required | {name for name, mark in marked.items() if mark is typing.Required})


def filled(hint: Any, known: dict[Any, Any]) -> Any:
    """Replace the parameters of a generic class in the type of a field."""
    if isinstance(hint, typing.TypeVar):
        return known.get(hint, hint)
    unknown = getattr(hint, "__parameters__", ())
    if known and unknown and typing.get_origin(hint) is not None:
        return hint[tuple(known.get(one, one) for one in unknown)]
    return hint


def giver(cls: Any, names: tuple[str, ...]) -> Callable[[Any], tuple[Any, ...]]:
    """Return a function that returns the fields of an object as a tuple."""
    if issubclass(cls, tuple):
        return tuple
    if not names:
        return lambda value: ()
    give = operator.attrgetter(*names)
    return give if len(names) > 1 else lambda value: (give(value),)


def maker(cls: Any, names: tuple[str, ...]) -> Callable[[Any], Any]:
    """Return a function that makes an object from its fields.

    It calls the class if possible, so that its checks run and derived fields are computed.
    """
    if issubclass(cls, tuple):
        return lambda items: cls._make(items)
    arguments = inspect.signature(cls).parameters
    if tuple(arguments) == names and not any(one.kind is one.KEYWORD_ONLY for one in arguments.values()):
        return lambda items: cls(*items)
    if set(arguments) == set(names):
        return lambda items: cls(**dict(zip(names, items, strict=True)))
    finish = getattr(cls, "__post_init__", None)

    def make(items: Sequence[Any]) -> Any:  # fields that the class computes itself, or a custom __init__
        made = object.__new__(cls)
        for name, item in zip(names, items, strict=True):
            object.__setattr__(made, name, item)
        if finish is not None:
            finish(made)
        return made

    return make
