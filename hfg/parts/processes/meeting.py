"""A folder in which the parts of one run on one host meet: only this user can enter it (rule L5).

However a run ends, its folder goes: by `leave`, or `leave_all` where the process ends without a teardown; by the end of
the interpreter where nobody comes to either; by a part that sees that the main one was killed, and if that had no
other process yet, by the next run on this machine. Who lives holds a lock on the folder, so that no other run takes it
for one that was left. Depends on `clocks` and `hfg.base.sockets`.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import sys
import tempfile
import time
import weakref
from pathlib import Path
from typing import ClassVar, Final

from hfg.base.sockets import SOCKET_FILE
from hfg.parts.model.clocks import machine

if sys.platform != "win32":
    import fcntl

__all__ = ["MeetingPlace", "remove"]

_MACHINE: Final = hashlib.blake2b(machine().encode(), digest_size=4).hexdigest()
_PREFIX: Final = f"hfg-meet-{_MACHINE}-"  # a lock may be of one machine, and the directory of several
_NAME: Final = re.compile(re.escape(_PREFIX) + r"[a-z0-9_]{8}")
_SECRET: Final = re.compile(r"secret(-[0-9a-f]+)?")  # which sessions make in it, beside their sockets
_YOUNG_S: Final = 60.0  # a folder so young may belong to who has not come to lock it yet


class MeetingPlace:
    """The folder of a run that lives.

    Attributes:
      folder: in the directory for temporary files.
    """

    _of_this_process: ClassVar[weakref.WeakSet[MeetingPlace]] = weakref.WeakSet()

    def __init__(self) -> None:
        """Make one, and remove those that runs of this user have left which were killed.

        Raises:
          OSError: there is no room for it.
        """
        _sweep(Path(tempfile.gettempdir()))
        self.folder = Path(tempfile.mkdtemp(prefix=_PREFIX))  # which nobody else can enter
        self._left = weakref.finalize(self, _leave, self.folder, os.getpid())
        self._lock = _lock(self.folder)
        self._of_this_process.add(self)

    def leave(self) -> None:
        """Remove it."""
        self._left()
        lock, self._lock = self._lock, None
        if lock is not None:
            os.close(lock)

    @classmethod
    def leave_all(cls) -> None:
        """Remove those of this process, which ends at once; from any thread."""
        for place in tuple(cls._of_this_process):
            place.leave()


def _leave(folder: Path, process: int) -> None:
    """Remove it; a process that was forked from ours leaves it alone."""
    if os.getpid() == process:
        remove(folder)


def remove(folder: Path) -> None:
    """Remove what is ours in it, and it, if nothing else is."""
    with contextlib.suppress(OSError):
        for file in folder.iterdir():
            if _SECRET.fullmatch(file.name) or SOCKET_FILE.fullmatch(file.name):
                file.unlink(missing_ok=True)
        folder.rmdir()


def _sweep(place: Path) -> None:
    """Remove the folders in `place` whose runs are over; what cannot be looked at is not ours."""
    if sys.platform == "win32":
        return  # where such sockets are not, nor locks of folders
    folders: list[Path] = []
    with contextlib.suppress(PermissionError):  # users may be allowed to make folders there, but not to list them
        folders = list(place.iterdir())
    for folder in folders:
        if _NAME.fullmatch(folder.name) is None:
            continue
        with contextlib.suppress(OSError):
            found = folder.lstat()
            if found.st_uid != os.geteuid() or time.time() - found.st_mtime < _YOUNG_S:
                continue
            lock = _lock(folder)
            if lock is not None:
                remove(folder)
                os.close(lock)


def _lock(folder: Path) -> int | None:
    """Lock a folder for as long as what is given stays open; None if somebody has, or there are no such locks there."""
    if sys.platform == "win32":
        return None
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        return None
    return handle
