"""Names of segments, how to open them, and how to find those whose producer is dead. Depends on errors.

Segments are plain files in /dev/shm. We do not use the standard library's `SharedMemory` because its tracker process
removes segments when a process that has only read them ends, and forgets them when all processes are killed. A producer
holds a lock on its segment for as long as it lives; the kernel releases it however the process ends. So a process that
can lock a segment knows that its producer is dead.
"""

from __future__ import annotations

import contextlib
import errno
import os
import re
import stat
import sys
from pathlib import Path
from typing import Final

from hfg.errors import SharedMemoryError

if sys.platform == "linux":
    import fcntl

_FOLDER: Final = Path("/dev/shm")
_PART: Final = re.compile(r"[A-Za-z0-9_]{1,48}")
_NAME: Final = re.compile(r"hfg(-[A-Za-z0-9_]{1,48}){4}(\.[0-9]{1,9})?")
_LARGEST: Final = 2**36


def unavailable() -> str | None:
    """Return why there is no shared memory here, or None if there is."""
    if sys.platform != "linux":
        return f"shared memory between processes needs Linux, and this is {sys.platform}: arrays are copied"
    if not os.access(_FOLDER, os.W_OK):
        return f"shared memory needs {_FOLDER}, which cannot be written to here: arrays are copied"
    return None


def segment_prefix(realm: str, agent: str, incarnation: int) -> str:
    """Return the common prefix of the names of all segments made by processes of an agent's incarnation.

    Raises:
      SharedMemoryError: a part of it has characters other than letters, digits and "_".
    """
    return "-".join(["hfg", *(_part(one) for one in (realm, agent, str(incarnation)))]) + "-"


def segment_name(realm: str, agent: str, incarnation: int, output: str) -> str:
    """Return the name of the segment of one output.

    Raises:
      SharedMemoryError: a part of it has characters other than letters, digits and "_".

    Examples:
      >>> segment_name("robots", "arm", 3, "camera_image")
      'hfg-robots-arm-3-camera_image'
    """
    return segment_prefix(realm, agent, incarnation) + _part(output)


def _part(text: str) -> str:
    if not _PART.fullmatch(text):
        raise SharedMemoryError(
            f'"{text:.60}" cannot be part of the name of shared memory: use up to 48 letters, digits and "_"'
        )
    return text


def _path(name: str) -> Path:
    if not _NAME.fullmatch(name):
        raise SharedMemoryError(f"{name!r:.120} is not a name of shared memory of hfg, so it is not opened")
    return _FOLDER / name


def create(name: str, size: int) -> int:
    """Make a new segment of zeros and lock it. Return its descriptor.

    Raises:
      SharedMemoryError: there is one of that name, or no room.
    """
    path, why = _path(name), unavailable()
    if why is not None:
        raise SharedMemoryError(why)
    room = os.statvfs(_FOLDER).f_bavail * os.statvfs(_FOLDER).f_frsize
    if size > min(room, _LARGEST):
        raise _full(name, size, room)
    while True:
        try:
            file = os.open(path, os.O_CREAT | os.O_EXCL | os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
        except FileExistsError:
            raise SharedMemoryError(
                f'shared memory named "{name}" already exists: each output of each incarnation needs its own '
                "name; sweep the remains of earlier runs"
            ) from None
        fcntl.flock(file, fcntl.LOCK_EX)  # only a sweep could hold it, and not for long
        if os.fstat(file).st_nlink:
            break
        os.close(file)  # a sweep removed it between the two lines above
    try:
        os.posix_fallocate(file, 0, size)  # without this, a write would kill the process when there is no room
    except OSError as error:
        os.close(file)
        remove(name)
        if error.errno == errno.ENOSPC:
            raise _full(name, size, room) from None
        raise
    return file


def _full(name: str, size: int, room: int) -> SharedMemoryError:
    return SharedMemoryError(
        f'shared memory is full: "{name}" needs {size / 1e6:.1f} MB and {_FOLDER} has {room / 1e6:.1f} MB left; use '
        "fewer or smaller slots, or enlarge it (docker run --shm-size=1g)"
    )


def open_existing(name: str, *, writable: bool) -> tuple[int, int]:
    """Open a segment of this user. Return its descriptor and size.

    Raises:
      SharedMemoryError: it does not exist, or belongs to another user.
    """
    # Without O_NONBLOCK, opening a FIFO that another user has made under this name would wait forever.
    flags = (os.O_RDWR if writable else os.O_RDONLY) | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    try:
        file = os.open(_path(name), flags)
    except OSError as error:
        reason = os.strerror(error.errno or 0)
        raise SharedMemoryError(f'shared memory "{name}" cannot be opened ({reason}): its producer has gone') from None
    found = os.fstat(file)
    if not stat.S_ISREG(found.st_mode) or found.st_uid != os.geteuid():
        os.close(file)
        raise SharedMemoryError(f'shared memory "{name}" belongs to another user, so it is not opened')
    return file, found.st_size


def remove(name: str) -> None:
    """Remove a segment's name; processes that have mapped it keep it."""
    with contextlib.suppress(FileNotFoundError):
        _path(name).unlink()


def sweep(prefix: str = "hfg-") -> list[str]:
    """Remove the segments with this prefix whose producers are dead, however they ended. Return their names.

    Args:
      prefix: the result of `segment_prefix`, or the beginning of it.

    Raises:
      SharedMemoryError: it is not a prefix of hfg's names.
    """
    if not prefix.startswith("hfg-"):
        raise SharedMemoryError(
            f'{prefix!r:.60} is not a prefix of names of shared memory of hfg, which begin with "hfg-"'
        )
    if unavailable() is not None:
        return []
    names = sorted(one.name for one in os.scandir(_FOLDER) if one.name.startswith(prefix) and _is_own(one))
    alive = {name for name in names if "." not in name and _has_producer(name)}
    swept = [name for name in names if name.partition(".")[0] not in alive]
    for name in swept:
        remove(name)
    return swept


def _is_own(entry: os.DirEntry[str]) -> bool:
    """Tell our segments from thousands that another user may have made, before any is opened."""
    if _NAME.fullmatch(entry.name) is None:
        return False
    with contextlib.suppress(OSError):  # it has gone
        return entry.stat(follow_symlinks=False).st_uid == os.geteuid()
    return False


def _has_producer(name: str) -> bool:
    try:
        file, _ = open_existing(name, writable=False)
    except SharedMemoryError:
        return True  # gone meanwhile, or another user's: not ours to remove
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(file)
    return False
