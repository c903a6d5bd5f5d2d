"""Ctrl-C in `hfg.run`: the run is torn down and left within two seconds, even while a node blocks the loop.

    first Ctrl-C ── the run is cancelled and torn down ─────────────────────────────┬─ KeyboardInterrupt, with a
    sentence
       after 0.6 s, if the loop has not even noticed: a node blocks it; its code     │
                 gets a KeyboardInterrupt, then teardown as above ──────────────────┤
       after 1.8 s: so does whatever still keeps us ────────────────────────────────┘
    second Ctrl-C: what runs gets a KeyboardInterrupt, nothing is waited for

Somebody who handles SIGINT already is not disturbed. The command line has its own, which leaves the process. Depends on
asyncio and signals.
"""

from __future__ import annotations

import asyncio
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

from hfg.engine.runtime.run_lifecycle import RunLifecycle
from hfg.errors import HfgError
from hfg.graph import Graph

__all__ = ["CtrlC", "named"]

_BREAK_IN_AFTER_S = 0.6
_LEAVE_AFTER_S = 1.8


def named(graph: Graph) -> str:
    """Return the name of a graph that is interrupted, with the groups that run in processes of their own."""
    groups = [f'"{name}"' for name, spec in graph.groups.items() if spec.process or spec.host]
    if not groups:
        return f'graph "{graph.name}"'
    return f'graph "{graph.name}" with the process{"es" * (len(groups) > 1)} of {", ".join(groups)}'


class CtrlC:
    """The handler of Ctrl-C during one run.

    Attributes:
      count: how often it was pressed.
      task: what it cancels; set by the task itself.
      run_lifecycle: of the run that is cancelled.
      error: what that run failed with.
    """

    def __init__(self) -> None:
        self.count = 0
        self.task: asyncio.Task[Any] | None = None
        self.run_lifecycle: RunLifecycle | None = None
        self.error: Callable[[], HfgError | None] = lambda: None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._noticed = threading.Event()
        self._over = threading.Event()
        self._breaking_in = False

    @contextmanager
    def handled(self, loop: asyncio.AbstractEventLoop) -> Iterator[None]:
        """Handle Ctrl-C inside the block, if no other handler is set and this is the main thread."""
        main = threading.current_thread() is threading.main_thread()
        if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
            yield
            return
        self._loop = loop
        with suppress(NotImplementedError):  # Windows wakes up by other means
            # a signal that comes just before the loop waits must wake it: with a handler comes the file that does
            loop.add_signal_handler(signal.SIGINT, lambda: None)
        signal.signal(signal.SIGINT, self._pressed)
        try:
            yield
        finally:
            self._over.set()
            if not loop.is_closed():
                with suppress(NotImplementedError):
                    loop.remove_signal_handler(signal.SIGINT)
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def sentence(self, graph: Graph) -> str:
        """What the user reads at the end."""
        error = self.error()
        return f"{named(graph)} was interrupted; " + ("what came back is torn down" if error is None else str(error))

    def _pressed(self, _number: int, _frame: FrameType | None) -> None:
        if self._breaking_in:  # our own signal, from `_insist`
            self._breaking_in = False
            raise KeyboardInterrupt
        self.count += 1
        if self.count > 1 or self.task is None or self._loop is None:
            if self.run_lifecycle is not None:
                self.run_lifecycle.leave_now()
            raise KeyboardInterrupt
        threading.Thread(target=self._insist, name="hfg interrupt", daemon=True).start()
        self._loop.call_soon_threadsafe(self._cancel)

    def _cancel(self) -> None:
        self._noticed.set()
        assert self.task is not None
        self.task.cancel()

    def _insist(self) -> None:
        leave_at = time.monotonic() + _LEAVE_AFTER_S
        if not self._noticed.wait(_BREAK_IN_AFTER_S):
            self._break_in()
        if not self._over.wait(leave_at - time.monotonic()):
            self._break_in()

    def _break_in(self) -> None:
        """Raise in the main thread, also out of a sleep or a read."""
        self._breaking_in = True
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
