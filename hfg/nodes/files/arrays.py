"""Whether a file of numpy holds what it says, before memory is spent on it: .npy and .npz; rows of a .npy (rule L4).

A header of a hundred bytes may say that a terabyte follows, and a .npz may unpack to any size. Depends on bounds.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from hfg.base.bounds import FILE_BYTES
from hfg.encoding.arrays import unsafe_content


def need_fair_arrays(path: Path, *, is_zip: bool) -> None:
    """Refuse a file whose arrays are not there, or are more than may be read.

    Args:
      path: path of the file.
      is_zip: it is a .npz.

    Raises:
      ValueError: it is refused.
    """
    if not is_zip:
        with path.open("rb") as file:
            size = _size(*_head(file))
            there = path.stat().st_size - file.tell()
        _need_fair(size, there, FILE_BYTES.most)
        return
    left = FILE_BYTES.most
    with zipfile.ZipFile(path) as archive:
        for member in archive.infolist():
            with archive.open(member) as part:
                begin = part.read(6)
            if begin != np.lib.format.MAGIC_PREFIX:
                size = there = member.file_size
            else:
                with archive.open(member) as part:
                    size = _size(*_head(part))
                    there = member.file_size - part.tell()
            _need_fair(size, there, left)
            left -= size


def _head(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Read the head of an array: its shape, whether its first axis is the nearest in the file, and its dtype."""
    version: Any = np.lib.format.read_magic(file)
    if version not in ((1, 0), (2, 0), (3, 0)):
        raise ValueError(f"version {version} of the format is not known")
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, is_reversed, dtype = read(file)
    if dtype.hasobject:
        raise ValueError("it holds Python objects")
    return shape, is_reversed, dtype


def _size(shape: tuple[int, ...], _is_reversed: bool, dtype: np.dtype[Any]) -> int:
    return math.prod(shape) * dtype.itemsize


def read_rows(path: Path) -> Iterator[np.ndarray[Any, Any]] | None:
    """Return the parts of an array along its first axis; None if they do not lie one after the other in the file.

    The file is read, not mapped: if another user cuts it meanwhile, mapped memory kills the process.

    Raises:
      ValueError: it is not such a file, or holds one number only.
    """
    with path.open("rb") as file:
        shape, is_reversed, dtype = _head(file)
        begin = file.tell()
        there = path.stat().st_size - begin
    if not shape:
        raise ValueError("it has no rows because it holds one value")
    _need_fair(_size(shape, is_reversed, dtype), there, there)
    _need_fair(size := _size(shape[1:], is_reversed, dtype), size, FILE_BYTES.most)
    return None if is_reversed and len(shape) > 1 else _rows(path, begin, shape, dtype)


def _rows(path: Path, begin: int, shape: tuple[int, ...], dtype: np.dtype[Any]) -> Iterator[np.ndarray[Any, Any]]:
    size = _size(shape[1:], False, dtype)
    with path.open("rb") as file:
        file.seek(begin)
        for number in range(shape[0]):
            data = bytearray(size)
            if file.readinto(data) < size:
                raise ValueError(f'"{path}" was cut off meanwhile, before row {number}')
            yield sound(np.frombuffer(data, dtype, math.prod(shape[1:])).reshape(shape[1:]))


def sound(array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return an array whose bytes numpy takes for what they are.

    Raises:
      ValueError: it does not; numpy would write beyond its memory.
    """
    problem = unsafe_content(array)
    if problem is not None:
        raise ValueError(problem)
    return array


def _need_fair(size: int, there: int, most: int) -> None:
    if not 0 <= size <= there:
        raise ValueError(f"its head says that {size:,} bytes follow, and {there:,} do")
    if size > most:
        raise ValueError(f"its arrays have {size:,} bytes or more, {FILE_BYTES.remedy}")
