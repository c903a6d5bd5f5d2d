"""Opens the folder of a file step by step, so that no other user leads what is written elsewhere (rules L4, L5).

Another user who may write to a folder on the way can exchange a folder for a link between a check and the use of the
path. Through the handle, a file is written in the folder that was checked, wherever its path leads by then. Only Linux
opens a link itself; on other systems the way is checked, and the path is used. Depends on `private`.
"""

from __future__ import annotations

import errno
import os
import secrets
import stat
from contextlib import suppress
from pathlib import Path
from typing import Final, Self

from hfg.base.private import MOST_LINKS, way_to

_CAN_HOLD: Final = hasattr(os, "O_PATH")
_ENTRY: Final = getattr(os, "O_PATH", 0) | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0)
_FILE: Final = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
_SHARED: Final = stat.S_ISVTX | stat.S_IWOTH  # of a folder in which all may write, and none removes another's files


class Place:
    """Where a file is or will be. The last step is not a link: links are followed to where they lead.

    Args:
      path: of the file.

    Attributes:
      path: of the file, as it was reached.
      name: the last part of it.
      folder: handle of its folder; None on systems that have none.

    Raises:
      OSError: there is no such folder, the file is a folder, or something on the way was put there by another user.
    """

    def __init__(self, path: Path) -> None:
        self.folder: int | None = None
        if _CAN_HOLD:
            self._walk(path.absolute())
        else:
            _need_way(path)
            self.path = path.resolve() if path.is_symlink() else path
            if self.path != path:
                _need_way(self.path)
        self.name = self.path.name
        there = self.found()
        if there is not None and stat.S_ISDIR(there.st_mode):
            self.close()
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))

    def _walk(self, path: Path) -> None:
        root, ahead, links = path.anchor, list(reversed(path.parts[1:])), 0
        self.path = Path(root)
        self.folder = os.open(root, _ENTRY)
        try:
            while ahead:
                name = ahead.pop()
                try:
                    entry = os.open(name, _ENTRY, dir_fd=self.folder)
                except FileNotFoundError:
                    if ahead or name == "..":
                        raise
                    self.path /= name
                    return
                try:
                    found = os.fstat(entry)
                    if name == "..":
                        self.path = self.path.parent
                        self.folder, entry = entry, self.folder
                        continue
                    _need_trusted(self.path / name, found, os.fstat(self.folder), is_last=not ahead)
                    if stat.S_ISLNK(found.st_mode):
                        links += 1
                        if links > MOST_LINKS:
                            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path))
                        target = Path(os.readlink("", dir_fd=entry))  # of what was checked
                        ahead += reversed(target.parts)
                        if target.is_absolute():
                            ahead.pop()
                            before, self.folder = self.folder, os.open(root, _ENTRY)
                            os.close(before)
                            self.path = Path(root)
                        continue
                    self.path /= name
                    if not ahead:
                        return
                    if not stat.S_ISDIR(found.st_mode):
                        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(self.path))
                    self.folder, entry = entry, self.folder
                finally:
                    os.close(entry)
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        except BaseException:
            self.close()
            raise

    def found(self, name: str = "") -> os.stat_result | None:
        """Return what the system says about it, or about a file next to it; None if it is not there."""
        with suppress(FileNotFoundError):
            return os.stat(self._at(name), dir_fd=self.folder, follow_symlinks=False)
        return None

    def open(self, flags: int, name: str = "", *, mode: int = 0o666) -> int:
        """Open it, or a file next to it, but no link in its place.

        Args:
          flags: as of `os.open`.
          name: of the file next to it.
          mode: the permissions of a file that is made.

        Raises:
          OSError: it cannot be opened.
        """
        return os.open(self._at(name), flags | _FILE, mode, dir_fd=self.folder)

    def make_folder(self, prefix: str) -> str:
        """Make a folder next to it that only this user can enter; return its name, which cannot be taken first."""
        name = f"{prefix}{secrets.token_hex(8)}"
        os.mkdir(self._at(name), 0o700, dir_fd=self.folder)
        return name

    def take_over(self, name: str, *, folder: int | None = None) -> None:
        """Put a file next to it, or in another open folder, in its place.

        Raises:
          OSError: the file cannot be renamed.
        """
        source, where = (self._at(name), self.folder) if folder is None else (name, folder)
        os.replace(source, self._at(), src_dir_fd=where, dst_dir_fd=self.folder)

    def remove(self, name: str = "") -> None:
        """Remove it, or a file next to it, if it is there."""
        with suppress(OSError):
            os.unlink(self._at(name), dir_fd=self.folder)

    def remove_folder(self, name: str) -> None:
        """Remove an empty folder next to it."""
        with suppress(OSError):  # another user, who may write to the outer folder, has moved it
            os.rmdir(self._at(name), dir_fd=self.folder)

    def keep(self) -> None:
        """Flush the entries of its folder to disk; not every system can."""
        with suppress(OSError):
            here = "." if self.folder is not None else self.path.parent
            folder = os.open(here, os.O_RDONLY, dir_fd=self.folder)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)

    def _at(self, name: str = "") -> str:
        return (name or self.name) if self.folder is not None else str(self.path.with_name(name or self.name))

    def close(self) -> None:
        """Let go of the folder."""
        folder, self.folder = self.folder, None
        if folder is not None:
            os.close(folder)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()


def _need_way(path: Path) -> None:
    """Refuse what another user has put on the way to a file, as far as looking at the path shows it.

    Raises:
      OSError: he has.
    """
    if not hasattr(os, "geteuid"):
        return
    for place in (*way_to(path.absolute()), path):
        with suppress(FileNotFoundError):
            _need_trusted(place, place.lstat(), place.parent.stat(), is_last=place is path)


def need_own(place: Place, there: os.stat_result) -> None:
    """Refuse a file that was opened if another user has put it in its place.

    Raises:
      OSError: he has.
    """
    around = os.fstat(place.folder) if place.folder is not None else place.path.parent.stat()
    _need_trusted(place.path, there, around, is_last=True)


def _need_trusted(place: Path, there: os.stat_result, around: os.stat_result, *, is_last: bool) -> None:
    """Refuse a link or pipe of another user: in a folder that others may write to, it leads to a file of ours, or him.

    In a folder like /tmp, in which each user owns what he has made, a file of another user and a link on the way are
    refused as well: there they were put in the way, and elsewhere users work together.
    """
    is_link, is_pipe = stat.S_ISLNK(there.st_mode), stat.S_ISFIFO(there.st_mode)
    if there.st_uid in (0, os.geteuid()) or stat.S_ISDIR(there.st_mode):
        return
    is_in_the_way = around.st_mode & _SHARED == _SHARED and there.st_uid != around.st_uid
    if (is_last and (is_link or is_pipe)) or is_in_the_way:
        what = "symbolic link" if is_link else "pipe" if is_pipe else "file"
        raise PermissionError(errno.EPERM, f"a {what} of another user is in its place; remove it", str(place))
