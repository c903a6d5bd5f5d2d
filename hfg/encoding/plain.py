"""Reads JSON from an unknown source (rule L4).

Two bytes, `[]`, become a list of eighty bytes. So the number of values is limited as well as the size of the text.
Depends on bounds and msgspec.
"""

from __future__ import annotations

import re
from typing import Any, Final

import msgspec

from hfg.base.bounds import JSON_VALUES

_TEXT: Final = re.compile(rb'"(?:[^"\\]|\\.)*+"', re.DOTALL)
_MARKS: Final = (b"[", b"{", b":", b",")  # each precedes at most one value


def json_value(data: bytes) -> Any:
    """Read a value.

    Raises:
      ValueError: it is not JSON (`msgspec.DecodeError` is a ValueError), or has too many values.
      RecursionError: it has too many levels.
    """
    most = JSON_VALUES.most
    if len(data) > most and _marks(data) > most and (found := _marks(_TEXT.sub(b"", data))) > most:
        raise ValueError(f"it has {found:,} values or more, {JSON_VALUES.remedy}")
    return msgspec.json.decode(data)


def _marks(data: bytes) -> int:
    return sum(map(data.count, _MARKS))
