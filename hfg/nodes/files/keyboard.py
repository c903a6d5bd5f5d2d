"""Waits for standard input without blocking anything.

A read of a terminal or pipe cannot be taken back. So it is done by a daemon thread, one for the process, and its input
is kept here until it is requested. It reads when somebody waits, so nothing is taken from those who come after us. It
reads the descriptor itself: a thread that is killed within a read of `sys.stdin` would end Python badly.
"""

from __future__ import annotations

import asyncio
import os
import stat
import sys
import threading
from collections.abc import AsyncIterator
from typing import Final

from hfg.errors import UsageError

_AT_ONCE: Final = 65536


class _StandardInput:
    """What is known of standard input; one for the process.

    Attributes:
      left: what was read and not given: the beginning of a line, or many lines.
      is_over: whether there is nothing more.
      error: why it cannot be read.
      is_wanted: set while code waits for more; its thread reads then.
      waiting: who waits, and on which loop.
    """

    def __init__(self) -> None:
        self.left = bytearray()
        self.is_over = False
        self.error: OSError | None = None
        self.is_taken = False
        self.is_wanted = threading.Event()
        self.waiting: tuple[asyncio.AbstractEventLoop, asyncio.Future[None]] | None = None
        self.lock = threading.Lock()
        self.thread: threading.Thread | None = None

    def line(self) -> bytes | None:
        """Return the next whole line, at the end also the rest; None if there is none."""
        with self.lock:
            end = self.left.find(b"\n") + 1
            if not end and self.is_over:
                end = len(self.left)
            if not end:
                return None
            line = bytes(self.left[:end])
            del self.left[:end]
            return line

    async def more(self) -> None:
        """Wait until there is more, or nothing more."""
        if _never_blocks():
            self.read()
            return
        loop = asyncio.get_running_loop()
        future: asyncio.Future[None] = loop.create_future()
        with self.lock:
            self.waiting = (loop, future)
        if self.thread is None:
            self.thread = threading.Thread(target=self.live, name="hfg standard input", daemon=True)
            self.thread.start()
        self.is_wanted.set()
        await future

    def live(self) -> None:
        while True:
            self.is_wanted.wait()
            self.is_wanted.clear()
            self.read()
            with self.lock:
                waiting, self.waiting = self.waiting, None
            if waiting is not None:
                loop, future = waiting
                try:
                    loop.call_soon_threadsafe(_wake, future)
                except RuntimeError:  # its loop is closed; the next one finds what was read
                    continue

    def read(self) -> None:
        try:
            data = os.read(sys.stdin.fileno(), _AT_ONCE)
        except (OSError, ValueError, AttributeError) as error:  # closed, or a program without one
            self.error = OSError(f"cannot read standard input: {error}")
            data = b""
        with self.lock:
            self.left += data
            self.is_over = not data


def _wake(future: asyncio.Future[None]) -> None:
    if not future.done():
        future.set_result(None)


def _never_blocks() -> bool:
    """Say whether it is a file, or nothing at all: a read is answered at once, and needs no thread."""
    try:
        mode = os.fstat(sys.stdin.fileno())
    except (OSError, ValueError, AttributeError):
        return True
    is_null = stat.S_ISCHR(mode.st_mode) and not os.isatty(sys.stdin.fileno())
    return stat.S_ISREG(mode.st_mode) or is_null


_STANDARD_INPUT: Final = _StandardInput()


async def lines_of_standard_input() -> AsyncIterator[str]:
    """Yield the lines of standard input as they come, until it ends.

    Raises:
      OSError: it cannot be read.
      UsageError: another node reads it.
    """
    source = _STANDARD_INPUT
    if source.is_taken:
        raise UsageError("standard input is read by another node already: connect both to one StandardInput")
    source.is_taken = True
    source.is_over, source.error = False, None  # a terminal may go on after an end
    try:
        while True:
            line = source.line()
            if line is not None:
                yield line.removesuffix(b"\n").removesuffix(b"\r").decode(errors="replace")
            elif source.is_over:
                if source.error is not None:
                    raise source.error
                return
            else:
                await source.more()
    finally:
        source.is_taken = False
