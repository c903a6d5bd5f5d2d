"""How much of the graph's time the requests of one page may take: a hostile page slows the graph down only a little.

Depends on `stepping`.
"""

from __future__ import annotations

import time
from collections.abc import Coroutine
from typing import Any, Final, TypeVar

from hfg.base.stepping import measured_steps

__all__ = ["Budget", "metered"]

T = TypeVar("T")

_SHARE: Final = 0.25
"""Of a processor, in the long run."""

_MOST_S: Final = 2.0
"""Seconds that may be spent at once: what people do is less, or comes after a pause."""


class Budget:
    """Processor time that one page has used on the graph's loop.

    Attributes:
      spent: its only element: seconds not yet paid back.
    """

    def __init__(self) -> None:
        self.spent = [0.0]
        self._at = time.monotonic()

    def is_over(self) -> bool:
        """Return whether the page has to wait."""
        now = time.monotonic()
        self.spent[0] = max(0.0, self.spent[0] - (now - self._at) * _SHARE)
        self._at = now
        return self.spent[0] > _MOST_S


async def metered(coroutine: Coroutine[Any, Any, T], budget: Budget) -> T:
    """Await a coroutine at the expense of a budget."""
    return await measured_steps(coroutine, budget.spent, time.thread_time)
