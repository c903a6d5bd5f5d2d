"""The parts of a codec, and codecs that are composed of others. Depends on types.

A value is *lowered* to its carrier, which msgspec writes, and *lifted* from it.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np

from hfg.types import accepts, describe, describe_value

Arrays = list["np.ndarray[Any, Any]"]
Lower = Callable[[Any, Arrays], Any]
"""Returns the carrier of a value, and adds its arrays to those of the frame."""
Lift = Callable[[Any, Arrays], Any]
"""Returns the value that is carried."""
_REMEMBERED: Final = 64


class Unfit(Exception):
    """A value does not exactly match its type; `where` grows while the error travels out of the value."""

    def __init__(self, value: Any, hint: Any, why: str = "") -> None:
        super().__init__()
        self.value = value
        self.hint = hint
        self.why = why
        self.where = ""

    def inside(self, place: str) -> Unfit:
        """Add the part of a value in which the error occurred."""
        self.where = place + self.where
        return self

    def sentence(self, what: str) -> str:
        """Return the message for the sender."""
        found = f"expected {describe(self.hint)}, found {describe_value(self.value)}"
        why = self.why or (
            "it would arrive as another class: send exactly the declared one"
            if accepts(self.value, self.hint)
            else "send what the port declares, or declare what it sends"
        )
        return f"{what}{self.where} cannot be sent: {found}; {why}"


class Codec(NamedTuple):
    """Converts the values of one type.

    Attributes:
      hint: the type.
      form: plain data with everything that two ends must agree on.
      wire: the type that carries it, which msgspec writes and reads.
      exact: classes whose values are their own carrier; empty unless the type is a leaf.
      lower: checks a value and returns its carrier.
      lift: returns the value of a carrier; None if they are the same.
    """

    hint: Any
    form: Any
    wire: Any
    exact: frozenset[type]
    lower: Lower
    lift: Lift | None


class Later:
    """The codec of a recursive type while it is made: its carrier is read in a second step."""

    def __init__(self, hint: Any, name: str) -> None:
        self.made: Codec | None = None
        self.codec = Codec(hint, ["again", name], Any, frozenset(), self._lower, self._lift)

    def _lower(self, value: Any, arrays: Arrays) -> Any:
        assert self.made is not None
        return self.made.lower(value, arrays)

    def _lift(self, data: Any, arrays: Arrays) -> Any:
        assert self.made is not None
        data = msgspec.convert(data, self.made.wire)
        return data if self.made.lift is None else self.made.lift(data, arrays)


def generic(cls: Any, *parts: Any) -> Any:
    """Return a class with its type arguments."""
    return cls[parts]


def _or_none(wire: Any) -> Any:
    """Return the type of a carrier that may be None, too."""
    return None if wire is None else wire | None


def unchanged(data: Any, arrays: Arrays) -> Any:
    """Return a value that is its own carrier."""
    return data


def leaf(hint: Any, form: Any, wire: Any, *classes: type) -> Codec:
    """Return the codec of a type whose values have one of some classes, and carry themselves."""
    exact = frozenset(classes)

    def lower(value: Any, arrays: Arrays) -> Any:
        if type(value) in exact:
            return value
        if isinstance(value, np.generic):  # a numpy number is the same number
            item = value.item()
            if type(item) in exact:
                return item
        raise Unfit(value, hint)

    return Codec(hint, [form] if isinstance(form, str) else form, wire, exact, lower, None)


def optional(hint: Any, form: Any, other: Codec) -> Codec:
    """Return the codec of a type or None."""
    lower_other, lift_other = other.lower, other.lift

    def lower(value: Any, arrays: Arrays) -> Any:
        return None if value is None else lower_other(value, arrays)

    def lift(data: Any, arrays: Arrays) -> Any:
        return None if data is None or lift_other is None else lift_other(data, arrays)

    return Codec(hint, form, _or_none(other.wire), frozenset(), lower, None if lift_other is None else lift)


def tagged(hint: Any, form: Any, members: list[Codec], may_be_none: bool) -> Codec:
    """Return the codec of a union that sends the number of the member."""
    boxes: list[Any] = [
        msgspec.defstruct(f"Box{number}", [("value", member.wire)], tag=number, array_like=True, frozen=True)
        for number, member in enumerate(members)
    ]
    # for each class, the member that took its last value: most often it takes the next one, too
    first: dict[type, int] = {}

    def lower(value: Any, arrays: Arrays) -> Any:
        if value is None and may_be_none:
            return None
        begin, kind = len(arrays), type(value)
        likely = first.get(kind)
        order: Iterable[int] = range(len(members))
        for number in order if likely is None else (likely, *order):
            try:
                made = boxes[number](members[number].lower(value, arrays))
            except Unfit:
                del arrays[begin:]
                continue
            if len(first) < _REMEMBERED:
                first[kind] = number
            return made
        raise Unfit(value, hint)

    lifts = {box: member.lift for box, member in zip(boxes, members, strict=True)}

    def lift(data: Any, arrays: Arrays) -> Any:
        if data is None:
            return None
        inner = lifts[type(data)]
        return data.value if inner is None else inner(data.value, arrays)

    wire = functools.reduce(operator.or_, boxes)
    return Codec(hint, form, wire | None if may_be_none else wire, frozenset(), lower, lift)


def each(values: Iterable[Any], lower: Lower, arrays: Arrays, place: str | None = None) -> list[Any]:
    """Lower all items of a container."""
    made: list[Any] = []
    try:
        for value in values:
            made.append(lower(value, arrays))  # noqa: PERF401 - its length says which value did not fit
    except Unfit as problem:
        raise problem.inside(place or f"[{len(made)}]") from None
    return made


def each_pair(value: Any, lower_key: Lower, lower_item: Lower, arrays: Arrays) -> list[tuple[Any, Any]]:
    """Lower all keys and values of a mapping."""
    made, key = [], None
    try:
        for key, item in value.items():
            made.append((lower_key(key, arrays), lower_item(item, arrays)))
    except Unfit as problem:
        raise problem.inside(f"[{key!r:.40}]") from None
    return made


def lower_parts(parts: Sequence[Codec], places: Sequence[str]) -> Lower:
    """Lower a tuple of values of different types.

    A tuple of classes that was right for the leaves is right again, so one lookup checks all of them.
    """
    leaves = [number for number, part in enumerate(parts) if part.exact]
    others = [(number, part.lower) for number, part in enumerate(parts) if not part.exact]
    right: set[tuple[type, ...]] = set()

    def lower(items: tuple[Any, ...], arrays: Arrays) -> Any:
        kinds = tuple(map(type, items))
        made: Any = items
        number = 0
        try:
            if kinds not in right:
                made = list(items)
                for number in leaves:
                    made[number] = parts[number].lower(items[number], arrays)
                if len(right) < _REMEMBERED and all(map(operator.is_, made, items)):
                    right.add(kinds)
            elif others:
                made = list(items)
            for number, one in others:
                made[number] = one(items[number], arrays)
        except Unfit as problem:
            raise problem.inside(places[number]) from None
        return made

    return lower


def lift_parts(parts: Sequence[Codec]) -> Callable[[Any, Arrays], list[Any]] | None:
    """Return a function that lifts a tuple of values of different types; None if nothing is to be done."""
    if all(part.lift is None for part in parts):
        return None
    lifts = [(number, part.lift) for number, part in enumerate(parts) if part.lift is not None]

    def lift(data: Any, arrays: Arrays) -> list[Any]:
        made = list(data)
        for number, one in lifts:
            made[number] = one(made[number], arrays)
        return made

    return lift
