"""What a check finds: where, how bad, what, why, and what to do. Stands on nothing."""

from __future__ import annotations

from typing import Literal

import msgspec

__all__ = ["Problem"]


class Problem(msgspec.Struct, frozen=True):
    """One finding of `graph.check()`.

    Attributes:
      path: the node, port or edge it is about.
      severity: a run refuses graphs with an "error"; a "warning" is only told.
      what: the fact, in a few words.
      why: the rule or the consequence.
      remedy: what to do.
    """

    path: str
    severity: Literal["error", "warning"]
    what: str
    why: str
    remedy: str

    def __str__(self) -> str:
        return f'{self.severity} at "{self.path}": {self.what}: {self.why}; {self.remedy}'
