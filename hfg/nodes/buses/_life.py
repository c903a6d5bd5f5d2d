"""The life of a connection as decisions: when to connect, how long to pause, when to give up. It never waits.

    idle -> connecting -> open -> pausing -> connecting ... -> over

`_connection` carries the decisions out. No dependencies.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

Phase: TypeAlias = Literal["idle", "connecting", "open", "pausing", "over"]

_JITTER: Final = 0.25  # the part of a pause that is drawn, so that 200 clients do not return in the same moment


@dataclass(frozen=True)
class Retry:
    """What follows a failure.

    Attributes:
      pause_s: until the next attempt; None: give up.
      is_news: the connection was open, or has failed for a reason that was not told yet.
    """

    pause_s: float | None
    is_news: bool


class Life:
    """One connection, which is made again and again until it is over.

    Pauses double from the first to the longest. They start from the first again only after a connection that lasted
    longer than the pause before it: a server that hangs up at once is not asked faster and faster.

    Args:
      first_s: the first pause.
      longest_s: the longest pause.
      attempts: attempts in a row that may fail; 0: any number.
      seed: of the part of each pause that is drawn.

    Attributes:
      phase: where it is.
      opened: how often it was open.
      failures: attempts in a row that failed, or did not last.
    """

    def __init__(self, first_s: float, longest_s: float, attempts: int, seed: str) -> None:
        self.phase: Phase = "idle"
        self.opened = 0
        self.failures = 0
        self._first_s, self._longest_s, self._attempts = first_s, max(first_s, longest_s), attempts
        self._random = random.Random(seed)
        self._since_s = 0.0
        self._pause_s = 0.0
        self._told: str | None = None

    @property
    def is_open(self) -> bool:
        """Whether messages can pass."""
        return self.phase == "open"

    def connect(self) -> None:
        """An attempt begins."""
        assert self.phase in ("idle", "pausing")
        self.phase = "connecting"

    def open(self, now_s: float) -> None:
        """The attempt has succeeded."""
        assert self.phase == "connecting"
        self.phase = "open"
        self.opened += 1
        self._since_s, self._told = now_s, None

    def lose(self, why: str, now_s: float) -> Retry:
        """The attempt has failed, or the connection is lost: say what follows."""
        assert self.phase in ("connecting", "open")
        was_open = self.phase == "open"
        if was_open and now_s - self._since_s > self._pause_s:
            self.failures = 0
        self.failures += 1
        is_news, self._told = was_open or why != self._told, why
        if self._attempts and self.failures >= self._attempts:
            self.phase = "over"
            return Retry(None, is_news)
        self.phase = "pausing"
        self._pause_s = min(self._longest_s, self._first_s * 2.0 ** min(self.failures - 1, 60))
        return Retry(self._pause_s * (1.0 - _JITTER * self._random.random()), is_news)

    def end(self) -> None:
        """Nothing follows."""
        self.phase = "over"
