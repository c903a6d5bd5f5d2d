"""csp: a graph of Python nodes, compiled and scheduled by its C++ engine, in simulated time."""
# ruff: noqa: RET503 - a node of csp that returns nothing does not tick

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime, timedelta

import csp
from csp import ts

from benchmarks.meters import Arrivals, Laps
from benchmarks.works import Participant

BEGIN = datetime(2020, 1, 1)  # noqa: DTZ001 - csp's times have no zone
STEP = timedelta(microseconds=1)


@csp.node
def through(x: ts[int]) -> ts[int]:
    if csp.ticked(x):
        return x


@csp.node
def left(x: ts[int]) -> ts[int]:
    if csp.ticked(x):
        return x


@csp.node
def right(x: ts[int]) -> ts[int]:
    if csp.ticked(x):
        return x


@csp.node
def join(x: ts[int], y: ts[int]) -> ts[int]:
    if csp.ticked(x) and csp.ticked(y):
        return x


@csp.node
def sink(x: ts[int], take: Callable[[int], None]) -> None:
    if csp.ticked(x):
        take(x)


@csp.node
def count(back: ts[int], meter: Laps) -> ts[int]:
    """Count on whenever the last number is back."""
    with csp.alarms():
        begin: ts[bool] = csp.alarm(bool)
    with csp.start():
        csp.schedule_alarm(begin, timedelta(), True)
    if csp.ticked(begin):
        meter.lap()
        return 0
    if csp.ticked(back):
        meter.lap()
        if back + 1 < meter.tokens:
            return back + 1


def numbers(tokens: int) -> ts[int]:
    """A number each microsecond of simulated time."""
    # ruff: noqa: RET503 - a node of csp that returns nothing does not tick
    return csp.curve(int, [(BEGIN + STEP * number, number) for number in range(tokens)])


class Csp(Participant):
    """Everything that ticks at one instant, in rank order."""

    name = "csp"

    def chain(self, length: int, tokens: int) -> dict[str, float]:
        """A."""
        meter = Arrivals(tokens)

        @csp.graph
        def graph() -> None:
            x = numbers(tokens)
            for _ in range(length):
                x = through(x)
            sink(x, meter.take)

        csp.run(graph, starttime=BEGIN, endtime=timedelta(days=1))
        return meter.figures(length + 1)

    def flight(self, length: int, tokens: int) -> dict[str, float]:
        """B: a feedback edge brings the number back in the next cycle."""
        meter = Laps(tokens)

        @csp.graph
        def graph() -> None:
            back = csp.feedback(int)
            x = count(back.out(), meter)
            for _ in range(length):
                x = through(x)
            back.bind(x)

        csp.run(graph, starttime=BEGIN, endtime=timedelta(days=1))
        return meter.figures(length + 1)

    def join(self, tokens: int) -> dict[str, float]:
        """C."""
        meter = Arrivals(tokens)

        @csp.graph
        def graph() -> None:
            x = numbers(tokens)
            sink(join(left(x), right(x)), meter.take)

        csp.run(graph, starttime=BEGIN, endtime=timedelta(days=1))
        return meter.figures()


PEERS = [Csp()]
