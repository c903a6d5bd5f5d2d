"""Measures the steps of a coroutine, without the time in which it waits. Depends on the standard library."""

from __future__ import annotations

import types
from collections.abc import Callable, Coroutine, Generator
from typing import Any, TypeVar

T = TypeVar("T")


@types.coroutine
def measured_steps(
    coroutine: Coroutine[Any, Any, T], spent: list[float], clock: Callable[[], float]
) -> Generator[Any, Any, T]:
    """Await a coroutine and add up what its own steps take; while it waits, others run.

    Args:
      coroutine: the coroutine.
      spent: its only element is increased by each step, in seconds. A list, because a call per step would cost more
        than the addition.
      clock: gives seconds, of the wall or of a processor.
    """
    value: Any = None
    error: BaseException | None = None
    while True:
        began = clock()
        try:
            waits_for = coroutine.send(value) if error is None else coroutine.throw(error)
        except StopIteration as over:
            result: T = over.value
            return result
        finally:
            spent[0] += clock() - began
        value = error = None
        try:
            value = yield waits_for
        except GeneratorExit:
            coroutine.close()
            raise
        except BaseException as thrown:
            error = thrown
