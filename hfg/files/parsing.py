"""Reads YAML into plain data that knows its lines, within limits; refuses what a graph file has no use for.

Every mapping, list and scalar becomes a `Located`. Tags, which could name Python objects, second documents, keys that
come twice and aliases that explode are findings. The words are those of YAML 1.2: `no` and `on` are texts, 010 is ten.
Depends on PyYAML, but only on its events.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Any, Final

import yaml
from yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)

MOST: Final = 2_000_000  # values, those that aliases repeat counted again
DEEPEST: Final = 200

_INT: Final = re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+")
_FLOAT: Final = re.compile(r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?")
_WORDS: Final[dict[str, Any]] = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL")),
    **dict.fromkeys(("true", "True", "TRUE"), True),
    **dict.fromkeys(("false", "False", "FALSE"), False),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
    **dict.fromkeys((".inf", ".Inf", ".INF", "+.inf", "+.Inf", "+.INF"), float("inf")),
    **dict.fromkeys(("-.inf", "-.Inf", "-.INF"), float("-inf")),
}
_TOO_LONG: Final = 4300  # digits that Python reads of a number
_Parser: Any = getattr(yaml, "CSafeLoader", None)  # of libyaml, where that is there


class Located:
    """A value of a file and where it stands.

    Attributes:
      value: a scalar, a list of `Located`, or a dict of them by key.
      line: from 1; of what a key holds, the line of the key.
      size: how many values it is in all.
    """

    __slots__ = ("line", "size", "value")

    def __init__(self, value: Any, line: int) -> None:
        self.value = value
        self.line = line
        self.size = 1


Report = Callable[[int, str], None]
"""Takes a line and a sentence."""


class _Stop(Exception):
    """Nothing behind this can be read."""


def parse(text: str, report: Report) -> Located | None:
    """Read a text; what is wrong is reported with its line.

    Args:
      text: of a file.
      report: is given every finding.

    Returns:
      What could be read; None if nothing could.
    """
    try:
        return _Composing(report).compose(_events(text))
    except _Stop:
        return None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        what = ", ".join(str(part) for part in (error.context, error.problem) if part)
        report(mark.line + 1 if mark else 1, f"this is no YAML: {what}; correct this line or the one before it")
    except yaml.reader.ReaderError as error:
        read = text[: error.position] if isinstance(error.position, int) else ""
        report(read.count("\n") + 1, f"this is no text: {error.reason}; a graph file is text in UTF-8")
    except yaml.YAMLError as error:
        report(1, f"this is no YAML: {error}; write it as docs/howto/files.md shows")
    return None


def plain(located: Located) -> Any:
    """Return the value without its lines."""
    value = located.value
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    return [plain(one) for one in value] if isinstance(value, list) else value


def _events(text: str) -> Iterator[Any]:
    parser = (_Parser or yaml.SafeLoader)(text)
    while (event := parser.get_event()) is not None:
        yield event


class _Composing:
    """Puts events together, without recursion."""

    def __init__(self, report: Report) -> None:
        self.report = report
        self.anchors: dict[str, Located] = {}
        self.open: list[tuple[Located, str | None]] = []  # what is not closed yet, and its anchor
        self.keys: list[tuple[Any, int] | None] = []  # of each open mapping the key that waits for its value
        self.count = 0
        self.root: Located | None = None

    def compose(self, events: Iterator[Any]) -> Located | None:
        documents = 0
        for event in events:
            kind = type(event)
            if kind is ScalarEvent:
                self.put(self.scalar(event), event.anchor)
            elif kind is MappingStartEvent or kind is SequenceStartEvent:
                self.begin(event, {} if kind is MappingStartEvent else [])
            elif kind is MappingEndEvent or kind is SequenceEndEvent:
                self.end()
            elif kind is AliasEvent:
                self.alias(event)
            elif kind is DocumentStartEvent:
                documents += 1
                if documents > 1:
                    line = event.start_mark.line + 1
                    self.stop(line, "a second document begins here; a graph file is one, put the other in its own file")
        return self.root

    def stop(self, line: int, sentence: str) -> None:
        self.report(line, sentence)
        raise _Stop

    def begin(self, event: Any, empty: Any) -> None:
        line = event.start_mark.line + 1
        self.refuse_tag(event, line)
        if len(self.open) >= DEEPEST:
            self.stop(line, f"this lies deeper than {DEEPEST} levels; give subgraphs files of their own")
        self.open.append((Located(empty, line), event.anchor))
        self.keys.append(None)

    def end(self) -> None:
        done, anchor = self.open.pop()
        self.keys.pop()
        self.put(done, anchor)

    def alias(self, event: Any) -> None:
        line = event.start_mark.line + 1
        meant = self.anchors.get(event.anchor)
        if meant is None:
            self.stop(line, f'there is no "&{event.anchor}" before this "*{event.anchor}"; write the value out')
            return
        copy = Located(meant.value, line)
        copy.size = meant.size
        self.put(copy, None)

    def put(self, value: Located, anchor: str | None) -> None:
        """A value is complete: it goes where it belongs."""
        if anchor is not None:
            self.anchors[anchor] = value
        if not self.open:
            self.root = value
            return
        around = self.open[-1][0]
        key = self.keys[-1]
        if isinstance(around.value, list):
            around.value.append(value)
        elif key is None:
            self.keys[-1] = (self.key(value, around), value.line)
            return
        else:
            self.keys[-1] = None
            if key[0] is not None:
                value.line = key[1]
                around.value[key[0]] = value
        around.size += value.size
        if around.size > MOST:
            self.stop(value.line, f"this is more than {MOST:,} values, aliases counted; write fewer of them")

    def key(self, found: Located, around: Located) -> str | None:
        name = found.value
        if isinstance(name, dict | list):
            self.report(found.line, "a key is a name, not a list or mapping; quote it if it is meant as a text")
            return None
        if not isinstance(name, str):
            name = "null" if name is None else str(name).lower() if isinstance(name, bool) else str(name)
            self.report(found.line, f'a key is a text, got {name}; write "{name}" in quotes')
            return None
        if name in around.value:
            self.report(
                found.line,
                f'"{name}" is here twice, already in line {around.value[name].line}; take one out, or rename it',
            )
            return None
        return name

    def scalar(self, event: Any) -> Located:
        line = event.start_mark.line + 1
        self.refuse_tag(event, line)
        text: str = event.value
        if not event.implicit[0]:
            return Located(text, line)
        if text in _WORDS:
            return Located(_WORDS[text], line)
        if text[0] in "0123456789+-.":
            if _INT.fullmatch(text):
                if len(text) > _TOO_LONG:
                    self.stop(line, f"this number has {len(text)} digits; none has more than {_TOO_LONG}")
                return Located(int(text, 0 if text[:2] in ("0x", "0o") else 10), line)
            if _FLOAT.fullmatch(text):
                return Located(float(text), line)
        return Located(text, line)

    def refuse_tag(self, event: Any, line: int) -> None:
        if event.tag is not None and event.tag != "!":
            self.report(line, f'"{event.tag}" is a tag, and a graph file holds plain data alone; leave the tag out')
