"""Reads properties, formulas and conditions from text, as graph files and the command line hold them.

    never(active(driving) & sent(drive.lamp, value == true))

It is the text that properties and formulas print. Names that are not plain stand in quotes: active("go home"). Depends
on `properties` and `conditions`.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final, NamedTuple, TypeVar

from hfg.errors import UsageError
from hfg.monitors import formulas as f
from hfg.monitors import properties as p
from hfg.monitors.conditions import ConditionReading
from hfg.monitors.formulas import Formula
from hfg.monitors.properties import Property
from hfg.monitors.reading import Token, shown

_PATH: Final = re.compile(r"[^\s,()&|~\"]+")

T = TypeVar("T")


class _Form(NamedTuple):
    """A function of the language: how many formulas it takes, and which numbers by name."""

    makes: Callable[..., Any]
    formulas: int
    names: tuple[str, ...] = ()


_PROPERTIES: Final[Mapping[str, _Form]] = {
    "always": _Form(p.always, 1),
    "never": _Form(p.never, 1),
    "precedes": _Form(p.precedes, 2),
    "leads_to": _Form(p.leads_to, 2, ("within_s",)),
    "eventually": _Form(p.eventually, 1, ("within_s",)),
    "until": _Form(p.until, 2, ("within_s",)),
}
_BACK: Final = ("within_s", "at_least_s")
_FORMULAS: Final[Mapping[str, _Form]] = {
    "previously": _Form(f.previously, 1),
    "once": _Form(f.once, 1, _BACK),
    "since": _Form(f.since, 2, _BACK),
    "throughout": _Form(f.throughout, 1, ("last_s",)),
    "implies": _Form(lambda one, other: one.implies(other), 2),
}
_ATOMS: Final = ("active", "sent", "fired")
_KNOWN: Final = (*_ATOMS, *_FORMULAS, "at_least")


def parse(text: str) -> Property:
    """Read a property.

    Args:
      text: at most 4,000 characters, with at most 40 brackets inside each other.

    Raises:
      UsageError: it is malformed; the message has the line and column, and what is expected there.

    Examples:
      >>> print(parse("never(active(driving) & sent(drive.lamp, value == true))"))
      never((active(driving) & sent(drive.lamp, value == true)))
    """
    reading = _Reading(text)
    found = reading.property()
    reading.end()
    return found


class _Reading(ConditionReading):
    """Reads one property."""

    def property(self) -> Property:
        name = self.name(_PROPERTIES, "a property")
        found: Property = self.call(name, _PROPERTIES[name.text])
        return found

    def name(self, known: Iterable[str], what: str) -> Token:
        found = self.take()
        if found.kind != "word" or found.text not in known:
            self.wrong(found.at, f"{what} is expected, got {shown(found)}; {_hint(found.text, known)}")
        self.need("(", f'after "{found.text}"')
        return found

    def call(self, name: Token, form: _Form) -> Any:
        """Read what a function takes, and the bracket after it."""
        given: list[Any] = []
        named: dict[str, float] = {}
        for number in range(form.formulas):
            if number:
                self.need(",", f"between the formulas of {name.text}")
            given.append(self.nested(self.formula))
        while self.is_next(","):
            self.take()
            word = self.take()
            if word.text not in form.names or word.text in named:
                free = [one for one in form.names if one not in named]
                expected = f"takes {' and '.join(f'{one}=' for one in free)}" if free else "takes nothing more"
                self.wrong(word.at, f"{name.text} {expected} here, got {shown(word)}")
            self.need("=", f'after "{word.text}"')
            named[word.text] = self.number()
        self.need(")", f"at the end of {name.text}(...)")
        return self.made(name, lambda: form.makes(*given, **named))

    def made(self, name: Token, make: Callable[[], T]) -> T:
        try:
            return make()
        except UsageError as error:
            self.wrong(name.at, str(error))

    def formula(self) -> Formula:
        return self.chain("|", lambda: self.chain("&", self.unary, f.And), f.Or)

    def unary(self) -> Formula:
        if self.is_next("~"):
            self.take()
            return ~self.nested(self.unary)
        if self.is_next("("):
            self.take()
            found = self.nested(self.formula)
            self.need(")", "at the end of the brackets")
            return found
        name = self.name(_KNOWN, "a formula")
        if name.text in _ATOMS:
            return self.atom(name)
        if name.text == "at_least":
            return self.at_least(name)
        made: Formula = self.call(name, _FORMULAS[name.text])
        return made

    def atom(self, name: Token) -> Formula:
        path = self.path(name.text)
        if name.text == "sent":
            return self.sent(name, path)
        self.need(")", f"at the end of {name.text}(...)")
        return f.active(path) if name.text == "active" else f.fired(path)

    def sent(self, name: Token, path: str) -> Formula:
        """Read what follows the port: a condition, an age, both or nothing."""
        when, older_than_s = None, None
        while older_than_s is None and self.is_next(","):
            self.take()
            if self.is_next("older_than_s"):
                self.take()
                self.need("=", 'after "older_than_s"')
                older_than_s = self.number()
            elif when is None:
                when = self.nested(self.condition)
            else:
                found = self.next()
                self.wrong(found.at, f"sent takes older_than_s= here, got {shown(found)}")
        self.need(")", "at the end of sent(...)")
        return self.made(name, lambda: f.sent(path, when, older_than_s=older_than_s))

    def at_least(self, name: Token) -> Formula:
        at, number = self.next().at, self.number()
        if not number.is_integer():
            self.wrong(at, f"at_least counts points, got {number:g}; give a whole number")
        self.need(",", "after the number of at_least")

        def counted(of: Formula, **named: float) -> Formula:
            return f.at_least(int(number), of, **named)

        made: Formula = self.call(name, _Form(counted, 1, ("within_s",)))
        return made

    def path(self, what: str) -> str:
        """A path is all up to a space, a bracket or a comma; or a text in quotes."""
        if self.next().kind == "text":
            return self.unquoted(self.take())
        while self.at < len(self.text) and self.text[self.at].isspace():
            self.at += 1
        found = _PATH.match(self.text, self.at)
        if found is None:
            self.wrong(self.at, f"{what} takes a path, such as {'camera.image' if what == 'sent' else 'robot/drive'}")
        self.at = found.end()
        return found.group()

    def number(self) -> float:
        found = self.take()
        if found.kind != "number":
            self.wrong(found.at, f"a number is expected, got {shown(found)}")
        return float(found.text)


def _hint(word: str, known: Iterable[str]) -> str:
    names = list(known)
    near = difflib.get_close_matches(word, names, n=1, cutoff=0.6)
    return f'did you mean "{near[0]}"?' if near else f"there are {', '.join(names)}"
