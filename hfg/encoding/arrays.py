"""Which arrays travel as raw bytes, and their description in a frame.

Only numbers, booleans, strings of fixed width and times qualify: their bytes mean the same on every machine, and do no
harm if an attacker chose them. Depends on numpy and msgspec.
"""

from __future__ import annotations

import functools
import math
import re
from typing import Any, Final

import msgspec
import numpy as np

_NUMBERS: Final = frozenset(
    ["b1"] + [f"{kind}{size}" for kind in "iu" for size in (1, 2, 4, 8)] + ["f2", "f4", "f8", "c8", "c16"]
)
"""Without long doubles, which differ from machine to machine."""
_TEXT: Final = re.compile(r"[<>|]([SU])([1-9][0-9]{0,4})")
_TIME: Final = re.compile(r"[<>|][mM]8(\[([1-9][0-9]{0,5})?(Y|M|W|D|h|m|s|ms|us|ns|ps|fs|as)\])?")
_MOST_AXES: Final = 32
_LONGEST_AXIS: Final = 2**40
_LAST_CHARACTER: Final = 0x10FFFF


class Lease(msgspec.Struct, array_like=True, frozen=True, forbid_unknown_fields=True):
    """The place of an array's bytes in shared memory.

    Attributes:
      segment: name of the segment.
      slot: number of the slot in it.
      generation: how often the slot had been reused; leases with an older number are invalid.
      offset: offset of the array in the slot.
    """

    segment: str
    slot: int
    generation: int
    offset: int = 0


class ArrayHead(msgspec.Struct, array_like=True, frozen=True, forbid_unknown_fields=True):
    """The description of one array in a frame.

    Attributes:
      dtype: as numpy writes it, "<f8".
      shape: length of each axis.
      lease: the place of its bytes; without a lease they are in the frame.
    """

    dtype: str
    shape: tuple[int, ...]
    lease: Lease | None = None


def array_problem(dtype: np.dtype[Any]) -> str | None:
    """Return why arrays of a dtype cannot travel, or None if they can."""
    return None if _is_safe(dtype.str) and dtype.fields is None and dtype.subdtype is None else f"{dtype} has no bytes"


@functools.lru_cache(maxsize=256)
def _is_safe(text: str) -> bool:
    if text[:1] in ("<", ">", "|", "=") and text[1:] in _NUMBERS:
        return True
    return _TEXT.fullmatch(text) is not None or _TIME.fullmatch(text) is not None


def dtype_of(text: str) -> np.dtype[Any]:
    """Return the dtype with the name in a frame.

    Raises:
      ValueError: it is not a dtype that can be sent.
    """
    if len(text) > 24 or not _is_safe(text):
        raise ValueError(f"an array of {text!r:.40} cannot be sent")
    return _dtype(text)


@functools.lru_cache(maxsize=256)
def _dtype(text: str) -> np.dtype[Any]:
    return np.dtype(text)


def bytes_of(head: ArrayHead, most: int) -> int:
    """Return the size of an array in bytes.

    Raises:
      ValueError: the shape is impossible, or the size is larger than `most`.
    """
    size = dtype_of(head.dtype).itemsize
    if len(head.shape) > _MOST_AXES or not all(0 <= axis <= _LONGEST_AXIS for axis in head.shape):
        raise ValueError(f"no array can have the shape {head.shape!r:.80}")
    size *= math.prod(head.shape)
    if size > most or math.prod(axis or 1 for axis in head.shape) > _LONGEST_AXIS:
        raise ValueError(f"an array of the shape {head.shape!r:.80} is larger than the {most} bytes that can be here")
    return size


def view_of(head: ArrayHead, buffer: Any, offset: int) -> np.ndarray[Any, Any]:
    """Return a read-only view of the array in a buffer.

    Raises:
      ValueError: the bytes are not valid for this dtype.
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
    """Return which bytes numpy must not see: it counts booleans by adding them up, and does not check characters."""
    if array.dtype.names is not None:
        return next(
            filter(None, (unsafe_content(np.ascontiguousarray(array[name])) for name in array.dtype.names)), None
        )
    kind = array.dtype.kind
    if kind == "b" and array.size and array.view(np.uint8).max() > 1:
        return "an array of booleans holds values other than 0 and 1"
    if kind == "U" and array.size:
        characters = array.reshape(-1).view(array.dtype.byteorder + "u4")
        if characters.max() > _LAST_CHARACTER:
            return "an array of strings holds an invalid character"
    return None
