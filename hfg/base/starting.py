"""Handles Ctrl-C while the command `hfg` is still being imported.

It prints one line and exits; there is nothing to clean up. This is the first module that `hfg` imports. In any other
program it does nothing: a library does not touch signals. No dependencies.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from pathlib import PurePath


def is_command() -> bool:
    """Return whether this process is the command: the script `hfg`, or `python -m hfg`."""
    if sys.argv[:1] == ["-m"]:  # its value while the package is being imported
        given = sys.orig_argv
        return "-m" in given[:-1] and given[given.index("-m") + 1] in ("hfg", "hfg.__main__")
    return PurePath(sys.argv[0] if sys.argv else "").stem in ("hfg", "hfg-script")


def let_go_at_once() -> None:
    """Let Ctrl-C end the process without a traceback until the command line installs its own handler."""
    if threading.current_thread() is not threading.main_thread():
        return
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, lambda _number, _frame: _leave())


def _leave() -> None:
    sys.stderr.write("hfg: interrupted\n")
    sys.stderr.flush()
    os._exit(1)


if is_command():
    let_go_at_once()
