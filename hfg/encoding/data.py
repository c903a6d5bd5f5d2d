"""Converts any value to plain data, as YAML and JSON hold it, and back by its declared type.

Information that the declared type has is not written: an enum is its name, a path its text, a colour "#rrggbb", an
array a nested list, a set a sorted list, a dataclass or struct its fields, a function or class "module:name". If the
type is `Any` or a union, the data has the type: `{"$type": "path", "value": "a.png"}`. A value is decoded as the same
value, or not encoded at all. Depends on types and values, not on parameters. It runs no code except that of the modules
that are named, which `find` imports or refuses.
"""

from __future__ import annotations

import ast
import base64
import enum
import math
from collections.abc import Iterable
from pathlib import PurePath
from typing import Any, Final

import msgspec
import numpy as np

from hfg.base.values import Colour, Span, same
from hfg.encoding.decoding import (
    TAG,
    TEXTS,
    Find,
    already_imported,
    decoded,
    find_reference,
    find_tagged,
    order,
    reference_to,
)
from hfg.encoding.records import names_of
from hfg.errors import EncodingError
from hfg.types import accepts, bare_type, describe, describe_value

_WORDS: Final = {"true": True, "false": False, "none": None, "null": None}


def encode(value: Any, hint: Any = Any) -> Any:
    """Return a value as plain data: None, booleans, numbers, strings, lists, and dicts with strings as keys.

    Args:
      value: any value that can be represented as data.
      hint: its declared type, which must also be used to decode it.

    Raises:
      EncodingError: it cannot be represented as data, or would be decoded as another value.

    Examples:
      >>> encode({"path": Path("a/b.png"), "frame": Colour(255, 128, 0)}, dict[str, Path | Colour])
      {'path': {'$type': 'path', 'value': 'a/b.png'}, 'frame': {'$type': 'colour', 'value': '#ff8000'}}
      >>> encode(Colour(255, 128, 0), Colour)
      '#ff8000'
    """
    try:
        for tagged in (False, True):
            data = _plain(value, tagged)
            if _comes_back(data, hint, value):
                return data
    except RecursionError:
        raise EncodingError("a value that contains itself, or is nested too deep, cannot be stored") from None
    if not accepts(value, hint):
        raise EncodingError(f"{describe_value(value)} is not {describe(hint)}, so it cannot be stored as one")
    raise EncodingError(f"{describe_value(value)} cannot be stored: it would be read back as another value")


def _comes_back(data: Any, hint: Any, value: Any) -> bool:
    try:
        return same(decoded(data, hint, "", already_imported), value)
    except EncodingError:
        return False


def decode(data: Any, hint: Any = Any, *, where: str = "the value", find: Find | None = None) -> Any:
    """Return the value that plain data represents; data that is already such a value is returned unchanged.

    Args:
      data: the result of `encode`, or data that a person wrote; tuples count as lists.
      hint: the declared type.
      where: the name of the value in messages.
      find: returns the code that "module:name" refers to, tagged as a reference or not; raises any error to refuse it.
        Without it, only data with the tag "reference" refers to code, and its module is imported.

    Raises:
      EncodingError: it does not represent a value of the type; the message has the part, the expected and the found
        value.

    Examples:
      >>> decode(["a.png", "b.png"], tuple[Path, ...])[1].suffix
      '.png'
      >>> decode("red", Colour)
      Traceback (most recent call last):
      hfg.errors.EncodingError: the value must be a colour, as in "#ff8000", got 'red'
    """
    try:
        return decoded(data, hint, where, find or find_tagged)
    except RecursionError:
        raise EncodingError(f"{where} contains itself, or is nested too deep") from None


def has_tag(data: Any) -> bool:
    """Return whether some part of the data states its own type."""
    if isinstance(data, dict):
        return TAG in data or any(map(has_tag, data.values()))
    return isinstance(data, list | tuple) and any(map(has_tag, data))


def read_text(text: str, hint: Any = Any, *, where: str = "the value", find: Find | None = None) -> Any:
    """Return the value that a string represents, as typed on the command line.

    It is read as a Python literal, as true, false or none, as the string itself, or as a list separated by commas.

    Raises:
      EncodingError: it does not represent a value of the type.

    Examples:
      >>> read_text("0.2, 0.8", Span[float]), read_text("a, b", list[str]), read_text("3", str)
      (Span(low=0.2, high=0.8), ['a', 'b'], '3')
    """
    first: EncodingError | None = None
    for data in _readings(text, hint):
        try:
            return decode(data, hint, where=where, find=find or find_reference)
        except EncodingError as error:
            first = first or error
    raise EncodingError(f"{where} must be {describe(hint)}, got {text!r:.80}") from first


def _readings(text: str, hint: Any) -> Iterable[Any]:
    if accepts(text, hint) and bare_type(hint) is not Any:
        yield text
    try:
        yield ast.literal_eval(text.strip())
    except (ValueError, SyntaxError, MemoryError, RecursionError, TypeError):
        if text.strip().lower() in _WORDS:
            yield _WORDS[text.strip().lower()]
    yield text
    if bare_type(hint) is not Any:
        yield [part.strip() for part in text.split(",")] if text.strip() else []


# --- from values ---


def _plain(value: Any, tagged: bool) -> Any:
    """Return a value as data; `tagged`: data that is not plain states its type."""
    kind = type(value)
    if value is None or kind in (bool, int, str):
        return value
    if isinstance(value, np.generic):
        return _plain(value.item(), tagged)
    if isinstance(value, float) and kind is float:
        return value if math.isfinite(value) else _tag("float", _inexact(value), tagged)
    if kind is list:
        return [_plain(one, tagged) for one in value]
    if kind is dict:
        if TAG not in value and all(type(key) is str for key in value):
            return {key: _plain(one, tagged) for key, one in value.items()}
        return _tag("dict", [[_plain(key, tagged), _plain(one, tagged)] for key, one in value.items()], tagged)
    if kind is tuple:
        return _tag("tuple", [_plain(one, tagged) for one in value], tagged)
    if kind in (set, frozenset):
        return _tag(kind.__name__, sorted((_plain(one, tagged) for one in value), key=order), tagged)
    if isinstance(value, np.ndarray):
        return _plain_array(value, tagged)
    return _plain_object(value, tagged)


def _plain_object(value: Any, tagged: bool) -> Any:
    kind = type(value)
    if isinstance(value, enum.Flag):
        return _tag_of(kind, [one.name for one in value], tagged)
    if isinstance(value, enum.Enum):
        return _tag_of(kind, value.name, tagged)
    if kind is Colour:
        return _tag("colour", _hex(value), tagged)
    if kind is Span:
        return _tag("span", [_plain(one, tagged) for one in value], tagged)
    if isinstance(value, PurePath):
        return _tag("path", value.as_posix(), tagged)
    if kind is bytes:
        return _tag("bytes", base64.b64encode(value).decode(), tagged)
    if kind is complex:
        return _tag("complex", str(value), tagged)
    if isinstance(value, TEXTS):
        return _tag_of(kind, msgspec.to_builtins(value), tagged)
    fields = names_of(kind, given=True)
    if fields is not None:
        return _tag_of(kind, {name: _plain(getattr(value, name), tagged) for name in fields}, tagged)
    if isinstance(value, type) or callable(value):
        reference = reference_to(value)
        if reference is not None:
            return _tag("reference", reference, tagged)
        raise EncodingError(f"{value!r:.80} cannot be found by a name, so it cannot be stored; define it in a module")
    raise EncodingError(
        f"{describe_value(value)} is not data that can be stored; use plain values, arrays, dataclasses or structs"
    )


def _tag(name: str, data: Any, tagged: bool) -> Any:
    return {TAG: name, "value": data} if tagged else data


def _tag_of(kind: type, data: Any, tagged: bool) -> Any:
    if not tagged:
        return data
    reference = reference_to(kind)
    if reference is None:
        raise EncodingError(f"{kind.__qualname__} cannot be found by a name, so its values cannot be stored")
    return {TAG: reference, "value": data}


def _inexact(value: float) -> str:
    return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"


def _hex(value: Colour) -> str:
    if not all(type(part) is int and 0 <= part <= 255 for part in value):
        raise EncodingError(f"{value!r} is not a colour: red, green and blue are from 0 to 255")
    return value.hex


def _plain_array(value: np.ndarray[Any, Any], tagged: bool) -> Any:
    if value.dtype.kind not in "biufcSU":
        raise EncodingError(f"{describe_value(value)} cannot be stored; numbers, booleans and strings can")
    items = value.astype(str) if value.dtype.kind == "S" else value
    data = items.tolist() if value.dtype.kind in "biuSU" else _numbers(items.tolist())
    if not tagged:
        return data
    name = value.dtype.name if value.dtype.isnative and value.dtype.kind in "biufc" else value.dtype.str
    return {TAG: "array", "dtype": name, "shape": list(value.shape), "value": data}


def _numbers(data: Any) -> Any:
    """Write numbers that JSON lacks as strings."""
    if isinstance(data, list):
        return [_numbers(one) for one in data]
    if isinstance(data, complex):
        return str(data)
    return data if math.isfinite(data) else _inexact(data)
