"""Classes of the standard library, and the types that carry their values. No dependencies."""

from __future__ import annotations

import datetime
import decimal
import fractions
import uuid
import zoneinfo
from collections.abc import Callable
from typing import Any, Final, NamedTuple


class Carried(NamedTuple):
    """A class that hfg knows, whose values are carried by values of a type."""

    by: Any
    lower: Callable[[Any], Any]
    lift: Callable[[Any], Any]


def _zone_of(value: datetime.datetime) -> tuple[str, str | None]:
    zone = value.tzinfo
    if isinstance(zone, zoneinfo.ZoneInfo) and zone.key:
        return f"{value.fold}{value.replace(tzinfo=None).isoformat()}", zone.key
    if zone is not None and type(zone) is not datetime.timezone:
        raise ValueError("its time zone has no name; use datetime.timezone or zoneinfo.ZoneInfo")
    return f"{value.fold}{value.isoformat()}", None


def _in_zone(data: tuple[str, str | None]) -> datetime.datetime:
    text, key = data
    value = datetime.datetime.fromisoformat(text[1:]).replace(fold=int(text[:1]))
    return value if key is None else value.replace(tzinfo=zoneinfo.ZoneInfo(key))


def _time_text(value: datetime.time) -> str:
    if value.tzinfo is not None and type(value.tzinfo) is not datetime.timezone:
        raise ValueError("its time zone has no fixed offset")
    return f"{value.fold}{value.isoformat()}"


def _fraction(data: tuple[int, int]) -> fractions.Fraction:
    made = fractions.Fraction(*data)
    if (made.numerator, made.denominator) != data:
        raise ValueError("a fraction is not in lowest terms")
    return made


NATIVE: Final = (bool, str, bytes, bytearray, decimal.Decimal, uuid.UUID, datetime.date)
"""Leaves that msgspec writes and reads without loss."""
CARRIED: Final[dict[type, Carried]] = {
    fractions.Fraction: Carried(tuple[int, int], fractions.Fraction.as_integer_ratio, _fraction),
    range: Carried(
        tuple[int, int, int], lambda value: (value.start, value.stop, value.step), lambda data: range(*data)
    ),
    datetime.datetime: Carried(tuple[str, str | None], _zone_of, _in_zone),
    datetime.time: Carried(
        str, _time_text, lambda data: datetime.time.fromisoformat(data[1:]).replace(fold=int(data[:1]))
    ),
    datetime.timedelta: Carried(
        tuple[int, int, int],
        lambda value: (value.days, value.seconds, value.microseconds),
        lambda data: datetime.timedelta(*data),
    ),
}
