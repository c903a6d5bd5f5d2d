"""Ctrl-C while the command `hfg` is still being imported: one sentence, nothing is torn down, for nothing was begun.

The first thing that `hfg` imports. In any other program it does nothing: a library leaves signals alone. Stands on
nothing.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from pathlib import PurePath

__all__ = ["is_command", "let_go_at_once"]


def is_command() -> bool:
    """Whether this process is the command: the script `hfg`, or `python -m hfg`."""
    if sys.argv[:1] == ["-m"]:  # so it is while the package is imported
        given = sys.orig_argv
        return "-m" in given[:-1] and given[given.index("-m") + 1] in ("hfg", "hfg.__main__")
    return PurePath(sys.argv[0] if sys.argv else "").stem in ("hfg", "hfg-script")


def let_go_at_once() -> None:
    """Until the command line takes over, let Ctrl-C end the process without a traceback."""
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
