"""Makes room around arrays: OpenCV's vector instructions read some bytes before and after them.

In ordinary memory something is there. At the ends of a mapping, as of shared memory or of a file, is nothing, and a
read there ends the process. Knows no functions of OpenCV.
"""

from __future__ import annotations

import mmap
from typing import Any, Final

import numpy as np
from numpy.lib.array_utils import byte_bounds

_BEFORE: Final = 16
"""Bytes; what the C library itself keeps before each block of memory."""
_BEHIND: Final = 64


def with_room(array: Any) -> Any:
    """Return an array around which some bytes can be read: itself, or a copy if it may be at the end of a mapping."""
    return array if _has_room(array) else copy_with_room(array)


def copy_with_room(array: Any, rows: int = 0) -> Any:
    """Copy an array to memory with some bytes, and `rows` rows, around it."""
    beside = _BEHIND + (rows and rows * array[0].size)
    room = np.zeros(array.size + 2 * beside, array.dtype)
    room[beside : beside + array.size] = array.reshape(-1)
    return room[beside : beside + array.size].reshape(array.shape)


def _has_room(array: Any) -> bool:
    first, end = _bounds(array)
    if first % mmap.PAGESIZE >= _BEFORE and -end % mmap.PAGESIZE >= _BEHIND:  # within its first and its last page
        return True
    owner = array
    while isinstance(owner, np.ndarray):
        owner = owner.base
    if isinstance(owner, memoryview):
        owner = owner.obj
    if not isinstance(owner, mmap.mmap):
        return False
    mapped, mapped_end = _bounds(np.frombuffer(owner, np.uint8))
    return first >= mapped + _BEFORE and end + _BEHIND <= mapped_end


def _bounds(array: Any) -> tuple[int, int]:
    if not array.flags.c_contiguous:
        return byte_bounds(array)
    first: int = array.__array_interface__["data"][0]
    return first, first + array.nbytes
