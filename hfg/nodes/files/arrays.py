"""Whether a file of numpy holds what it says, before memory is spent on it: .npy and .npz (rule L4).

A header of a hundred bytes may say that a terabyte follows, and a .npz may unpack to any size. Depends on bounds.
"""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np

from hfg.base.bounds import FILE_BYTES


def need_fair_arrays(path: Path, *, is_zip: bool, whole: bool) -> None:
    """Refuse a file whose arrays are not there, or are more than may be read.

    Args:
      path: path of the file.
      is_zip: it is a .npz.
      whole: all of it will be in memory at once.

    Raises:
      ValueError: it is refused.
    """
    if not is_zip:
        with path.open("rb") as file:
            size = _bytes_of_array(file)
            there = path.stat().st_size - file.tell()
        _need_fair(size, there, FILE_BYTES.most if whole else there)
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
                    size = _bytes_of_array(part)
                    there = member.file_size - part.tell()
            _need_fair(size, there, left)
            left -= size


def _bytes_of_array(file: IO[bytes]) -> int:
    """Read the head of an array, and give how many bytes it says that follow."""
    version: Any = np.lib.format.read_magic(file)
    if version not in ((1, 0), (2, 0), (3, 0)):
        raise ValueError(f"version {version} of the format is not known")
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(file)
    if dtype.hasobject:
        raise ValueError("it holds Python objects")
    return math.prod(shape) * dtype.itemsize


def _need_fair(size: int, there: int, most: int) -> None:
    if not 0 <= size <= there:
        raise ValueError(f"its head says that {size:,} bytes follow, and {there:,} do")
    if size > most:
        raise ValueError(f"its arrays have {size:,} bytes or more, {FILE_BYTES.remedy}")
