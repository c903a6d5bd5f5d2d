"""Which arrays travel as raw bytes, and what is said of one beside them.

Only numbers, truth values, texts of fixed width and times have bytes that mean the same elsewhere and can do no harm
when a stranger has chosen them. Stands on numpy and msgspec.
"""

from __future__ import annotations

import functools
import math
import re
from typing import Any, Final

import msgspec
import numpy as np

__all__ = ["ArrayHead", "Lease", "array_problem", "bytes_of", "dtype_of", "unsafe_content", "view_of"]

_NUMBERS: Final = frozenset(
    ["b1"] + [f"{kind}{size}" for kind in "iu" for size in (1, 2, 4, 8)] + ["f2", "f4", "f8", "c8", "c16"]
)
"""Not those of long doubles, which differ from machine to machine."""
_TEXT: Final = re.compile(r"[<>|]([SU])([1-9][0-9]{0,4})")
_TIME: Final = re.compile(r"[<>|][mM]8(\[([1-9][0-9]{0,5})?(Y|M|W|D|h|m|s|ms|us|ns|ps|fs|as)\])?")
_MOST_AXES: Final = 32
_LONGEST_AXIS: Final = 2**40
_LAST_CHARACTER: Final = 0x10FFFF


class Lease(msgspec.Struct, array_like=True, frozen=True, forbid_unknown_fields=True):
    """Where in shared memory the bytes of an array lie.

    Attributes:
      segment: name of the segment.
      slot: number of the slot in it.
      generation: how often the slot had been given away; what is older is gone.
      offset: where in the slot the array begins.
    """

    segment: str
    slot: int
    generation: int
    offset: int = 0


class ArrayHead(msgspec.Struct, array_like=True, frozen=True, forbid_unknown_fields=True):
    """What a frame says of one array.

    Attributes:
      dtype: as numpy writes it, "<f8".
      shape: length of each axis.
      lease: where its bytes are; without one they are in the frame.
    """

    dtype: str
    shape: tuple[int, ...]
    lease: Lease | None = None


def array_problem(dtype: np.dtype[Any]) -> str | None:
    """Say why arrays of a dtype cannot travel, or None if they can."""
    return None if _is_safe(dtype.str) and dtype.fields is None and dtype.subdtype is None else f"{dtype} has no bytes"


@functools.lru_cache(maxsize=256)
def _is_safe(text: str) -> bool:
    if text[:1] in ("<", ">", "|", "=") and text[1:] in _NUMBERS:
        return True
    return _TEXT.fullmatch(text) is not None or _TIME.fullmatch(text) is not None


def dtype_of(text: str) -> np.dtype[Any]:
    """Give the dtype that a frame names.

    Raises:
      ValueError: it is none that travels.
    """
    if len(text) > 24 or not _is_safe(text):
        raise ValueError(f"an array of {text!r:.40} is none that travels")
    return _dtype(text)


@functools.lru_cache(maxsize=256)
def _dtype(text: str) -> np.dtype[Any]:
    return np.dtype(text)


def bytes_of(head: ArrayHead, most: int) -> int:
    """Give how many bytes an array has.

    Raises:
      ValueError: it cannot be, or these are more than `most`.
    """
    size = dtype_of(head.dtype).itemsize
    if len(head.shape) > _MOST_AXES or not all(0 <= axis <= _LONGEST_AXIS for axis in head.shape):
        raise ValueError(f"no array has the shape {head.shape!r:.80}")
    size *= math.prod(head.shape)
    if size > most or math.prod(axis or 1 for axis in head.shape) > _LONGEST_AXIS:
        raise ValueError(f"an array of the shape {head.shape!r:.80} is larger than what can be here, {most} bytes")
    return size


def view_of(head: ArrayHead, buffer: Any, offset: int) -> np.ndarray[Any, Any]:
    """Give the array whose bytes lie in a buffer, read-only.

    Raises:
      ValueError: the bytes are none of an array of this dtype.
    """
    dtype = dtype_of(head.dtype)
    if 0 in head.shape:
        made: np.ndarray[Any, Any] = np.empty(head.shape, dtype)
    else:
        made = np.ndarray(head.shape, dtype, buffer, offset)
    made.flags.writeable = False
    problem = unsafe_content(made)
    if problem is not None:
        raise ValueError(problem)
    return made


def unsafe_content(array: np.ndarray[Any, Any]) -> str | None:
    """Say which bytes numpy must not see: it counts truth values by adding them up, and trusts its characters."""
    kind = array.dtype.kind
    if kind == "b" and array.size and array.view(np.uint8).max() > 1:
        return "an array of truth values holds others than 0 and 1"
    if kind == "U" and array.size:
        characters = array.reshape(-1).view(array.dtype.byteorder + "u4")
        if characters.max() > _LAST_CHARACTER:
            return "an array of texts holds what is no character"
    return None
