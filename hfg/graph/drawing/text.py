"""Texts in drawings: how wide they are, how they are shortened, and that none of them breaks what is around it.

The widths of the reader's font are not known when a drawing is made, so they are roughly those of Inter; Arial,
Helvetica and Liberation Sans are narrower. `textLength` keeps characters in place that are in no table; see `svg`.
"""

from __future__ import annotations

import unicodedata
from typing import Final

FONTS: Final = "Inter, 'Helvetica Neue', Arial, 'Liberation Sans', system-ui, sans-serif"

_BOLD: Final = 1.08  # by how much a bold text is wider
_VERDANA: Final = 0.9  # the table is one of Verdana
_WIDTHS: Final = {
    character: _VERDANA * width / 1000
    for width, characters in {
        280: "'",
        320: " ,.IJijl",
        360: "-/:;\\f|",
        410: "!()[]rt",
        460: '"',
        520: "*_`sz",
        560: "?Lc",
        620: "FPTYaekovxy",
        645: "$0123456789EKSbdghnpqu{}",
        700: "ABCRVXZ",
        770: "DGHNU",
        820: "&OQw",
        845: "#+<=>M^~→⊥",
        970: "%m…",
        1000: "@W",
    }.items()
    for character in characters
}


def width_of(text: str, size: float, *, bold: bool = False) -> float:
    """Return the width of a line of text in pixels, rather too much than too little."""
    width = sum(_WIDTHS.get(character) or _unknown(character) for character in text)
    return width * size * (_BOLD if bold else 1.0)


def _unknown(character: str) -> float:
    if unicodedata.combining(character) or unicodedata.category(character) in ("Mn", "Me", "Cf"):
        return 0.0
    return 1.05 if unicodedata.east_asian_width(character) in ("W", "F") else 0.85


def is_measured(text: str) -> bool:
    """Whether the width of each of its characters is known."""
    return all(character in _WIDTHS for character in text)


def shortened(text: str, longest: int) -> str:
    """Return it on one line, with dots in its middle if it is longer; names differ at their ends at least as often."""
    line = " ".join(_visible(text).split())
    if len(line) <= longest:
        return line
    head = (longest - 1) * 2 // 3
    return f"{line[:head]}…{line[len(line) - (longest - 1 - head) :]}"


# Markup, and the three of ASCII that end a line or attribute.
_MARKUP: Final = {ord("&"): "&amp;", ord("<"): "&lt;", ord(">"): "&gt;", ord('"'): "&quot;", ord("'"): "&#39;"}


def escaped(text: str) -> str:
    """Return a text as XML takes it, between tags or between quotes; what XML cannot hold becomes a replacement."""
    return _visible(text).translate(_MARKUP)


def _visible(text: str) -> str:
    return text if text.isascii() and text.isprintable() else "".join(map(_as_seen, text))


def _as_seen(character: str) -> str:
    """Replace controls, characters that XML 1.0 forbids, and marks of direction, which would reverse later text."""
    if character in "\n\t":
        return character
    category = unicodedata.category(character)
    if category in ("Cc", "Cs") or (ord(character) & 0xFFFE) == 0xFFFE or character in _DIRECTIONS:
        return "\ufffd"
    return character


_DIRECTIONS: Final = frozenset("\u200e\u200f\u061c\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
