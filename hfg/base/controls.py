"""Control characters: a terminal obeys them, and marks of direction reverse the text after them (L4).

Names cannot contain any. Values can, so everything written to a terminal goes through `escaped`, and words of other
programs go through `cleaned` where they are decoded. No dependencies on other modules.
"""

from __future__ import annotations

import re
from typing import Any, Final, TypeVar, cast

import msgspec

_CONTROLS: Final = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff\ud800-\udfff\U000e0000-\U000e007f]"
)


def escaped(text: str) -> str:
    r"""Return a text with control characters escaped, except line ends and tabs.

    Examples:
      >>> escaped("a\x1b[2Jb") == "a\\x1b[2Jb"
      True
    """
    return text if text.isascii() and text.isprintable() else _CONTROLS.sub(_written, text)


def _written(found: re.Match[str]) -> str:
    """Return the escape of a character, in a form that JSON accepts where the text may be JSON."""
    number = ord(found.group())
    if number < 0x20:
        return f"\\x{number:02x}"  # JSON text does not contain them
    if number < 0x10000:
        return f"\\u{number:04x}"
    high, low = divmod(number - 0x10000, 0x400)
    return f"\\u{0xD800 + high:04x}\\u{0xDC00 + low:04x}"


_T = TypeVar("_T")


def cleaned(said: _T) -> _T:
    """Return what another program says for people to read, with what would steer a terminal written out in its texts.

    Apply it where such words are decoded: programs log them, and raise errors that contain them.

    Args:
      said: a text, a struct, or a list, tuple or mapping of these; anything else is returned as it is.
    """
    found: Any = said
    if isinstance(found, str):
        found = escaped(found)
    elif isinstance(found, msgspec.Struct):
        fields = {name: cleaned(getattr(found, name)) for name in found.__struct_fields__}
        found = msgspec.structs.replace(found, **fields)
    elif type(found) in (list, tuple):
        found = type(found)(map(cleaned, found))
    elif type(found) is dict:
        found = {cleaned(key): cleaned(value) for key, value in found.items()}
    return cast(_T, found)


def name_problem(name: str) -> str | None:
    """Return why a text is not a valid name, or None if it is valid."""
    if not (_CONTROLS.search(name) or "\n" in name or "\t" in name):
        return None
    clean = " ".join(escaped(name).split())
    return f'cannot be named "{clean}": a name is one line without control characters; remove them'


def is_terminal(stream: Any) -> bool:
    """Return whether a stream goes to a terminal."""
    try:
        return stream is not None and bool(stream.isatty())
    except (ValueError, AttributeError):  # it is closed, or not a stream
        return False
