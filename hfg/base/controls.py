"""Characters that steer whoever shows a text: a terminal obeys them, and marks of direction turn letters round (L4).

Names have none of them. Values may, so whatever goes to a terminal goes through `escaped`. Stands on nothing.
"""

from __future__ import annotations

import re
from typing import Any, Final

__all__ = ["escaped", "is_terminal", "name_problem"]

_CONTROLS: Final = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff\ud800-\udfff\U000e0000-\U000e007f]"
)


def escaped(text: str) -> str:
    r"""Write out what would steer a terminal; ends of lines and tabs stay.

    Examples:
      >>> escaped("a\x1b[2Jb") == "a\\x1b[2Jb"
      True
    """
    return text if text.isascii() and text.isprintable() else _CONTROLS.sub(_written, text)


def _written(found: re.Match[str]) -> str:
    """In a form that JSON reads back, too, where it may stand in its texts."""
    number = ord(found.group())
    if number < 0x20:
        return f"\\x{number:02x}"  # JSON has none of them
    if number < 0x10000:
        return f"\\u{number:04x}"
    high, low = divmod(number - 0x10000, 0x400)
    return f"\\u{0xD800 + high:04x}\\u{0xDC00 + low:04x}"


def name_problem(name: str) -> str | None:
    """Say why a text is no name that people could be shown; None if it is one."""
    if not (_CONTROLS.search(name) or "\n" in name or "\t" in name):
        return None
    clean = " ".join(escaped(name).split())
    return f'cannot be named "{clean}": a name is one line without characters that steer a terminal; leave them out'


def is_terminal(stream: Any) -> bool:
    """Whether a stream goes to a terminal."""
    try:
        return stream is not None and bool(stream.isatty())
    except (ValueError, AttributeError):  # it is closed, or no stream
        return False
