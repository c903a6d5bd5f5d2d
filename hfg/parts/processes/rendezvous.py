"""A folder in which the parts of one run on one host connect: only this user can enter it (rule L5).

The folder is removed however a run ends: by `leave`; by `leave_all` if the process ends without a teardown; at the exit
of the interpreter if neither was called; by a part that notices that the main part was killed; or, if there was no
other process yet, by the next run on this machine. A living run holds a lock on the folder, so that no other run takes
it for an abandoned one. Depends on `clocks` and `hfg.base.sockets`.
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

_MACHINE: Final = hashlib.blake2b(machine().encode(), digest_size=4).hexdigest()
_PREFIX: Final = f"hfg-meet-{_MACHINE}-"  # a lock may belong to one machine, and the directory to several
_NAME: Final = re.compile(re.escape(_PREFIX) + r"[a-z0-9_]{8}")
_SECRET: Final = re.compile(r"secret(-[0-9a-f]+)?")  # made by sessions, next to their sockets
_YOUNG_S: Final = 60.0  # the run of a newer folder may not have locked it yet


class Rendezvous:
    """The folder of a living run.

    Attributes:
      folder: in the directory for temporary files.
    """

    _of_this_process: ClassVar[weakref.WeakSet[Rendezvous]] = weakref.WeakSet()

    def __init__(self) -> None:
        """Make a folder, and remove folders of this user's runs that were killed.

        Raises:
          OSError: there is no room for it.
        """
        _sweep(Path(tempfile.gettempdir()))
        self.folder = Path(tempfile.mkdtemp(prefix=_PREFIX))  # only this user can enter it
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
        """Remove the folders of this process, which ends at once; from any thread."""
        for place in tuple(cls._of_this_process):
            place.leave()


def _leave(folder: Path, process: int) -> None:
    """Remove it, unless this process was forked from the owner."""
    if os.getpid() == process:
        remove(folder)


def remove(folder: Path) -> None:
    """Remove our files in it, and the folder itself if it is empty."""
    with contextlib.suppress(OSError):
        for file in folder.iterdir():
            if _SECRET.fullmatch(file.name) or SOCKET_FILE.fullmatch(file.name):
                file.unlink(missing_ok=True)
        folder.rmdir()


def _sweep(place: Path) -> None:
    """Remove the folders in `place` whose runs are over; folders that cannot be read are not ours."""
    if sys.platform == "win32":
        return  # on systems without such sockets or locks of folders
    found: list[os.DirEntry[str]] = []
    with contextlib.suppress(PermissionError):  # users may be allowed to make folders there, but not to list them
        found = [entry for entry in os.scandir(place) if _NAME.fullmatch(entry.name)]
    for entry in found:
        with contextlib.suppress(OSError):
            status = entry.stat(follow_symlinks=False)  # quick: another user may have made thousands
            if status.st_uid != os.geteuid() or time.time() - status.st_mtime < _YOUNG_S:
                continue
            folder = Path(entry)
            lock = _lock(folder)
            if lock is not None:
                remove(folder)
                os.close(lock)


def _lock(folder: Path) -> int | None:
    """Lock a folder for as long as the result stays open.

    Return None if it is locked, or the system has no such locks.
    """
    if sys.platform == "win32":
        return None
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        return None
    return handle
