"""Closes the sessions that a program leaves open when it ends, so that it does end.

Zenoh's callbacks run in threads for which Python waits at the end, and which end with their session. A program that
leaves by an exception, or forgets, would never exit. Python runs `atexit` after that waiting, too late for it; a thread
that waits for the main thread comes in time. No thread here is a daemon: one that comes back from Zenoh while Python is
being taken down aborts the process ("FATAL: exception not rethrown"). No dependencies.
"""

from __future__ import annotations

import contextlib
import threading
import weakref
from typing import Any, Protocol


class _Closing(Protocol):
    def close_raw(self) -> Any: ...


_open: weakref.WeakSet[_Closing] = weakref.WeakSet()
_lock = threading.Lock()
_watching = False


def close_at_the_end(session: _Closing) -> None:
    """Have a session closed when the main thread has ended, if it is there still; closing twice must do nothing."""
    global _watching
    with _lock:
        _open.add(session)
        if not _watching:
            _watching = True
            threading.Thread(target=_watch, name="hfg zenoh end").start()


def _watch() -> None:
    """Close all at once, since each may take its ten seconds."""
    threading.main_thread().join()
    with _lock:
        left = [threading.Thread(target=_close, args=(session,)) for session in _open]
    for one in left:
        one.start()
    for one in left:
        one.join()


def _close(session: _Closing) -> None:
    with contextlib.suppress(Exception):
        session.close_raw()
