"""Pixels as PNG, reduced if they are large. It needs no image library, so every report can have pictures.

Depends on numpy and the standard library.
"""

from __future__ import annotations

import struct
import zlib
from typing import Any, Final

import numpy as np
import numpy.typing as npt

Pixels = npt.NDArray[Any]

_LEAST: Final = 8  # pixels in either direction; a smaller array is a table of numbers
_KINDS: Final = {1: 0, 2: 4, 3: 2, 4: 6}  # PNG's colour types, by channels


def is_picture(value: object) -> bool:
    """Return whether a value looks like an 8-bit image."""
    return (
        isinstance(value, np.ndarray)
        and value.dtype == np.uint8
        and value.ndim in (2, 3)
        and min(value.shape[:2]) >= _LEAST
        and (value.ndim == 2 or value.shape[2] in (1, 3, 4))
    )


def smaller(image: Pixels, longest: int) -> Pixels:
    """Return a copy whose longer side is at most `longest`; each of its pixels is the mean of a square of pixels."""
    step = -(-max(image.shape[:2]) // longest)
    if step == 1:
        return image.copy()
    height, width = (max(side // step, 1) for side in image.shape[:2])
    cut = image[: height * step, : width * step]
    if cut.shape[0] < height * step or cut.shape[1] < width * step:  # thinner than a square
        return image[::step, ::step].copy()
    squares = cut.reshape(height, step, width, step, -1)
    mean = squares.mean(axis=(1, 3), dtype=np.float32)
    found: Pixels = np.rint(mean).astype(np.uint8).reshape(height, width, *image.shape[2:])
    return found


def png(image: Pixels) -> bytes:
    """Encode an 8-bit image; colours are in the order blue, green, red, as everywhere in hfg."""
    channels = 1 if image.ndim == 2 else image.shape[2]
    if channels >= 3:
        image = image[..., [2, 1, 0, 3][:channels]]
    height, width = image.shape[:2]
    rows = np.ascontiguousarray(image).reshape(height, width * channels)
    # Each row is stored as its difference to the one above, which is small in pictures: PNG's filter 2.
    lines = np.empty((height, width * channels + 1), np.uint8)
    lines[:, 0] = 2
    lines[0, 1:] = rows[0]
    lines[1:, 1:] = rows[1:] - rows[:-1]
    header = struct.pack(">IIBBBBB", width, height, 8, _KINDS[channels], 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(lines.tobytes(), 6)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in parts
    )
