"""How much of the graph's time the requests of one page may take: a hostile page slows the graph down only a little.

Depends on the standard library.
"""

from __future__ import annotations

import time
import types
from collections.abc import Coroutine, Generator
from typing import Any, Final, TypeVar

__all__ = ["Budget", "metered"]

T = TypeVar("T")

_SHARE: Final = 0.25
"""Of a processor, in the long run."""

_MOST_S: Final = 2.0
"""Seconds that may be spent at once: what people do is less, or comes after a pause."""


class Budget:
    """Processor time that one page has used on the graph's loop.

    Attributes:
      spent_s: not yet paid back.
    """

    def __init__(self) -> None:
        self.spent_s = 0.0
        self._at = time.monotonic()

    def is_over(self) -> bool:
        """Return whether the page has to wait."""
        now = time.monotonic()
        self.spent_s = max(0.0, self.spent_s - (now - self._at) * _SHARE)
        self._at = now
        return self.spent_s > _MOST_S


@types.coroutine
def _stepped(coroutine: Coroutine[Any, Any, T], budget: Budget) -> Generator[Any, Any, T]:
    """Await a coroutine and count its own steps; while it waits, others run."""
    value: Any = None
    error: BaseException | None = None
    while True:
        began = time.thread_time()
        try:
            waits_for = coroutine.send(value) if error is None else coroutine.throw(error)
        except StopIteration as over:
            result: T = over.value
            return result
        finally:
            budget.spent_s += time.thread_time() - began
        value = error = None
        try:
            value = yield waits_for
        except GeneratorExit:
            coroutine.close()
            raise
        except BaseException as thrown:
            error = thrown


async def metered(coroutine: Coroutine[Any, Any, T], budget: Budget) -> T:
    """Await a coroutine at the expense of a budget."""
    return await _stepped(coroutine, budget)
