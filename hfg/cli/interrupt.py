"""Ctrl-C: the first ends the run and tears all down, the second leaves at once; neither takes longer than two seconds.

    first Ctrl-C ── a run is on: its task is cancelled, the engine tears down ─┬─ done: exit code 1
                 └─ none is:     KeyboardInterrupt                            │
       after 0.6 s, if the loop has not even noticed: a node blocks it;        │
                 its code gets a KeyboardInterrupt, then teardown as above ────┤
       after 1.8 s: say who does not come back and leave ──────────────────────┘
    second Ctrl-C: leave at once

A request to end (SIGTERM) and a terminal that goes away (SIGHUP) are treated alike. Depends on asyncio and signals;
knows neither graphs nor verbs.
"""

from __future__ import annotations

import _thread
import asyncio
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, ClassVar, Final

from hfg.base.controls import escaped

_ALIKE = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
_BREAK_IN_AFTER_S = 0.6
_LEAVE_AFTER_S = 1.8
_LEAVE_WITHIN_S = 0.3


class Interrupt:
    """The handling of Ctrl-C in this process; one at a time.

    Attributes:
      count: how often it was pressed.
      what: the graph that runs, for messages; "" before.
      before_leaving: called before the process is left without teardown, so that files are whole.
    """

    TYPERS_CODE: Final = 130
    """What typer makes of a KeyboardInterrupt; our rule is 1."""

    current: ClassVar[Interrupt | None] = None

    def __init__(self) -> None:
        self.count = 0
        self.before_leaving: list[Callable[[], None]] = []
        self.what = ""
        self._run: tuple[asyncio.AbstractEventLoop, asyncio.Task[Any]] | None = None
        self._noticed = threading.Event()
        self._breaking_in = False
        self._is_installed = False

    @classmethod
    @contextmanager
    def installed(cls) -> Iterator[Interrupt]:
        """Handle Ctrl-C inside the block; outside the main thread, where Python forbids that, nothing changes."""
        interrupt = cls()
        if threading.current_thread() is not threading.main_thread():
            yield interrupt
            return
        previous = {signal.SIGINT: signal.signal(signal.SIGINT, interrupt._pressed)}
        for one in _ALIKE:
            if signal.getsignal(one) is signal.SIG_DFL:  # nohup has it ignored
                previous[one] = signal.signal(one, interrupt._pressed)
        outer, cls.current = cls.current, interrupt
        interrupt._is_installed = True
        try:
            yield interrupt
        finally:
            cls.current = outer
            interrupt._is_installed = False
            for one, handler in previous.items():
                signal.signal(one, handler)

    @contextmanager
    def cancels(self, task: asyncio.Task[Any]) -> Iterator[None]:
        """Inside the block Ctrl-C cancels the task, which may then clean up."""
        loop = task.get_loop()
        self._run = (loop, task)
        self._wake(loop, True)
        try:
            yield
        finally:
            self._wake(loop, False)
            self._run = None

    def _wake(self, loop: asyncio.AbstractEventLoop, on: bool) -> None:
        """Let a signal wake the loop even if it arrives just before the loop starts to wait.

        Python runs a handler between two of its own instructions only. asyncio's handlers come with a wake-up file for
        that case, so one that does nothing is registered, and ours is put back in its place.
        """
        if not self._is_installed:
            return
        with suppress(NotImplementedError):  # Windows wakes up by other means
            if on:
                loop.add_signal_handler(signal.SIGINT, lambda: None)
            else:
                loop.remove_signal_handler(signal.SIGINT)
        signal.signal(signal.SIGINT, self._pressed)

    def _pressed(self, _number: int, _frame: FrameType | None) -> None:
        if self._breaking_in:  # our own signal, from `_insist`
            self._breaking_in = False
            raise KeyboardInterrupt
        self.count += 1
        if self.count > 1:
            self._leave("interrupted twice: left at once, without tearing anything down")
        threading.Thread(target=self._insist, name="hfg interrupt", daemon=True).start()
        if self._run is None:
            self._noticed.set()
            raise KeyboardInterrupt
        loop, task = self._run
        loop.call_soon_threadsafe(self._cancel, task)

    def _cancel(self, task: asyncio.Task[Any]) -> None:
        self._noticed.set()
        task.cancel()

    def _insist(self) -> None:
        leave_at = time.monotonic() + _LEAVE_AFTER_S
        if not self._noticed.wait(_BREAK_IN_AFTER_S):
            self._breaking_in = True
            if hasattr(signal, "pthread_kill"):  # wakes the code also from a sleep or a read
                signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
            else:
                _thread.interrupt_main()
        time.sleep(max(0.0, leave_at - time.monotonic()))
        self._leave("interrupted: something did not come back in time and was left behind, not everything is torn down")

    def _leave(self, sentence: str) -> None:
        deadline = threading.Timer(_LEAVE_WITHIN_S, os._exit, (1,))  # should a terminal or disk not take what we write
        deadline.daemon = True
        deadline.start()
        for call in self.before_leaving:
            with suppress(ValueError, OSError):  # closed already, or the disk is full: nothing keeps us here
                call()
        with suppress(ValueError, OSError):
            what = f"{self.what}: " if self.what else ""
            sys.stderr.write(f"hfg: {escaped(what)}{sentence}\n")
            sys.stderr.flush()
        os._exit(1)
