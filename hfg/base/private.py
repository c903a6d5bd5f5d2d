"""Folders that only their user can enter, and who is at the other end of a local socket (rule L5).

Depends on `errors`.
"""

from __future__ import annotations

import errno
import hashlib
import os
import socket
import stat
import struct
import sys
from pathlib import Path
from typing import Final, Protocol

from hfg.errors import TransportError

if sys.platform != "win32":
    import grp
    import pwd

_PEER: Final = struct.Struct("3i")  # process, user and group of who is at the other end
_OTHERS: Final = 0o077
MOST_LINKS: Final = 40  # that Linux follows on one way


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
    """Return the folder for the state of this user's programs, which may not exist yet.

    Raises:
      TransportError: the system does not know a home directory of this user.
    """
    own = os.environ.get("XDG_STATE_HOME")
    try:
        return (Path(own) if own else Path.home() / ".local" / "state") / "hfg"
    except RuntimeError:
        raise TransportError(
            f"user {os.geteuid()} has no home directory: set HOME, or set XDG_STATE_HOME to a folder of yours"
        ) from None


def require_peer_credentials() -> None:
    """Check that local sockets tell each end which user is at the other end.

    Raises:
      TransportError: they do not on this system.
    """
    if sys.platform != "linux":
        raise TransportError(
            "processes cannot meet on this system: it has no SO_PEERCRED, by which both ends of a local socket learn "
            "who the other is; run the graph in one process, or on Linux"
        )


MEETING: Final = "in which programs of this user meet"


def open_private(folder: Path, purpose: str = MEETING) -> int:
    """Open a folder that only this user can enter, and create it if needed. Returns a handle to the folder.

    Whatever happens to the path later, the handle refers to the folder that was checked. Folders on the way to it that
    are missing are created for this user only, too, whatever the umask is.

    Args:
      folder: its path.
      purpose: what the folder is for, in error messages.

    Raises:
      TransportError: the folder is not only this user's, or another user could replace it.
    """
    if not hasattr(os, "geteuid"):
        raise TransportError(f"{folder}, {purpose}, cannot be used: this system does not tell whose a folder is")
    check_parents(folder, purpose)
    try:
        make_private(folder)
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    except OSError as error:
        raise TransportError(
            f"{folder}, {purpose}, cannot be used ({error.strerror}): remove it if it is not a folder of yours, or "
            "name another place by XDG_STATE_HOME (TMPDIR for the folders of runs)"
        ) from None
    try:
        check_private(folder, os.fstat(handle), purpose)
        check_parents(folder, purpose)
    except BaseException:
        os.close(handle)
        raise
    return handle


def make_private(folder: Path) -> None:
    """Make a folder and those on the way to it, as far as they are missing, for this user only, whatever the umask is.

    Raises:
      OSError: it cannot be made.
    """
    for missing in [one for one in reversed((folder, *folder.parents)) if not one.is_dir()]:
        try:
            missing.mkdir(mode=0o700, exist_ok=True)
        except FileExistsError:  # a file is in its place
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(missing)) from None


def check_private(folder: Path, found: os.stat_result, purpose: str = MEETING) -> None:
    """Check that a folder belongs to this user and that no other user can enter it.

    Args:
      folder: its path, for error messages.
      found: what the system says about it.
      purpose: what the folder is for, in error messages.

    Raises:
      TransportError: it belongs to another user, or others can enter it.
    """
    if found.st_uid != os.geteuid():
        raise TransportError(
            f"{folder}, {purpose}, belongs to user {found.st_uid}, and this is user {os.geteuid()}: remove it, or name "
            "another place"
        )
    if found.st_mode & _OTHERS:
        raise TransportError(f"{folder}, {purpose}, can be entered by others: write chmod 700 {folder}")


def check_parents(folder: Path, purpose: str = MEETING) -> None:
    """Check that no other user can replace a folder or a link on the way to this one, as far as the way exists.

    Args:
      folder: its path.
      purpose: what the folder is for, in error messages.

    Raises:
      TransportError: another user can.
    """
    place = unsafe_place(folder)
    if place is not None:
        raise TransportError(
            f"{folder}, {purpose}, is not safe: other users can replace folders in {place}; write chmod go-w {place}, "
            "or name another place by XDG_STATE_HOME (TMPDIR for the folders of runs)"
        )


def unsafe_place(path: Path) -> Path | None:
    """Return where on the way to a file or folder another user can replace something; None if nowhere."""
    if not hasattr(os, "geteuid"):
        return None
    for place in way_to(path.absolute()):
        try:
            found = place.lstat()
        except OSError:
            continue  # opening the folder fails, or it is created
        may_be_written = not stat.S_ISLNK(found.st_mode) and is_open_to_others(found)
        is_replaceable = may_be_written and not found.st_mode & stat.S_ISVTX
        if found.st_uid not in (0, os.geteuid()) or is_replaceable:
            return place
    return None


def is_open_to_others(found: os.stat_result) -> bool:
    """Say whether others than the owner may write to a file or folder."""
    if not hasattr(os, "geteuid"):
        return False
    return bool(found.st_mode & stat.S_IWOTH or (found.st_mode & stat.S_IWGRP and not _is_own_group(found.st_gid)))


def way_to(folder: Path) -> list[Path]:
    """Return each folder and each link that the system passes on the way to a folder, without the folder itself.

    A link leads to further links, and whoever can replace one of them decides where the way ends.
    """
    here, passed = Path(folder.anchor), [Path(folder.anchor)]
    ahead, links = list(reversed(folder.parts[1:])), 0
    while ahead:
        name = ahead.pop()
        if name == "..":
            here = here.parent
            continue
        try:
            target = (here / name).readlink()
        except FileNotFoundError:
            return passed
        except OSError:  # it is not a link
            here /= name
            passed.append(here)
            continue
        links += 1
        passed.append(here / name)
        if links > MOST_LINKS:
            return passed  # opening it fails
        ahead += reversed(target.parts)
        if target.is_absolute():
            ahead.pop()
            here = Path(folder.anchor)
    return passed[:-1] if passed[-1] == here else passed


def _is_own_group(group: int) -> bool:
    """Say whether only this user (and root) is in a group: many systems give each user a group of the same name."""
    if group == 0:
        return True
    if sys.platform == "win32":
        return False
    try:
        user, found = pwd.getpwuid(os.geteuid()), grp.getgrgid(group)
    except KeyError:
        return False
    return user.pw_gid == group and user.pw_name == found.gr_name and set(found.gr_mem) <= {user.pw_name}


def may_be_changed(found: os.stat_result) -> bool:
    """Say whether other users can change a file."""
    return hasattr(os, "geteuid") and (found.st_uid not in (0, os.geteuid()) or is_open_to_others(found))


def exposure_of_key(file: Path | str, found: os.stat_result) -> tuple[str, str] | None:
    """Say in which way other users may know or change a secret key, and what to do; None if they cannot.

    A key of this user is for this user only. A key of root's may be readable by a group, as systems keep those of
    services.
    """
    if not hasattr(os, "geteuid"):
        return None
    if found.st_uid not in (0, os.geteuid()):
        what = f"{file} belongs to user {found.st_uid}, who knows it, and this is user {os.geteuid()}"
        return what, "take a key that this user has made"
    may = 0o040 if found.st_uid != os.geteuid() else 0
    if found.st_mode & _OTHERS & ~may:
        return f"other users can read or change {file}", f"write chmod 600 {file}"
    return None
