"""Requests for pictures: a picture without a request is not even taken."""

from __future__ import annotations

from typing import Any

from annotated_types import Ge

import hfg


class Shutter(hfg.Node):
    """Ask for a picture with every nth thing that comes, the first one included.

    Attributes:
      n: with one of so many.
      tick: anything that comes again and again.
      look: asks.
    """

    n = hfg.Parameter(2, Ge(1))
    tick = hfg.Input(Any)
    look = hfg.Output(bool)
    seen = hfg.State(0)

    def process(self, tick: Any) -> bool | None:
        """Count."""
        self.seen += 1
        return True if (self.seen - 1) % self.n == 0 else None
