"""Reads a text of the language of monitors from left to right: tokens, and errors with line and column.

The text is data, so its size and its depth are bounded. Depends on `errors`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Final, NamedTuple, NoReturn, TypeVar

from hfg.errors import UsageError

LONGEST: Final = 4000
"""Characters of a text."""
MOST_NESTED: Final = 40
"""How deep brackets may be nested."""

_MOST_IN_A_CHAIN: Final = 100  # of & and |: formulas are walked recursively
_TOKEN: Final = re.compile(
    r"""(?P<space>[\s]+)
      | (?P<number>-?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w]))
      | (?P<word>[^\W\d]\w*)
      | (?P<text>"(?:[^"\\\n]|\\.)*")
      | (?P<sign>==|!=|<=|>=|[<>=&|~(),.\[\]])""",
    re.VERBOSE,
)

T = TypeVar("T")


class Token(NamedTuple):
    """A piece of the text: of which kind, what, and where."""

    kind: str
    text: str
    at: int


class Reading:
    """Reads one text from left to right."""

    def __init__(self, text: str) -> None:
        if not isinstance(text, str):
            raise UsageError(f"a condition is a text, such as never(active(driving)), got {text!r:.80}")
        if len(text) > LONGEST:
            raise UsageError(f"a condition has at most {LONGEST:,} characters, got {len(text):,}; use several monitors")
        self.text = text
        self.at = 0
        self.depth = 0

    def wrong(self, at: int, sentence: str) -> NoReturn:
        """Refuse the text, with the line and the column of a place."""
        before = self.text[:at]
        line, column = before.count("\n") + 1, at - before.rfind("\n")
        raise UsageError(f"line {line}, column {column}: {sentence}")

    def next(self) -> Token:
        """Return what comes next without taking it."""
        at = self.at
        while at < len(self.text):
            found = _TOKEN.match(self.text, at)
            if found is None:
                self.wrong(at, f"{self.text[at]!r} is no part of the language; docs/howto/monitors.md describes it")
            if found.lastgroup != "space":
                return Token(str(found.lastgroup), found.group(), at)
            at = found.end()
        return Token("end", "the end", at)

    def take(self) -> Token:
        """Take what comes next."""
        found = self.next()
        self.at = found.at + (0 if found.kind == "end" else len(found.text))
        return found

    def is_next(self, *texts: str) -> bool:
        """Return whether one of these signs or words comes next."""
        found = self.next()
        return found.kind in ("sign", "word") and found.text in texts

    def need(self, sign: str, where: str) -> None:
        """Take a sign, which must come next."""
        found = self.take()
        if found.kind != "sign" or found.text != sign:
            self.wrong(found.at, f'"{sign}" is expected {where}, got {shown(found)}')

    def unquoted(self, token: Token) -> str:
        """Return what stands in quotes."""
        try:
            return str(json.loads(token.text))
        except ValueError:
            self.wrong(token.at, f'{shown(token)} has a "\\" that means nothing; write "\\\\" for the character itself')

    def end(self) -> None:
        """Refuse what is left."""
        found = self.next()
        if found.kind != "end":
            self.wrong(found.at, f"nothing more is expected, got {shown(found)}; take it out, or join formulas with &")

    def nested(self, read: Callable[[], T]) -> T:
        """Read what stands in brackets."""
        self.depth += 1
        if self.depth > MOST_NESTED:
            self.wrong(self.at, f"more than {MOST_NESTED} brackets are nested; use several monitors")
        found = read()
        self.depth -= 1
        return found

    def chain(self, sign: str, read: Callable[[], T], join: Callable[[T, T], T]) -> T:
        """Read one or several parts that a sign joins."""
        found, count = read(), 1
        while self.is_next(sign):
            at = self.take().at
            count += 1
            if count > _MOST_IN_A_CHAIN:
                self.wrong(at, f'"{sign}" joins at most {_MOST_IN_A_CHAIN} parts; use several monitors')
            found = join(found, read())
        return found


def shown(token: Token) -> str:
    """Return a token for a message."""
    return token.text if token.kind == "end" else f'"{token.text:.40}"'
