"""Whether and when a part that has died is restarted: with growing pauses, and not endlessly (rule L2).

Decides, never waits: the time is an argument of each call. No dependencies.
"""

from __future__ import annotations

from collections import deque
from typing import Final

LIMIT: Final = 5
"""How often a part may die within a minute and be restarted."""

WITHIN_S: Final = 60.0
_FIRST_PAUSE_S: Final = 0.1
_LONGEST_PAUSE_S: Final = 5.0


class Deaths:
    """The deaths of one part.

    Attributes:
      count: how often it has died in this run.
    """

    def __init__(self, limit: int = LIMIT, within_s: float = WITHIN_S) -> None:
        """Nothing has died yet.

        Args:
          limit: how many deaths within that time are forgiven.
          within_s: the time.
        """
        self.count = 0
        self._limit = limit
        self._within_s = within_s
        self._recent: deque[float] = deque()

    def died(self, now: float) -> float | None:
        """Record a death. Return the pause before the restart in seconds, or None: it is not restarted."""
        self.count += 1
        recent = self._recent
        while recent and now - recent[0] > self._within_s:
            recent.popleft()
        recent.append(now)
        if len(recent) > self._limit:
            return None
        return float(min(_FIRST_PAUSE_S * 2 ** (len(recent) - 1), _LONGEST_PAUSE_S))
