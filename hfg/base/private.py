"""Folders that only their user can enter, and who is at the other end of a local socket (rule L5).

Depends on `errors`.
"""

from __future__ import annotations

import hashlib
import os
import socket
import stat
import struct
import sys
from pathlib import Path
from typing import Final, Protocol

from hfg.errors import TransportError

__all__ = ["MACHINE", "Connected", "check_parents", "is_of_this_user", "open_private", "state_folder"]

_PEER: Final = struct.Struct("3i")  # process, user and group of who is at the other end
_OTHERS: Final = 0o077


def _machine() -> str:
    """Return a text that differs between machines that share a directory."""
    try:
        number = Path("/etc/machine-id").read_bytes()
    except OSError:
        number = b""
    return hashlib.blake2b(socket.gethostname().encode() + number, digest_size=4).hexdigest()


MACHINE: Final = _machine()
"""Part of the names of folders with sockets: home directories may be shared by several machines."""


class Connected(Protocol):
    """A local socket, or what asyncio shows of one."""

    def getsockopt(self, level: int, option: int, size: int, /) -> bytes:
        """As of a socket."""


def is_of_this_user(connected: Connected) -> bool:
    """Ask the system who is at the other end, and return whether it is this user; where it cannot tell, it is not."""
    if sys.platform != "linux":
        return False
    _, user, _ = _PEER.unpack(connected.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size))
    return bool(user == os.geteuid())


def state_folder() -> Path:
    """Return the folder for the state of this user's programs, which may not exist yet."""
    own = os.environ.get("XDG_STATE_HOME")
    return (Path(own) if own else Path.home() / ".local" / "state") / "hfg"


def open_private(folder: Path) -> int:
    """Open a folder that only this user can enter, and create it if needed. Returns a handle to the folder.

    Whatever happens to the path later, the handle refers to the folder that was checked.

    Raises:
      TransportError: the system cannot tell who is at the other end of a socket, or the folder is not only this user's.
    """
    if sys.platform != "linux":
        raise TransportError(
            "processes cannot meet on this system: it has no SO_PEERCRED, by which both ends of a local socket learn "
            "who the other is; run the graph in one process, or on Linux"
        )
    check_parents(folder)
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError as error:
        raise TransportError(
            f"{folder}, in which programs of this user meet, cannot be used ({error.strerror}): remove it if it is not "
            "a folder of yours, or name another place by XDG_STATE_HOME (TMPDIR for the folders of runs)"
        ) from None
    try:
        found = os.fstat(handle)
        if found.st_uid != os.geteuid():
            raise TransportError(
                f"{folder}, in which programs of this user meet, belongs to user {found.st_uid}, and this is user "
                f"{os.geteuid()}: remove it, or name another place by XDG_STATE_HOME"
            )
        if found.st_mode & _OTHERS:
            raise TransportError(
                f"{folder}, in which programs of this user meet, can be entered by others: write chmod 700 {folder}"
            )
        check_parents(folder)
    except BaseException:
        os.close(handle)
        raise
    return handle


def check_parents(folder: Path) -> None:
    """Check that no other user can replace a folder or a link on the way to this one, as far as the way exists.

    Raises:
      TransportError: another user can.
    """
    folder = folder.absolute()
    for parent in dict.fromkeys((*folder.parents, *folder.resolve().parents)):
        try:
            found = parent.lstat()
        except FileNotFoundError:
            continue
        is_of_group = found.st_mode & stat.S_IWGRP and found.st_gid not in (0, os.getegid())
        may_be_written = not stat.S_ISLNK(found.st_mode) and (found.st_mode & stat.S_IWOTH or is_of_group)
        is_replaceable = may_be_written and not found.st_mode & stat.S_ISVTX
        if found.st_uid in (0, os.geteuid()) and not is_replaceable:
            continue
        raise TransportError(
            f"{folder}, in which programs of this user meet, is not safe: other users can replace folders in {parent}; "
            f"write chmod go-w {parent}, or name another place by XDG_STATE_HOME (TMPDIR for the folders of runs)"
        )
