"""Reads JSON from an unknown source (rule L4).

Two bytes, `[]`, become a list of eighty bytes. So the number of values is limited as well as the size of the text.
Depends on bounds and msgspec.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from itertools import groupby
from typing import Any, Final

import msgspec

from hfg.base.bounds import JSON_VALUES

_TEXT: Final = re.compile(rb'"(?:[^"\\]|\\.)*+"', re.DOTALL)
_MARKS: Final = (b"[", b"{", b":", b",")  # each precedes at most one value

_FEW: Final = 1000
_MOST_ALIKE: Final = 100


def json_value(data: bytes) -> Any:
    """Read a value.

    Raises:
      ValueError: it is not JSON (`msgspec.DecodeError` is a ValueError), or has too many values.
      RecursionError: it has too many levels.
    """
    need_few_values(data)
    return msgspec.json.decode(data)


def need_few_values(data: bytes) -> None:
    """Refuse a text of JSON, or one of several, that becomes too many values.

    Raises:
      ValueError: it does.
    """
    most = JSON_VALUES.most
    if len(data) > most and _marks(data) > most and (found := _marks(_TEXT.sub(b"", data))) > most:
        raise ValueError(f"it has {found:,} values or more, {JSON_VALUES.remedy}")


def need_spread(values: Collection[object]) -> None:
    """Refuse values that were chosen to have one hash: a set of them takes a time that grows with its square.

    The hash of a number is known beforehand; that of a string is not.

    Raises:
      TypeError: a value has no hash.
      ValueError: they are refused.
    """
    if len(values) < _FEW:
        return
    ordered = sorted(values, key=hash)
    for _, alike in groupby(ordered, hash):
        first, *others = alike
        if sum(one != first for one in others) > _MOST_ALIKE:
            raise ValueError("more than a hundred of its members have the same hash, as only chosen ones have")


def _marks(data: bytes) -> int:
    return sum(map(data.count, _MARKS))
