"""One clock for all parts of a run: exact on one machine, estimated with a bound between machines (rule T5).

The run's clock is that of the main part: the monotonic clock of its machine, plus the offset of Unix time at the start
of the run. Another process of that machine reads the same monotonic clock. Another machine has a clock of its own, so
its part asks for the time, several times: the error of an answer with a round trip of r is at most r / 2, however r is
divided between both directions, and the fastest answer counts. Decides, never waits. No dependencies.
"""

from __future__ import annotations

import functools
import platform
import uuid
from collections import deque
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

DRIFT: Final = 1e-4
"""How fast two quartz clocks may part at most, in seconds a second; they are specified to half of it."""

_KEPT: Final = 16


@functools.cache
def machine() -> str:
    """Name what has one monotonic clock: a machine since it was started."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text("ascii").strip()
    except OSError:  # not Linux: only processes started here share it
        return f"{platform.node()} {uuid.getnode()}"


class RunClock(msgspec.Struct, frozen=True):
    """The clock of a run.

    Attributes:
      machine: the machine whose monotonic clock it uses.
      ahead_s: its offset from that clock.
      began_s: start of the run, on this clock.
    """

    machine: str
    ahead_s: float
    began_s: float


class _Answer(NamedTuple):
    offset_s: float
    within_s: float
    at: float


class Offset:
    """How far the monotonic clock of another machine is ahead of this one's, as far as is known.

    Attributes:
      offset_s: the estimate; 0 before anything was heard.
      heard: how many answers there were.
    """

    def __init__(self) -> None:
        self.offset_s = 0.0
        self.heard = 0
        self._answers: deque[_Answer] = deque(maxlen=_KEPT)

    def hear(self, asked: float, told: float, now: float) -> None:
        """Process an answer.

        Args:
          asked: time of the question, on the local clock.
          told: the answer, on the remote clock.
          now: arrival of the answer, on the local clock.
        """
        within = max(0.0, now - asked) / 2
        self.heard += 1
        self._answers.append(_Answer(told - (asked + within), within, asked))  # clocks drift from then on
        self.offset_s = min(self._answers, key=lambda answer: self._bound(answer, now)).offset_s

    def within_s(self, now: float) -> float:
        """By how much the estimate may be wrong now, at most; infinite before anything was heard."""
        return min((self._bound(answer, now) for answer in self._answers), default=float("inf"))

    def error_of(self, used_s: float, now: float) -> float:
        """Return the maximum error of code that still uses an earlier estimate."""
        return abs(self.offset_s - used_s) + self.within_s(now)

    @staticmethod
    def _bound(answer: _Answer, now: float) -> float:
        return answer.within_s + DRIFT * max(0.0, now - answer.at)
