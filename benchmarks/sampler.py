"""Samples this process by its processor time: whose lines it spends that on, the framework's or those of nodes.

A timer interrupts the main thread some hundred times a second, and the processor time since the last sample belongs to
the line at which the interruption is seen. So what else the machine does has no influence, and work of C code counts in
full. Python sees an interruption at calls and loops only: one that it sees where a function begins belongs to the
caller, so the end of a node's function may count for the framework, but none of the framework's lines for a node.
"""

from __future__ import annotations

import dis
import linecache
import re
import signal
from collections import Counter
from time import process_time
from types import CodeType, FrameType
from typing import Any

__all__ = ["Sampler"]

EVERY_S = 0.001
_BEGINS = dis.opmap["RESUME"]
_OURS = re.compile(r"^<hfg region|[/\\]hfg[/\\](?!nodes[/\\]|images)")
_NODES = re.compile(r"[/\\](examples|benchmarks)[/\\]|[/\\]hfg[/\\](nodes[/\\]|images)")
_RELEASES = re.compile(r"\bcv2\.")
"""Lines whose calls let the interpreter go; NumPy, which sometimes does, counts as holding it."""


class Sampler:
    """Samples from `begin` to the end of its block; libraries belong to who calls them."""

    def __init__(self) -> None:
        self._found: Counter[tuple[bool, bool]] = Counter()  # ours, held: microseconds
        self._last = 0.0
        self._samples = False
        self._before: Any = None

    def __enter__(self) -> None:
        self._before = signal.signal(signal.SIGALRM, self._sample)

    def __exit__(self, *_: object) -> None:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, self._before)

    def begin(self) -> None:
        """Sample from now on."""
        signal.set_wakeup_fd(-1)  # a loop in virtual time never sleeps, so that it need not be woken
        self._last = process_time()
        signal.setitimer(signal.ITIMER_REAL, EVERY_S, EVERY_S)

    @property
    def seconds(self) -> float:
        """Processor time that was sampled."""
        return sum(self._found.values()) / 1e6

    def share(self, *, held: bool = False) -> float:
        """The framework's share in percent; `held`: of the time in which the interpreter is held.

        Raises:
          RuntimeError: nothing was sampled.
        """
        ours = self._found[True, True] + self._found[True, False] * (not held)
        whole = sum(time for (_, holds), time in self._found.items() if holds or not held)
        if not whole:
            raise RuntimeError("nothing was sampled: is the work too short?")
        return 100 * ours / whole

    def _sample(self, _signal: int, frame: FrameType | None) -> None:
        if self._samples:  # the timer was faster than this is
            return
        self._samples = True
        spent = process_time() - self._last
        if frame is not None and frame.f_back is not None and _is_beginning(frame.f_code, frame.f_lasti):
            frame = frame.f_back
        held = frame is None or not _RELEASES.search(linecache.getline(frame.f_code.co_filename, frame.f_lineno or 0))
        self._found[_is_ours(frame), held] += round(spent * 1e6)
        self._last = process_time()  # what sampling takes belongs to nobody
        self._samples = False


def _is_beginning(code: CodeType, at: int) -> bool:
    return code.co_code[at] == _BEGINS and code.co_code[at + 1] == 0


def _is_ours(frame: FrameType | None) -> bool:
    while frame is not None:
        file = frame.f_code.co_filename
        if _NODES.search(file):
            return False
        if _OURS.search(file):
            return True
        frame = frame.f_back
    return False
