"""Access to files: errors in one message, and files that are replaced only as a whole.

Depends on `whole` and bounds.
"""

from __future__ import annotations

import errno
import glob
import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, AnyStr, BinaryIO, Final, Literal, TypeAlias

from hfg.base import whole
from hfg.base.bounds import FILE_BYTES

FilePath: TypeAlias = str | Path
"""Where a file is; relative paths start in the working directory of the program."""

_REASONS: Final = {
    errno.ENOENT: "there is no such file or directory",
    errno.EISDIR: "it is a directory; name a file in it",
    errno.ENOTDIR: "a part of the path is a file, no directory",
    errno.EACCES: "it is not permitted; change the permissions or the path",
    errno.EPERM: "it is not permitted; change the permissions or the path",
    errno.EROFS: "the file system may only be read",
    errno.EEXIST: "it is there already; allow to overwrite it, or change the path",
    errno.ENOSPC: "the disk is full; make room on it",
    errno.EDQUOT: "your part of the disk is full; make room on it",
    errno.EFBIG: "a file may not be as large there; raise the limit, or write less",
    errno.ENAMETOOLONG: "the name is too long",
    errno.EMFILE: "too many files are open",
}


def is_a_path(path: FilePath) -> bool:
    """Say whether a system could have a file of this name."""
    return "\0" not in os.fspath(path)


def named(path: FilePath) -> Path:
    """Return the path that a parameter holds.

    Raises:
      ValueError: it was not set.
    """
    if not os.fspath(path):
        raise ValueError('no path is set; set the parameter "path"')
    return Path(path)


@contextmanager
def reaching(path: FilePath, doing: Literal["read", "write"]) -> Iterator[None]:
    """Report in one message which file could not be read or written, and why.

    Raises:
      OSError: of the same class as the system's.
    """
    try:
        yield
    except OSError as error:
        reason = _REASONS.get(error.errno or 0) or error.strerror or str(error)
        where = "" if Path(path).is_absolute() else f' (relative to "{Path.cwd()}")'
        raise type(error)(f'cannot {doing} "{os.fspath(path)}"{where}: {reason}') from error
    except UnicodeError as error:
        raise ValueError(f'cannot {doing} "{os.fspath(path)}": {error}; set another encoding') from None


def read_whole(path: Path) -> bytes:
    """Read a file whole, if it is no longer than any may be; what has no end, such as a device, is refused as well.

    Raises:
      OSError: it cannot be read.
      ValueError: it is too long.
    """
    most = FILE_BYTES.most
    with reaching(path, "read"), path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        data = b"" if size > most else file.read(most + 1)
    if max(size, len(data)) > most:
        raise ValueError(f'"{path}" has {max(size, len(data)):,} bytes or more, {FILE_BYTES.remedy}')
    return data


def lines_of(file: IO[AnyStr], path: Path) -> Iterator[AnyStr]:
    """Go through the lines of a file, none of which is longer than any may be.

    Raises:
      ValueError: one is.
    """
    most = FILE_BYTES.most
    while line := file.readline(most + 1):
        if len(line) > most:
            raise ValueError(f'a line of "{path}" is longer than any may be, {FILE_BYTES.remedy}')
        yield line


def write_whole(path: Path, write: Callable[[BinaryIO], Any], *, overwrite: bool = True) -> None:
    """Write a file as `hfg.base.whole.write_whole` does. Missing directories are created.

    Raises:
      OSError: it cannot be written; the message says why, and the old file is unchanged.
    """
    with reaching(path, "write"):
        path.parent.mkdir(parents=True, exist_ok=True)
        whole.write_whole(path, write, overwrite=overwrite)


def find_files(pattern: str, order: str) -> list[Path]:
    """List the files that a pattern describes.

    Args:
      pattern: as a shell has it; `**` is any number of directories.
      order: by "name", by the "number" in the name, or by when they were "modified".

    Raises:
      OSError: there is none.
    """
    with reaching(pattern, "read"):
        # Not Path.glob, which knows no absolute patterns. A pipe that others have put there would wait forever.
        found = [path for path in map(Path, glob.glob(pattern, recursive=True)) if not path.is_dir()]  # noqa: PTH207
        if glob.has_magic(pattern):
            found = [path for path in found if path.is_file()]
        if not found:
            raise FileNotFoundError(errno.ENOENT, "")
        if order == "modified":
            return sorted(found, key=lambda path: (path.stat().st_mtime_ns, str(path)))
    return sorted(found, key=_by_numbers if order == "number" else str)


def _by_numbers(path: Path) -> list[tuple[int, str]]:
    """Order "9.png" before "10.png"."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"([0-9]+)", str(path))]
