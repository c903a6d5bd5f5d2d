"""Files that are complete or absent: written next to their place, flushed to disk, then renamed.

A full disk, a size limit or a sudden end of the process leaves the old file, or none. Depends on `private`.
"""

from __future__ import annotations

import errno
import os
import secrets
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, Final, Literal

from hfg.base.private import way_to

_HELD_BYTES: Final = 64 * 1024
_PERMISSIONS: Final = 0o777  # never those by which a file runs as its owner
_SHARED: Final = stat.S_ISVTX | stat.S_IWOTH  # of a folder in which all may write, and none removes another's files


def write_whole(path: Path, write: Callable[[BinaryIO], Any], *, overwrite: bool = True) -> None:
    """Write a file so that either the old or the new content exists, whatever happens meanwhile.

    A device or a pipe is written to directly.

    Args:
      path: the file; for a symbolic link, its target.
      write: writes the content.
      overwrite: whether an existing file may be replaced.

    Raises:
      OSError: it cannot be written; the old file is unchanged.
    """
    target = _target(path)
    if not overwrite and target.exists():
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))
    if _is_no_file(target):
        with _open(target, "wb") as file:
            write(file)
        return
    beside = target.with_name(f".hfg-{secrets.token_hex(8)}.part")  # a name that cannot be taken before
    try:
        with beside.open("xb") as file:
            write(file)
            file.flush()
            _take_permissions(file, target)
            os.fsync(file.fileno())
        beside.replace(target)
    except BaseException:
        with suppress(OSError):
            beside.unlink()
        raise
    _keep_the_name(target)


def create(path: Path) -> BinaryIO:
    """Open a file that is not there yet.

    Raises:
      OSError: it is there, or cannot be made.
    """
    need_trusted(path)
    return path.open("xb")


def write_in_place(path: Path) -> BinaryIO:
    """Open a file to be written from its beginning, and empty it.

    Raises:
      OSError: it cannot be opened.
    """
    return _open(_target(path), "wb")


def need_writable(path: Path) -> None:
    """Check that a file could be written here. Leave no file.

    Raises:
      OSError: it could not.
    """
    target = _target(path)
    if _is_no_file(target):
        return
    was_there = target.exists()
    with _open(target, "ab"):
        pass
    if not was_there:
        target.unlink()


def read_plain(path: Path, most: int) -> bytes:
    """Read a file of which another user could have made something else: a pipe would wait forever, a device not end.

    Args:
      path: the file.
      most: the most bytes to read.

    Raises:
      OSError: it cannot be read, or is not a plain file.
    """
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
    with os.fdopen(os.open(path, flags), "rb") as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(errno.EINVAL, "it is not a plain file", str(path))
        return file.read(most)


def _open(target: Path, mode: Literal["ab", "wb"], buffering: int = -1) -> BinaryIO:
    """Open what was checked, and check what was opened: meanwhile another user may have put something else there."""
    return open(target, mode, buffering, opener=_open_trusted)


def _open_trusted(path: str, flags: int) -> int:
    """Do what `os.open` does, but wait at no pipe of another user, and empty no file of his."""
    kind = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    try:
        number = os.open(path, flags & ~os.O_TRUNC | kind, 0o666)
    except OSError as error:
        if error.errno != errno.ENXIO:
            raise
        _need_trusted(Path(path), os.lstat(path), is_last=True)
        number = os.open(path, flags & ~os.O_TRUNC, 0o666)  # a pipe of ours waits for its reader
    try:
        there = os.fstat(number)
        if hasattr(os, "geteuid"):
            _need_trusted(Path(path), there, is_last=True)
            os.set_blocking(number, True)
        if flags & os.O_TRUNC and stat.S_ISREG(there.st_mode):
            os.ftruncate(number, 0)
    except BaseException:
        os.close(number)
        raise
    return number


def _target(path: Path) -> Path:
    need_trusted(path)
    target = path.resolve() if path.is_symlink() else path
    if target != path:
        need_trusted(target)
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    return target


def _take_permissions(file: BinaryIO, target: Path) -> None:
    """Let a file take over the permissions of the file that it replaces, if that one is ours.

    By its handle: whoever may write to the folder could put a link to another file of ours under the file's name.
    """
    with suppress(OSError):
        there = target.stat()
        if hasattr(os, "fchmod") and there.st_uid == os.geteuid():
            os.fchmod(file.fileno(), there.st_mode & _PERMISSIONS)


def need_trusted(path: Path) -> None:
    """Refuse a link or pipe of another user: in a folder that others may write to, it leads to a file of ours, or him.

    In a folder like /tmp, in which each user owns what he has made, a file of another user and a link on the way are
    refused as well: there they were put in the way, and elsewhere users work together.

    Raises:
      OSError: it is one.
    """
    if not hasattr(os, "geteuid"):
        return
    for place in (*way_to(path.absolute()), path):
        try:
            there = place.lstat()
        except FileNotFoundError:
            continue
        _need_trusted(place, there, is_last=place is path)


def _need_trusted(place: Path, there: os.stat_result, *, is_last: bool) -> None:
    """Refuse one entry on the way to a file, or at its end."""
    is_link, is_pipe = stat.S_ISLNK(there.st_mode), stat.S_ISFIFO(there.st_mode)
    if there.st_uid in (0, os.geteuid()) or stat.S_ISDIR(there.st_mode):
        return
    if (is_last and (is_link or is_pipe)) or _is_in_the_way(place, there):
        what = "symbolic link" if is_link else "pipe" if is_pipe else "file"
        raise PermissionError(errno.EPERM, f"a {what} of another user is in its place; remove it", str(place))


def _is_in_the_way(place: Path, there: os.stat_result) -> bool:
    """Say whether an entry of another user is in a folder like /tmp, and not by the owner of that folder."""
    around = place.parent.stat()
    return around.st_mode & _SHARED == _SHARED and there.st_uid != around.st_uid


def _is_no_file(path: Path) -> bool:
    return path.exists() and not path.is_file()


def _keep_the_name(file: Path) -> None:
    """Flush the folder entry to disk, too; not every system can."""
    with suppress(OSError):
        folder = os.open(file.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def _own_part(path: Path) -> BinaryIO:
    """Open an empty file with a predictable name, but never a file that another user has put there, nor through a link.

    A file left by an earlier run of this user is emptied.
    """
    # opening a pipe that waits for a reader must fail, and no file is emptied before it is known to be ours
    flags = os.O_WRONLY | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    try:
        number = os.open(path, flags | getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0), 0o666)
    except OSError as error:
        if path.is_symlink():
            raise PermissionError(errno.EPERM, "a symbolic link is in its place; remove it", str(path)) from error
        raise
    try:
        there = os.fstat(number)
        is_ours = not hasattr(os, "geteuid") or there.st_uid == os.geteuid()
        if not (stat.S_ISREG(there.st_mode) and is_ours and there.st_nlink == 1):
            raise PermissionError(
                errno.EPERM, "the file in its place does not belong only to you; remove it", str(path)
            )
        os.ftruncate(number, 0)
        return os.fdopen(number, "wb", buffering=0)
    except BaseException:
        os.close(number)
        raise


class GrowingFile:
    """A file that grows piece by piece, each written completely, and gets its name when it is complete.

    Until then it is named `<name>.part`, so it can be followed, and a sudden end leaves the pieces written so far. A
    file that is appended to keeps its name, and loses only the pieces that could not be written.

    Attributes:
      place: the file that is written to.
      lost: how many pieces could not be written; such a file is never complete.
    """

    def __init__(self, path: Path, *, append: bool, at_once: bool) -> None:
        """Open it.

        Args:
          path: its name; for a symbolic link, its target.
          append: keep the existing content and write after it.
          at_once: pass each piece to the system at once; otherwise many together.

        Raises:
          OSError: it cannot be opened.
        """
        self._target = _target(path)
        in_place = append or _is_no_file(self._target)
        self.place = self._target if in_place else self._target.with_name(f"{self._target.name}.part")
        self._file = _open(self.place, "ab" if append else "wb", 0) if in_place else _own_part(self.place)
        self._at_once = at_once
        self._held: list[bytes] = []
        self._held_bytes = 0
        self._length = self._file.seek(0, os.SEEK_END) if self._file.seekable() else 0
        self.lost = 0

    @property
    def is_empty(self) -> bool:
        """Whether it is empty."""
        return not self._length and not self._held

    def write(self, piece: bytes) -> None:
        """Append a piece.

        Raises:
          OSError: this piece, or those held before it, cannot be written.
        """
        self._held.append(piece)
        self._held_bytes += len(piece)
        if self._at_once or self._held_bytes > _HELD_BYTES:
            self.flush()

    def flush(self) -> None:
        """Pass buffered pieces to the system.

        Raises:
          OSError: it cannot be written, so the file ends with the last whole piece.
        """
        data, pieces = b"".join(self._held), len(self._held)
        self._held.clear()
        self._held_bytes = 0
        left = memoryview(data)
        try:
            while left:
                left = left[self._file.write(left) or 0 :]
        except OSError:
            self.lost += pieces
            with suppress(OSError):
                self._file.truncate(self._length)
                self._file.seek(self._length)
            raise
        self._length += len(data)

    def complete(self) -> None:
        """Close the file and give it its name. A file that lacks a piece keeps its temporary name.

        Raises:
          OSError: not every piece is in it.
        """
        try:
            self.flush()
            if self.lost:
                raise OSError(errno.EIO, f"{self.lost} pieces could not be written; the others are in {self.place}")
            if self.place != self._target:
                _take_permissions(self._file, self._target)
            with suppress(OSError):  # a pipe cannot
                os.fsync(self._file.fileno())
        finally:
            self._file.close()
        if self.place != self._target:
            self.place.replace(self._target)
            _keep_the_name(self._target)
