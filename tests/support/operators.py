"""Reactivex operators that a random graph can have on an edge: told by name, so that its program can be printed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import reactivex
import reactivex.operators as ops

from hfg.graph import operator

__all__ = ["OPERATORS", "WITH_TIME", "through"]

OPERATORS: Final[dict[str, Callable[[Any], Any]]] = {
    "start_with": ops.start_with,
    "skip": ops.skip,
    "take": ops.take,
    "retry": ops.retry,
    "in_rows": lambda count: reactivex.compose(ops.buffer_with_count(count), ops.map(len)),
    "at_last": lambda value: ops.concat(reactivex.of(value)),
    "debounce": ops.debounce,
    "delay": ops.delay,
    "throttle_first": ops.throttle_first,
    "beside_a_timer": lambda seconds: ops.merge(reactivex.timer(seconds).pipe(ops.map(lambda _: 7))),
}
"""Those that come to an end with what goes in."""

WITH_TIME: Final = ("debounce", "delay", "throttle_first", "beside_a_timer")
"""Of those the ones that need a scheduler."""


@operator
def through(name: str, amount: float) -> Callable[[Any], Any]:
    """Make one of `OPERATORS`, of a number or seconds."""
    made: Callable[[Any], Any] = OPERATORS[name](amount)
    return made
