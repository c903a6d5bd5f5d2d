"""Writes plain data as YAML, one thing a line, so that a diff shows what changed.

The same data gives the same text. Numbers in a list stay on one line, a text of several lines is one block. What the
reader, or a reader of YAML 1.1, might take for something else is quoted. Knows nothing of graphs.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

_WIDTH: Final = 100  # of a list on one line
_UNSEEN: Final = r"\x7f-\x9f\ud800-\udfff\ufeff\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069"
_PLAIN: Final = re.compile(rf"[A-Za-z_/.\u00c0-\u024f](?:[^\x00-\x1f{_UNSEEN}#:\\]|:(?=[^\s]))*")
_WORDS: Final = re.compile(r"(?i:y|n|yes|no|on|off|true|false|null|none|nan|inf|\.nan|[-+]?\.inf|\.|\.\.\.|~)")
_NUMBER: Final = re.compile(r"[-+.]?[0-9].*|\.[0-9eE_].*")
_BLOCK: Final = re.compile(rf"[^\x00-\x08\x0b-\x1f\t{_UNSEEN}]*")
_UNPRINTED: Final = re.compile(f"[{_UNSEEN}]")


def emit(data: Mapping[str, Any]) -> str:
    """Write a mapping as a YAML text.

    Raises:
      TypeError: something in it is not plain data.
    """
    return "".join(f"{line}\n" for line in _mapping(data, ""))


def _mapping(data: Mapping[Any, Any], indent: str) -> Iterator[str]:
    for key, value in data.items():
        yield from _entry(f"{indent}{_key(key)}:", value, indent)


def _key(key: object) -> str:
    """A key; what is longer than YAML allows on one line is for the caller not to say."""
    return _text(key) if isinstance(key, str) else _scalar(key)


def _entry(head: str, value: object, indent: str) -> Iterator[str]:
    """An entry that begins with `head`, a key or a dash, and holds a value."""
    if isinstance(value, Mapping) and value:
        yield head
        yield from _mapping(value, f"{indent}  ")
    elif isinstance(value, str) and _is_block(value):
        yield from _block(head, value, indent)
    elif isinstance(value, list | tuple) and value:
        line = _flow(value)
        if line is not None:
            yield f"{head} {line}"
        else:
            yield head
            for one in value:
                yield from _item(one, f"{indent}  ")
    else:
        yield f"{head} {_scalar(value)}"


def _item(value: object, indent: str) -> Iterator[str]:
    """An element of a list, over several lines if necessary."""
    if isinstance(value, Mapping) and value:
        lines = _mapping(value, f"{indent}  ")
        yield f"{indent}- {next(lines)[len(indent) + 2 :]}"
        yield from lines
    elif isinstance(value, list | tuple) and value and _flow(value) is None:
        lines = (line for one in value for line in _item(one, f"{indent}  "))
        yield f"{indent}- {next(lines)[len(indent) + 2 :]}"
        yield from lines
    else:
        yield from _entry(f"{indent}-", value, indent)


def _flow(values: Sequence[object]) -> str | None:
    """Numbers on one line; None if other things are among them, or it is too long."""
    if not all(one is None or isinstance(one, int | float) for one in values):
        return None
    line = f"[{', '.join(_scalar(one) for one in values)}]"
    return line if len(line) <= _WIDTH else None


def _scalar(value: object) -> str:
    match value:
        case None:
            return "null"
        case bool():
            return "true" if value else "false"
        case str():
            return _text(value)
        case int():
            return str(value)
        case float():
            return _float(value)
        case list() | tuple():
            return "[]"
        case Mapping():
            return "{}"
    raise TypeError(f"{value!r:.80} is no plain data")


def _float(value: float) -> str:
    if math.isfinite(value):
        digits, e, exponent = repr(value).partition("e")
        return digits + (".0" if e and "." not in digits else "") + e + exponent  # YAML 1.1 wants the point
    return ".nan" if value != value else ".inf" if value > 0 else "-.inf"


def _text(text: str) -> str:
    if _PLAIN.fullmatch(text) and not text.endswith((" ", ":")) and not _looks_otherwise(text):
        return text
    return _UNPRINTED.sub(lambda found: f"\\u{ord(found.group()):04x}", json.dumps(text, ensure_ascii=False))


def _looks_otherwise(text: str) -> bool:
    """Return whether some reader takes it for a number, a truth value or the end of a document."""
    return bool(_WORDS.fullmatch(text) or _NUMBER.fullmatch(text)) or text.startswith("...")


def _is_block(text: str) -> bool:
    """Return whether a text of several lines can stand as it is, below its key."""
    if "\n" not in text or text[0] in " \n" or not _BLOCK.fullmatch(text):
        return False
    lines = text.split("\n")
    return not any(line.endswith(" ") for line in lines) and any(lines)


def _block(head: str, text: str, indent: str) -> Iterator[str]:
    body = text.removesuffix("\n")
    chomping = "-" if body == text else "+" if body.endswith("\n") else ""
    yield f"{head} |{chomping}"
    for line in body.split("\n"):
        yield f"{indent}  {line}" if line else ""
