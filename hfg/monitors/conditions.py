"""Conditions for a value as text: `value > 3`, `value.state == "open" & value.count < 2`.

They are data, unlike functions, so that graph files can hold them. They call no code but that of the values:
comparisons, fields and places in lists. Depends on `reading`.
"""

from __future__ import annotations

import json
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from hfg.monitors.reading import Reading, shown

_Test: TypeAlias = tuple[Any, ...]
"""("value", ("x", 0)), ("<", test, literal), ("&", test, test), ("|", test, test) or ("~", test)."""

_COMPARISONS: Final[Mapping[str, Callable[[Any, Any], Any]]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}
_CONSTANTS: Final[Mapping[str, Any]] = {
    "true": True, "True": True, "false": False, "False": False, "null": None, "None": None,
}  # fmt: skip
_RANKS: Final = {"|": 0, "&": 1, "~": 3}


@dataclass(frozen=True, slots=True)
class Condition:
    """A condition that was read from a text; call it with a value."""

    test: _Test

    def __call__(self, value: Any) -> bool:
        """Return whether a value satisfies it."""
        return _holds(self.test, value)

    def __str__(self) -> str:
        return _text(self.test, 0)


def _holds(test: _Test, value: Any) -> bool:
    match test:
        case ("value", steps):
            return bool(part_of(value, steps))
        case ("&", one, other):
            return _holds(one, value) and _holds(other, value)
        case ("|", one, other):
            return _holds(one, value) or _holds(other, value)
        case ("~", one):
            return not _holds(one, value)
    sign, (_, steps), literal = test
    return bool(_COMPARISONS[sign](part_of(value, steps), literal))


def part_of(value: Any, steps: tuple[str | int, ...]) -> Any:
    """Return the field or element of a value that a condition names."""
    for step in steps:
        value = value[step] if isinstance(step, int) or isinstance(value, dict) else getattr(value, step)
    return value


def _text(test: _Test, rank: int) -> str:
    match test:
        case ("value", steps):
            return "value" + "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps)
        case ("~", one):
            return f"~{_text(one, _RANKS['~'])}"
        case (("&" | "|") as sign, one, other):
            own = _RANKS[sign]
            said = f"{_text(one, own)} {sign} {_text(other, own + 1)}"
            return f"({said})" if own < rank else said
    sign, one, literal = test
    said = f"{_text(one, 0)} {sign} {json.dumps(literal, ensure_ascii=False)}"
    return f"({said})" if rank == _RANKS["~"] else said


def parse_condition(text: str) -> Condition:
    """Read a condition for a value.

    Raises:
      UsageError: it is malformed; the message says where.
    """
    reading = ConditionReading(text)
    found = reading.condition()
    reading.end()
    return found


class ConditionReading(Reading):
    """Reads conditions."""

    def condition(self) -> Condition:
        """Read a whole condition."""
        return Condition(self._any())

    def _any(self) -> _Test:
        return self.chain(
            "|",
            lambda: self.chain("&", self._one, lambda one, other: ("&", one, other)),
            lambda one, other: ("|", one, other),
        )

    def _one(self) -> _Test:
        if self.is_next("~"):
            self.take()
            return ("~", self.nested(self._one))
        if self.is_next("("):
            self.take()
            found = self.nested(self._any)
            self.need(")", "at the end of the brackets")
            return found
        word = self.take()
        if word.text != "value":
            self.wrong(word.at, f"a condition begins with value, such as value > 3, got {shown(word)}")
        test: _Test = ("value", self._steps())
        if self.is_next(*_COMPARISONS):
            return (self.take().text, test, self._literal())
        return test

    def _steps(self) -> tuple[str | int, ...]:
        """Read fields and places that follow `value`."""
        found: list[str | int] = []
        while self.is_next(".", "["):
            is_field = self.take().text == "."
            step = self.take()
            if is_field and (step.kind != "word" or step.text.startswith("_")):
                self.wrong(step.at, f"the public name of a field is expected, got {shown(step)}")
            if not is_field and (step.kind != "number" or not step.text.lstrip("-").isdigit()):
                self.wrong(step.at, f"a place in a list is a whole number, got {shown(step)}")
            found.append(step.text if is_field else int(step.text))
            if not is_field:
                self.need("]", "behind the place")
        return tuple(found)

    def _literal(self) -> Any:
        found = self.take()
        if found.kind == "text":
            return self.unquoted(found)
        if found.kind == "number":
            return _number(found.text)
        if found.kind == "word" and found.text in _CONSTANTS:
            return _CONSTANTS[found.text]
        return self.wrong(
            found.at, f'a number, a text in "quotes", true, false or null is expected, got {shown(found)}'
        )


def _number(text: str) -> float:
    return int(text) if text.lstrip("-").isdigit() else float(text)
