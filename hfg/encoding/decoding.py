"""Decodes values from plain data by their declared type, and finds code by reference; see `data`.

Depends on types, values, `plain` and `records`.
"""

from __future__ import annotations

import base64
import binascii
import datetime
import decimal
import enum
import importlib
import json
import math
import os
import types
import typing
import uuid
from collections import abc
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, Literal

import msgspec
import numpy as np

from hfg.base.values import Colour, Span, same
from hfg.encoding.plain import need_spread
from hfg.encoding.records import hints_of, imported, names_of
from hfg.errors import EncodingError
from hfg.types import accepts, bare_type, describe

TAG: Final = "$type"
"""The key in data that states its own type."""
TEXTS: Final = (
    datetime.datetime,
    datetime.date,
    datetime.time,
    datetime.timedelta,
    decimal.Decimal,
    uuid.UUID,
)
"""Types written as a string that msgspec reads."""
_AS_LIST: Final = (list, abc.Sequence, abc.MutableSequence, abc.Collection, abc.Iterable)
_AS_SET: Final = {set: set, abc.MutableSet: set, frozenset: frozenset, abc.Set: frozenset}
_AS_DICT: Final = (dict, abc.Mapping, abc.MutableMapping)
_CODE: Final = (types.FunctionType, types.BuiltinFunctionType, type, abc.Callable, Callable)
INEXACT: Final = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}
_LONGEST_ITEM: Final = 2**16  # bytes of one string in an array: input that asks for more is an attack
Find = Callable[[str], Any]


# --- references ---


def reference_to(value: Any) -> str | None:
    """Return "module:name" of a function or class; None if it cannot be found by that name."""
    module, name = getattr(value, "__module__", None), getattr(value, "__qualname__", None)
    if module is None and isinstance(name, str) and hasattr(value, "__name__"):  # functions of C libraries
        return None
    if not isinstance(module, str) or not isinstance(name, str) or imported(f"{module}:{name}") is not value:
        return None
    return f"{module}:{name}"


def find_reference(reference: str) -> Any:
    """Import the module and return the object for "module:name".

    Raises:
      EncodingError: there is no such object.
    """
    module, colon, name = reference.partition(":")
    if not (module and colon and name):
        raise EncodingError(f'{reference!r:.80} is not a reference; write "module:name", as in "my_robot.types:Pose"')
    try:
        importlib.import_module(module)
    except Exception as error:  # a module may raise anything
        raise EncodingError(f'"{reference}": importing "{module}" failed ({type(error).__name__}: {error})') from error
    return already_imported(reference)


def find_tagged(reference: str) -> Any:
    """Find what a tag names, where the caller sets no limits to references; see `_Decoder.code`."""
    return find_reference(reference)


def already_imported(reference: str) -> Any:
    """Find code without importing its module."""
    found = imported(reference)
    if found is None:
        module, _, name = reference.partition(":")
        raise EncodingError(f'"{reference}": module "{module}" has no "{name}"')
    return found


# --- values ---


def decoded(data: Any, hint: Any, where: str, find: Find) -> Any:
    """Return the value of data; see `decode`."""
    if isinstance(data, dict) and TAG in data:
        value = _untagged(data, where, find)
    else:
        value = _Decoder(where, find, hint).value(data, hint)
    if not accepts(value, hint):
        raise _refusal(where, hint, data)
    return value


def _refusal(where: str, hint: Any, data: Any) -> EncodingError:
    return EncodingError(f"{where} must be {describe(hint)}, got {data!r:.80}")


def _untagged(data: dict[str, Any], where: str, find: Find) -> Any:
    """Return the value of data that states its own type."""
    name = data[TAG]
    if not isinstance(name, str) or "value" not in data:
        raise EncodingError(f'{where} has "{TAG}" but does not state the type of its "value", got {data!r:.80}')
    inner = data["value"]
    if name == "array":
        return _array(data, where)
    hint = _TAGGED.get(name)
    if hint is None:
        hint = find(name)
        if not is_data_type(hint):
            raise EncodingError(f'{where} is of type "{name}", which is not a type of data')
    elif name == "dict":
        return _pairs(inner, Any, Any, where, find)
    elif name == "reference" and isinstance(inner, str):
        return find(inner)
    return decoded(inner, hint, where, find)


_TAGGED: Final[dict[str, Any]] = {
    "float": float,
    "dict": dict,
    "tuple": tuple,
    "set": set,
    "frozenset": frozenset,
    "colour": Colour,
    "span": Span,
    "path": Path,
    "bytes": bytes,
    "complex": complex,
    "reference": Callable,
}


def is_data_type(kind: Any) -> bool:
    """Return whether the values of a class consist only of data, so that reading one runs only its own checks."""
    return isinstance(kind, type) and (issubclass(kind, (enum.Enum, *TEXTS)) or names_of(kind, given=True) is not None)


def _array(data: dict[str, Any], where: str) -> Any:
    try:
        dtype = np.dtype(data.get("dtype", "float64"))
        if dtype.kind not in "biufcSU" or dtype.itemsize > _LONGEST_ITEM:
            raise ValueError(f"an array of {dtype} is not data")
        made = np.array(data["value"], dtype=dtype)
        return made.reshape(data["shape"]) if "shape" in data else made
    except (ValueError, TypeError, OverflowError) as error:
        raise EncodingError(f"{where} is not an array ({error})") from None


def _pairs(data: Any, key: Any, item: Any, where: str, find: Find) -> dict[Any, Any]:
    if isinstance(data, Mapping):
        data = list(data.items())
    if not _is_list(data) or not all(_is_list(one) and len(one) == 2 for one in data):
        raise EncodingError(f"{where} must be a mapping, or a list of pairs [key, value], got {data!r:.80}")
    try:
        pairs = [
            (decoded(one, key, f"{where}, key {one!r:.40}", find), decoded(other, item, f"{where}[{one!r:.40}]", find))
            for one, other in data
        ]
        need_spread([one for one, _ in pairs])
        return dict(pairs)
    except (TypeError, ValueError) as error:  # a key that cannot be hashed
        if isinstance(error, EncodingError):
            raise
        raise EncodingError(f"{where} has an invalid key ({error})") from None


def order(data: Any) -> tuple[str, Any]:
    """Return a key by which members of a set are sorted."""
    number = isinstance(data, int | float)
    return ("" if number else type(data).__name__, data if number or isinstance(data, str) else repr(data))


def _is_list(data: Any) -> bool:
    return type(data) in (list, tuple)


class _Decoder:
    """Reads data as one type; has a method for each family of types."""

    def __init__(self, where: str, find: Find, hint: Any) -> None:
        self.where = where
        self.find = find
        self.hint = hint

    def refuse(self, data: Any) -> EncodingError:
        return _refusal(self.where, self.hint, data)

    def each(self, data: Any, hint: Any) -> list[Any]:
        if not _is_list(data):
            raise self.refuse(data)
        return [decoded(one, hint, f"{self.where}[{number}]", self.find) for number, one in enumerate(data)]

    def value(self, data: Any, hint: Any) -> Any:
        bare = bare_type(hint)
        if hasattr(bare, "__supertype__"):
            return self.value(data, bare.__supertype__)
        origin, arguments = typing.get_origin(bare), typing.get_args(bare)
        if bare in (Any, object):
            return self.untyped(data)
        if origin in (typing.Union, types.UnionType):
            return self.union(data, arguments)
        if origin is Literal:
            return self.literal(data, arguments)
        if bare is np.ndarray or origin is np.ndarray:
            return self.array(data, arguments)
        cls = origin or bare
        if cls is Span:
            return self.span(data, arguments)
        if cls is tuple:
            return self.tuple(data, arguments)
        if cls in _AS_LIST:
            return data if isinstance(data, str) and cls is not list else self.each(data, (*arguments, Any)[0])
        if cls in _AS_SET:
            listed = sorted(data, key=order) if type(data) in (set, frozenset) else data
            return self.set_of(_AS_SET[cls], self.each(listed, (*arguments, Any)[0]))
        if cls in _AS_DICT:
            key, item = arguments if len(arguments) == 2 else (Any, Any)
            return _pairs(data, key, item, self.where, self.find)
        if cls in _CODE:
            return self.code(data)
        return self.instance(data, bare)

    def set_of(self, cls: Any, items: list[Any]) -> Any:
        try:
            need_spread(items)
            return cls(items)
        except (TypeError, ValueError) as error:
            raise EncodingError(f"{self.where} has an invalid member ({error})") from None

    def untyped(self, data: Any) -> Any:
        if type(data) is list:
            return self.each(data, Any)
        if type(data) is dict:
            return {key: decoded(one, Any, f"{self.where}[{key!r:.40}]", self.find) for key, one in data.items()}
        return data

    def union(self, data: Any, members: tuple[Any, ...]) -> Any:
        """Return the data itself if it is a value of a member; otherwise decode it as the first member that fits."""
        found: list[Any] = []
        for member in members:
            try:
                found.append(decoded(data, member, self.where, self.find))
            except EncodingError:
                continue
        if not found:
            raise self.refuse(data)
        return next((one for one in found if same(one, data)), found[0])

    def literal(self, data: Any, members: tuple[Any, ...]) -> Any:
        for one in members:
            if same(one, data) or (isinstance(one, enum.Enum) and one.name == data):
                return one
        raise self.refuse(data)

    def array(self, data: Any, arguments: tuple[Any, ...]) -> Any:
        if isinstance(data, np.ndarray):
            return data
        dtypes = typing.get_args(arguments[1]) if len(arguments) > 1 else ()
        scalar = bare_type(dtypes[0]) if dtypes else None
        concrete = isinstance(scalar, type) and issubclass(scalar, np.generic) and not _is_open(scalar)
        try:
            made = np.array(data, dtype=scalar if concrete else None)
        except (ValueError, TypeError, OverflowError):
            raise self.refuse(data) from None
        if made.dtype.kind not in "biufcSU":
            raise self.refuse(data)
        wanted = getattr(self.hint, "__metadata__", ())
        empty = [one.axes for one in wanted if hasattr(one, "axes") and made.size == 0]
        if empty and len(empty[0]) > made.ndim:  # [] is an array of no points, too
            made = made.reshape((*made.shape, *(axis or 0 for axis in empty[0][made.ndim :])))
        return made

    def span(self, data: Any, arguments: tuple[Any, ...]) -> Any:
        if type(data) is Span:
            return data
        ends = self.each(data, (*arguments, Any)[0])
        if len(ends) != 2:
            raise self.refuse(data)
        return Span(*ends)

    def tuple(self, data: Any, arguments: tuple[Any, ...]) -> Any:
        if not arguments or arguments[1:] == (...,):
            return tuple(self.each(data, (*arguments, Any)[0]))
        wanted = () if arguments == ((),) else arguments
        if not _is_list(data) or len(data) != len(wanted):
            raise self.refuse(data)
        return tuple(
            decoded(one, hint, f"{self.where}[{number}]", self.find)
            for number, (one, hint) in enumerate(zip(data, wanted, strict=True))
        )

    def code(self, data: Any) -> Any:
        if not isinstance(data, str):
            if callable(data):
                return data
            raise self.refuse(data)
        if self.find in (find_tagged, already_imported):  # or any text in a command could have code called
            raise EncodingError(
                f"{self.where} is {data!r:.80}, and a text alone does not refer to code; "
                f'write {{"{TAG}": "reference", "value": {json.dumps(data):.80}}}'
            )
        return self.find(data)

    def instance(self, data: Any, cls: Any) -> Any:
        """Decode an instance of a class that is not a container."""
        if not isinstance(cls, type):
            return data
        if issubclass(cls, enum.Enum):
            return data if isinstance(data, cls) else self.member(data, cls)
        if _is_instance(data, cls):
            return data
        if cls is float and isinstance(data, str) and data in INEXACT:
            return INEXACT[data]
        if cls is Colour:
            return self.colour(data)
        if issubclass(cls, os.PathLike) and isinstance(data, str):
            return typing.cast(Any, cls)(data)  # paths are made from strings
        if cls in (bytes, complex) and isinstance(data, str):
            return self.made_of_text(cls, data)
        if names_of(cls, given=True) is not None:
            return self.fields(data, cls)
        try:
            return msgspec.convert(data, cls)
        except Exception:  # types of users may raise anything
            raise self.refuse(data) from None

    def member(self, data: Any, cls: Any) -> Any:
        """Decode an enum member by name, a flag by several names; otherwise by value, as people write it."""
        if (
            issubclass(cls, enum.Flag)
            and _is_list(data)
            and all(isinstance(name, str) and name in cls.__members__ for name in data)
        ):
            found = cls(0)
            for name in data:
                found |= cls[name]
            return found
        if isinstance(data, str) and data in cls.__members__:
            return cls[data]
        try:
            return cls(tuple(data) if type(data) is list else data)
        except (ValueError, TypeError, KeyError):
            names = ", ".join(cls.__members__)
            raise EncodingError(f"{self.where} must be {describe(cls)}, one of {names}, got {data!r:.80}") from None

    def colour(self, data: Any) -> Colour:
        if isinstance(data, str):
            try:
                return Colour.of(data)
            except ValueError:
                raise EncodingError(f'{self.where} must be a colour, as in "#ff8000", got {data!r:.80}') from None
        if not _is_list(data) or len(data) != 3 or not all(type(one) is int and 0 <= one <= 255 for one in data):
            raise EncodingError(f'{self.where} must be a colour, as in "#ff8000" or [255, 128, 0], got {data!r:.80}')
        return Colour(*data)

    def made_of_text(self, cls: Any, data: str) -> Any:
        try:
            return complex(data) if cls is complex else base64.b64decode(data, validate=True)
        except (ValueError, binascii.Error):
            raise self.refuse(data) from None

    def fields(self, data: Any, cls: Any) -> Any:
        names = names_of(cls, given=True) or ()
        if _is_list(data) and issubclass(cls, tuple):
            data = dict(zip(names, data, strict=False)) if len(data) <= len(names) else None
        if not isinstance(data, dict):
            raise self.refuse(data)
        unknown = next((name for name in data if name not in names), None)
        if unknown is not None:
            raise EncodingError(
                f"{self.where} has no {unknown!r:.40}: {describe(cls)} has {', '.join(names) or 'nothing'}"
            )
        hints = hints_of(cls)
        values = {
            name: decoded(one, hints.get(name, Any), f"{self.where}.{name}", self.find) for name, one in data.items()
        }
        try:
            return cls(**values)
        except Exception as error:  # classes of users check their fields and may raise anything
            raise EncodingError(f"{self.where} is not {describe(cls)} ({type(error).__name__}: {error})") from error


def _is_instance(data: Any, cls: type) -> bool:
    if isinstance(data, cls):
        return True
    return (cls is float and isinstance(data, int)) or (cls is complex and isinstance(data, int | float))


def _is_open(scalar: type) -> bool:
    """Return whether a scalar class represents several dtypes."""
    try:
        return np.dtype(scalar).type is not scalar
    except TypeError:
        return True
