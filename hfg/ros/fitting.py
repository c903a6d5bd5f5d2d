"""Checks that a record can be encoded as its type says, and brings its arrays into the form that CDR needs.

Depends on definitions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import msgspec
import numpy as np

from hfg.errors import EncodingError, shown
from hfg.ros.definitions import ARRAY, BASE, INTEGERS, NAME, SEQUENCE, Fields, Record, dtype_of

Fit: TypeAlias = Callable[[Any, str], Any]
"""Takes a value and its place, and returns it as it is encoded."""


def fit_of(name: str, fields: Fields, record: type[Record], inner: dict[str, Fit]) -> Fit:
    """Return the check of a type's records.

    Args:
      name: of the type.
      fields: of the type.
      record: class of the records.
      inner: checks of the types in it.
    """
    parts = list(zip(record.__struct_fields__, [_fit(about, inner) for _, about in fields], strict=True))

    def fit(value: Any, where: str) -> Any:
        if isinstance(value, Mapping):
            value = _made(record, value, where)
        if type(value) is not record:
            raise EncodingError(f"{where} must be a record of {name}, found {shown(value)}")
        changed = {}
        for field, check in parts:
            given = getattr(value, field)
            kept = check(given, f"{where}.{field}")
            if kept is not given:
                changed[field] = kept
        return msgspec.structs.replace(value, **changed) if changed else value

    return fit


def _made(record: type[Record], fields: Mapping[str, Any], where: str) -> Record:
    unknown = next((name for name in fields if name not in record.__struct_fields__), None)
    if unknown is not None:
        raise EncodingError(f"{where} has no field {unknown!r:.80}, only {', '.join(record.__struct_fields__)}")
    return record(**fields)


def _fit(description: Any, inner: dict[str, Fit]) -> Fit:
    kind, about = description
    if kind == NAME:
        return inner[about]
    if kind == BASE:
        return _number(about[0]) if about[0] != "string" else _text(about[1])
    item, count = about
    exact = kind == ARRAY
    if item[0] == BASE and item[1][0] != "string":
        return _array(dtype_of(item[1][0]), count, exact=exact)
    assert kind in (ARRAY, SEQUENCE)
    return _list(_fit(item, inner), count, exact=exact)


def _number(kind: str) -> Fit:
    low, high = INTEGERS.get("uint8" if kind == "byte" else kind, (0, 1))

    def integer(value: Any, where: str) -> Any:
        if not isinstance(value, int | np.integer) or not low <= value <= high:
            raise EncodingError(f"{where} must be an integer from {low} to {high}, found {shown(value)}")
        return value

    def real(value: Any, where: str) -> Any:
        if not isinstance(value, int | float | np.floating | np.integer):
            raise EncodingError(f"{where} must be a number, found {shown(value)}")
        return value

    def boolean(value: Any, where: str) -> Any:
        if not isinstance(value, bool | np.bool_):
            raise EncodingError(f"{where} must be true or false, found {shown(value)}")
        return value

    return real if kind.startswith("float") else boolean if kind == "bool" else integer


def _text(most: int) -> Fit:
    def text(value: Any, where: str) -> Any:
        if not isinstance(value, str):
            raise EncodingError(f"{where} must be a string, found {shown(value)}")
        if most and len(value.encode(errors="replace")) > most:
            raise EncodingError(f"{where} must have at most {most} bytes, found {shown(value)}")
        return value

    return text


def _need_count(where: str, found: int, count: int, *, exact: bool) -> None:
    if (exact and found != count) or (count and found > count):
        raise EncodingError(f"{where} must have {'' if exact else 'at most '}{count} items, found {found}")


def _array(dtype: np.dtype[Any], count: int, *, exact: bool) -> Fit:
    def array(value: Any, where: str) -> Any:
        if type(value) is np.ndarray and value.dtype == dtype and value.ndim == 1 and value.flags.c_contiguous:
            _need_count(where, len(value), count, exact=exact)
            return value
        try:
            given = np.asarray(value)
            with np.errstate(all="ignore"):
                made = np.ascontiguousarray(given, dtype) if given.ndim == 1 else None
        except (TypeError, ValueError, OverflowError):
            made = None
        if made is None or (len(made) and dtype.kind != "f" and not np.array_equal(made, given)):
            raise EncodingError(f"{where} must be a row of {dtype.name}, found {shown(value)}")
        _need_count(where, len(made), count, exact=exact)
        return made

    return array


def _list(item: Fit, count: int, *, exact: bool) -> Fit:
    def items(value: Any, where: str) -> Any:
        if not isinstance(value, list | tuple):
            raise EncodingError(f"{where} must be a list, found {shown(value)}")
        _need_count(where, len(value), count, exact=exact)
        made = [item(one, f"{where}[{number}]") for number, one in enumerate(value)]
        return value if all(a is b for a, b in zip(made, value, strict=True)) else made

    return items
