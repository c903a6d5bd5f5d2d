"""A folder in which the parts of one run meet: nobody but this user reaches the socket in it.

However a run ends, its folder goes: by `leave`, or `leave_all` where the process ends without a teardown; by the end of
the interpreter where nobody comes to either; by a part that sees that the main one was killed, and if that had no
other process yet, by the next run. Who lives holds a lock on the folder, so that no other run takes it for one that
was left.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
import tempfile
import time
import weakref
from pathlib import Path
from typing import ClassVar, Final

if sys.platform != "win32":
    import fcntl

__all__ = ["MeetingPlace"]

_PREFIX: Final = "hfg-meet-"
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
        self._kept = tempfile.TemporaryDirectory(prefix=_PREFIX, ignore_cleanup_errors=True)
        self.folder = Path(self._kept.name)
        self._lock = _lock(self.folder)
        self._of_this_process.add(self)

    @property
    def settings(self) -> dict[str, object]:
        """Of the sessions that meet here."""
        return {"realm": self.folder.name, "meet": [f"unixsock-stream/{self.folder}/meet"]}

    def leave(self) -> None:
        """Remove it."""
        self._kept.cleanup()
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    @classmethod
    def leave_all(cls) -> None:
        """Remove those of this process, which ends at once; from any thread."""
        for place in tuple(cls._of_this_process):
            place.leave()


def _sweep(place: Path) -> None:
    """Remove the folders in `place` whose runs are over; what cannot be looked at is not ours."""
    for folder in place.glob(f"{_PREFIX}*"):
        with contextlib.suppress(OSError):
            found = folder.lstat()
            if found.st_uid != os.geteuid() or time.time() - found.st_mtime < _YOUNG_S:
                continue
            lock = _lock(folder)
            if lock is not None:
                shutil.rmtree(folder, ignore_errors=True)
                os.close(lock)


def _lock(folder: Path) -> int | None:
    """Lock a folder for as long as what is given stays open; None if somebody has, or the system has no such locks."""
    if sys.platform == "win32":
        return None
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        return None
    return handle
