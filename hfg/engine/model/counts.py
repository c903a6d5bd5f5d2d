"""How often a node has done what since its run began: what report, statistics and glance are made of.

Stands on nothing.
"""

from __future__ import annotations

from hfg.errors import EngineInternalError

__all__ = ["Counts"]


class Counts:
    """The counts of one node. They only grow, and a region adds many at once.

    Attributes:
      firings: all of them, silent ones and the last one too.
      silent: those without a call of the function (F4).
      end_firings: those with which the node ended.
      calls: slot calls.
      failed_firings: those whose code failed, hooks included; `failed_calls`: the same of slot calls.
      retries: attempts beyond the first (X1).
      restarts: by `on_error="restart"` (X1).
    """

    __slots__ = ("calls", "end_firings", "failed_calls", "failed_firings", "firings", "restarts", "retries", "silent")

    def __init__(self) -> None:
        self.firings = self.silent = self.end_firings = self.calls = 0
        self.failed_firings = self.failed_calls = self.retries = self.restarts = 0

    @property
    def processed(self) -> int:
        """Firings in which the node's function ran."""
        return self.firings - self.silent - self.end_firings

    @property
    def failed(self) -> int:
        """How often its code failed."""
        return self.failed_firings + self.failed_calls

    @property
    def done(self) -> int:
        """Firings and calls."""
        return self.firings + self.calls

    def add_firings(self, times: int, silently: int = 0) -> None:
        """So many firings, of which so many were silent."""
        self.firings += times
        self.silent += silently

    def add_calls(self, times: int) -> None:
        """So many slot calls."""
        self.calls += times

    def add_silent(self) -> None:
        """The firing under way, which is counted already, is silent."""
        self.silent += 1

    def add_end_firing(self) -> None:
        """The firing under way, which is counted already, is the one with which the node ends."""
        self.end_firings += 1

    def add_failure(self, *, of_call: bool = False) -> None:
        """Its code has failed, in a slot call or elsewhere (X1)."""
        if of_call:
            self.failed_calls += 1
        else:
            self.failed_firings += 1

    def add_retry(self) -> None:
        """A firing that has failed is tried again (X1)."""
        self.retries += 1

    def add_restart(self) -> None:
        """It is torn down, and set up after a pause (X1)."""
        self.restarts += 1

    def check_invariants(self, path: str) -> None:
        """What is counted apart is part of the whole.

        Raises:
          EngineInternalError: it is more than that.
        """
        if self.processed < 0 or self.failed_calls > self.calls:
            raise EngineInternalError(f'node "{path}": its counts are parts of more than there was')
