"""reactivex: a subject, maps and a subscriber."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import reactivex
from reactivex import operators as ops

from benchmarks.meters import Arrivals, Laps
from benchmarks.works import Participant


def through(value: int) -> int:
    """Pass on."""
    return value


def mapped(length: int) -> tuple[reactivex.Subject[int], Any]:
    """A subject and its end behind `length` maps."""
    subject: reactivex.Subject[int] = reactivex.Subject()
    return subject, subject.pipe(*(ops.map(through) for _ in range(length)))


def relays(length: int, tokens: int, meter: Arrivals) -> None:
    """Send each value to a subject whose subscriber sends it to the next one, and so on."""
    last: reactivex.Subject[int] = reactivex.Subject()
    last.subscribe(meter.take)
    for _ in range(length):
        before: reactivex.Subject[int] = reactivex.Subject()
        before.subscribe(relay(last))
        last = before
    for value in range(tokens):
        last.on_next(value)


def relay(after: reactivex.Subject[int]) -> Callable[[int], None]:
    """Make a handler that sends on."""

    def take(value: int) -> None:
        after.on_next(value)

    return take


def first(pair: tuple[int, int]) -> int:
    """The left one of two."""
    return pair[0]


class Reactivex(Participant):
    """Synchronous push."""

    name = "reactivex"

    def chain(self, length: int, tokens: int) -> dict[str, float]:
        """A."""
        meter = Arrivals(tokens)
        subject, end = mapped(length)
        end.subscribe(meter.take)
        for value in range(tokens):
            subject.on_next(value)
        return meter.figures(length + 1)

    def flight(self, length: int, tokens: int) -> dict[str, float]:
        """B: `on_next` returns when the value is through."""
        meter = Laps(tokens)
        subject, end = mapped(length)
        end.subscribe(Arrivals(tokens).take)
        for value in range(tokens):
            meter.lap()
            subject.on_next(value)
        meter.lap()
        return meter.figures(length + 1)

    def join(self, tokens: int) -> dict[str, float]:
        """C."""
        meter = Arrivals(tokens)
        subject, left = mapped(1)
        right = subject.pipe(ops.map(through))
        reactivex.zip(left, right).pipe(ops.map(first)).subscribe(meter.take)
        for value in range(tokens):
            subject.on_next(value)
        return meter.figures()

    def signals(self, length: int, tokens: int) -> dict[str, float]:
        """Subjects in a row, each with a subscriber that sends on; microseconds a hop."""
        meter = Arrivals(tokens)
        relays(length, tokens, meter)
        return meter.figures(length + 1)


PEERS = [Reactivex()]
