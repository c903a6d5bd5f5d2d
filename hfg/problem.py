"""What a check finds: where, how bad, what, why, and what to do. Stands on nothing."""

from __future__ import annotations

from typing import Final, Literal

import msgspec

__all__ = ["SEVERITIES", "Problem"]

SEVERITIES: Final = ("error", "warning", "hint")
"""The worst first."""


class Problem(msgspec.Struct, frozen=True):
    """One finding of `graph.check()`.

    Attributes:
      path: the node, port or edge it is about.
      severity: a run refuses graphs with an "error"; a "warning" is only told, for what does not work as it is drawn;
        a "hint" is for what may be meant so.
      what: the fact, in a few words.
      why: the rule or the consequence.
      remedy: what to do.
      check: the name of the check that found it, as docs/howto/checks.md lists them.
    """

    path: str
    severity: Literal["error", "warning", "hint"]
    what: str
    why: str
    remedy: str
    check: str = ""

    def __str__(self) -> str:
        return f'{self.severity} at "{self.path}": {self.what}: {self.why}; {self.remedy}'
