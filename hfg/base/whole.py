"""Files that are complete or absent: written next to their place, flushed to disk, then renamed.

A full disk, a size limit or a sudden end of the process leaves the old file, or none. Depends on `places`.
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

from hfg.base.places import Place, need_own

_HELD_BYTES: Final = 64 * 1024
_PERMISSIONS: Final = 0o777  # never those by which a file runs as its owner


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
    with Place(path) as place:
        there = place.found()
        if not overwrite and there is not None:
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))
        if there is not None and not stat.S_ISREG(there.st_mode):
            with _open(place, "wb") as file:
                write(file)
            return
        beside = f".hfg-{secrets.token_hex(8)}.part"  # a name that cannot be taken before
        try:
            with _new(place, beside) as file:
                write(file)
                file.flush()
                _take_permissions(file, place)
                os.fsync(file.fileno())
            place.take_over(beside)
        except BaseException:
            place.remove(beside)
            raise
        place.keep()


def create(path: Path) -> BinaryIO:
    """Open a file that is not there yet.

    Raises:
      OSError: it is there, or cannot be made.
    """
    with Place(path) as place:
        return _new(place)


def write_in_place(path: Path) -> BinaryIO:
    """Open a file to be written from its beginning, and empty it.

    Raises:
      OSError: it cannot be opened.
    """
    with Place(path) as place:
        return _open(place, "wb")


def need_writable(path: Path) -> None:
    """Check that a file could be written here. Leave no file.

    Raises:
      OSError: it could not.
    """
    with Place(path) as place:
        there = place.found()
        if there is not None and not stat.S_ISREG(there.st_mode):
            return
        with _open(place, "ab"):
            pass
        if there is None:
            place.remove()


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


def _new(place: Place, name: str = "") -> BinaryIO:
    """Make a file that is not there yet."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
    return open(place.path.with_name(name or place.name), "xb", opener=lambda _path, _flags: place.open(flags, name))


def _open(place: Place, mode: Literal["ab", "wb"], buffering: int = -1) -> BinaryIO:
    """Open what was checked, and check what was opened: meanwhile another user may have put something else there."""
    return open(place.path, mode, buffering, opener=lambda _path, flags: _open_trusted(place, flags))


def _open_trusted(place: Place, flags: int) -> int:
    """Open a file, but wait at no pipe of another user, and empty no file of his."""
    try:
        number = place.open(flags & ~os.O_TRUNC | getattr(os, "O_NONBLOCK", 0))
    except OSError as error:
        there = place.found()
        if error.errno != errno.ENXIO or there is None:
            raise
        need_own(place, there)
        number = place.open(flags & ~os.O_TRUNC)  # a pipe of ours waits for its reader
    try:
        there = os.fstat(number)
        if hasattr(os, "geteuid"):
            need_own(place, there)
            os.set_blocking(number, True)
        if flags & os.O_TRUNC and stat.S_ISREG(there.st_mode):
            os.ftruncate(number, 0)
    except BaseException:
        os.close(number)
        raise
    return number


def _take_permissions(file: BinaryIO, place: Place) -> None:
    """Let a file take over the permissions of the file that it replaces, if that one is ours.

    By its handle: whoever may write to the folder could put a link to another file of ours under the file's name.
    """
    with suppress(OSError):
        there = place.found()
        if there is not None and hasattr(os, "fchmod") and there.st_uid == os.geteuid():
            os.fchmod(file.fileno(), there.st_mode & _PERMISSIONS)


def _own_part(place: Place, name: str) -> BinaryIO:
    """Open an empty file with a predictable name, but never a file that another user has put there, nor through a link.

    A file left by an earlier run of this user is emptied.
    """
    path = str(place.path.with_name(name))
    # opening a pipe that waits for a reader must fail, and no file is emptied before it is known to be ours
    try:
        number = place.open(os.O_WRONLY | os.O_CREAT | getattr(os, "O_NONBLOCK", 0), name)
    except OSError as error:
        there = place.found(name)
        if there is not None and stat.S_ISLNK(there.st_mode):
            raise PermissionError(errno.EPERM, "a symbolic link is in its place; remove it", path) from error
        raise
    try:
        there = os.fstat(number)
        is_ours = not hasattr(os, "geteuid") or there.st_uid == os.geteuid()
        if not (stat.S_ISREG(there.st_mode) and is_ours and there.st_nlink == 1):
            raise PermissionError(errno.EPERM, "the file in its place does not belong only to you; remove it", path)
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
        self._target = Place(path)
        there = self._target.found()
        in_place = append or (there is not None and not stat.S_ISREG(there.st_mode))
        self._part = "" if in_place else f"{self._target.name}.part"
        self.place = self._target.path if in_place else self._target.path.with_name(self._part)
        if in_place:
            self._file = _open(self._target, "ab" if append else "wb", 0)
        else:
            self._file = _own_part(self._target, self._part)
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
            if self._part:
                _take_permissions(self._file, self._target)
            with suppress(OSError):  # a pipe cannot
                os.fsync(self._file.fileno())
        finally:
            self._file.close()
        with self._target:
            if self._part:
                self._target.take_over(self._part)
                self._target.keep()
