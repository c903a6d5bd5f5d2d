"""Reads the size of a picture from the first bytes of its file, to decide whether to decode it (rule L4).

OpenCV allocates as much as a header asks for: a file of 124 kB can ask for gigabytes. OpenCV's own limit is eight times
ours and cannot be set for hfg only. So the size is read first. In formats that OpenCV supports, a header without a size
is refused, and if a file could have several sizes, the largest counts. Depends on bounds, not on OpenCV.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from typing import Final, NamedTuple

from hfg.base.bounds import PICTURE_PIXELS

_Size = tuple[int, int]
_TEXT: Final = 8192  # bytes in which formats with a text header have it
_MOST_TAGS: Final = 4096
_NONE: Final = (0, 0)


def need_fair_size(data: bytes, what: str) -> None:
    """Refuse a picture that is too large to be decoded.

    Args:
      data: the complete file.
      what: what it is, for the message.

    Raises:
      ValueError: it has too many pixels, or its header does not state its size.
    """
    size = size_of(data)
    if size == _NONE:
        raise ValueError(f"{what} does not state its size: its header is damaged")
    problem = None if size is None else pixels_problem(*size)
    if problem is not None:
        raise ValueError(f"{what} {problem}")


def pixels_problem(width: int, height: int) -> str | None:
    """Return the second half of a message about a picture that is too large; None if it is not."""
    if width * height <= PICTURE_PIXELS.most:
        return None
    return f"has {width:,} x {height:,} pixels, {PICTURE_PIXELS.remedy}"


def size_of(data: bytes) -> _Size | None:
    """Return width and height from the header; zeros if it is damaged, None if the format is unknown."""
    for kind in _KINDS:
        if kind.begins.match(data):
            try:
                size = kind.size(data)
            except (struct.error, ValueError, KeyError):
                return _NONE
            return size if all(size) else _NONE
    return None


def _fixed(form: str, at: int) -> Callable[[bytes], _Size]:
    """Read two numbers at a fixed offset."""

    def size(data: bytes) -> _Size:
        width, height = struct.unpack_from(form, data, at)
        return abs(width), abs(height)

    return size


def _written(width: bytes, height: bytes) -> Callable[[bytes], _Size]:
    """Return the largest numbers in a text header."""

    def size(data: bytes) -> _Size:
        text = data[:_TEXT]
        return max(map(int, re.findall(width, text))), max(map(int, re.findall(height, text)))

    return size


def _largest(pattern: bytes, form: str, further: int, size: Callable[..., _Size]) -> Callable[[bytes], _Size]:
    """Return the largest of the sizes after a marker. A marker inside other data may mislead, which does no harm."""

    def largest(data: bytes) -> _Size:
        length = struct.calcsize(form)
        places = (found.end() + further for found in re.finditer(pattern, data, re.DOTALL))
        sizes = [size(*struct.unpack_from(form, data, at)) for at in places if at + length <= len(data)]
        return max(sizes, key=lambda one: one[0] * one[1])

    return largest


def _bitmap(data: bytes) -> _Size:
    (length,) = struct.unpack_from("<I", data, 14)
    return _fixed("<HH" if length == 12 else "<ii", 18)(data)


def _jpeg(data: bytes) -> _Size:
    at = 2
    while True:
        marker, kind, length = struct.unpack_from(">BBH", data, at)
        if marker != 0xFF:
            raise ValueError
        if kind == 0xFF:  # padding
            at += 1
        elif 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        else:
            at += 2 + (0 if 0xD0 <= kind <= 0xD9 or kind == 0x01 else length)


def _webp(data: bytes) -> _Size:
    kind = data[12:16]
    if kind == b"VP8 ":
        width, height = struct.unpack_from("<HH", data, 26)
        return width & 0x3FFF, height & 0x3FFF
    if kind == b"VP8L":
        (bits,) = struct.unpack_from("<I", data, 21)
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    low, high, low_too, high_too = struct.unpack_from("<HBHB", data, 24)
    return (high << 16 | low) + 1, (high_too << 16 | low_too) + 1


def _tiff(data: bytes) -> _Size:
    """Read the first directory, the one that is decoded: tags 256 and 257, of TIFF or BigTIFF."""
    order = "<" if data[:2] == b"II" else ">"
    big = struct.unpack_from(f"{order}H", data, 2)[0] == 43
    where, count, entry = ("Q", "Q", 20) if big else ("I", "H", 12)
    (at,) = struct.unpack_from(order + where, data, 8 if big else 4)
    (tags,) = struct.unpack_from(order + count, data, at)
    at += struct.calcsize(order + count)
    found = {}
    for number in range(min(tags, _MOST_TAGS)):
        begin = at + number * entry
        tag, kind = struct.unpack_from(f"{order}HH", data, begin)
        if tag in (256, 257):
            form = {1: "B", 3: "H", 4: "I", 6: "B", 8: "H", 9: "I", 16: "Q"}[kind]
            (found[tag],) = struct.unpack_from(order + form, data, begin + entry - (8 if big else 4))
    return found.get(256, 0), found.get(257, 0)


def _of_corners(left: int, top: int, right: int, bottom: int) -> _Size:
    return abs(right - left) + 1, abs(bottom - top) + 1


def _of_grid(right: int, bottom: int, left: int, top: int) -> _Size:
    return max(right - left, 0), max(bottom - top, 0)


def _portable(data: bytes) -> _Size:
    blank = rb"(?:\s|#[^\n]*\n)+"
    found = re.match(rb"P." + blank + rb"(\d+)" + blank + rb"(\d+)", data[:_TEXT])
    return (int(found[1]), int(found[2])) if found else _NONE


class _Kind(NamedTuple):
    begins: re.Pattern[bytes]
    size: Callable[[bytes], _Size]


_KINDS: Final = tuple(
    _Kind(re.compile(begins, re.DOTALL), size)
    for begins, size in (
        (rb"\x89PNG\r\n\x1a\n", _fixed(">II", 16)),
        (rb"\xff\xd8", _jpeg),
        (rb"GIF8[79]a", _fixed("<HH", 6)),
        (rb"BM", _bitmap),
        (rb"RIFF.{4}WEBP", _webp),
        (rb"II[\x2a\x2b]\0|MM\0[\x2a\x2b]", _tiff),
        (rb"\x76\x2f\x31\x01", _largest(rb"dataWindow\0box2i\0.{4}", "<iiii", 0, _of_corners)),
        (rb"\xff\x4f\xff\x51|\0\0\0\x0cjP", _largest(rb"\xff\x4f\xff\x51", ">IIII", 4, _of_grid)),
        (rb".{4}ftypavi[fs]", _largest(rb"ispe.{4}", ">II", 0, lambda width, height: (width, height))),
        (rb"\x59\xa6\x6a\x95", _fixed(">II", 4)),
        (rb"#\?(?:RGBE|RADIANCE)", _written(rb"[-+]X +(\d+)", rb"[-+]Y +(\d+)")),
        (rb"P7", _written(rb"WIDTH\s+(\d+)", rb"HEIGHT\s+(\d+)")),
        (rb"P[1-6Ff]", _portable),
    )
)
