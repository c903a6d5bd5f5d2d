"""Plain Python: the cost of the work without any framework."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from benchmarks.meters import Arrivals, Laps
from benchmarks.works import Participant

PEERS: list[Participant]


def closures(length: int, take: Callable[[int], None]) -> Callable[[int], None]:
    """Functions that call each other."""

    def behind(after: Callable[[int], None]) -> Callable[[int], None]:
        def node(value: int) -> None:
            after(value)

        return node

    for _ in range(length):
        take = behind(take)
    return take


class Calls(Participant):
    """Functions that call the next one."""

    name = "plain calls"

    def chain(self, length: int, tokens: int) -> dict[str, float]:
        """A."""
        meter = Arrivals(tokens)
        first = closures(length, meter.take)
        for value in range(tokens):
            first(value)
        return meter.figures(length + 1)

    def flight(self, length: int, tokens: int) -> dict[str, float]:
        """B."""
        meter = Laps(tokens)
        first = closures(length, Arrivals(tokens).take)
        for value in range(tokens):
            meter.lap()
            first(value)
        meter.lap()
        return meter.figures(length + 1)

    def join(self, tokens: int) -> dict[str, float]:
        """C."""
        meter = Arrivals(tokens)

        def through(value: int) -> int:
            return value

        def both(left: int, right: int) -> int:
            return left

        for value in range(tokens):
            meter.take(both(through(value), through(value)))
        return meter.figures()


class Bare(Participant):
    """The same functions one after the other, written out: code for users who need no graph."""

    name = "bare calls"

    def chain(self, length: int, tokens: int) -> dict[str, float]:
        """A."""
        meter = Arrivals(tokens)

        def through(value: int) -> int:
            return value

        lines = ["for value in range(tokens):", *["    value = through(value)"] * length, "    take(value)"]
        code = "\n".join(["def work(through, take, tokens):", *(f"    {line}" for line in lines)])
        names: dict[str, Any] = {}
        exec(code, names)
        names["work"](through, meter.take, tokens)
        return meter.figures(length + 1)


class Awaits(Participant):
    """Coroutines that await the next one in place: no pass of the loop."""

    name = "await in place"

    def chain(self, length: int, tokens: int) -> dict[str, float]:
        """A."""

        async def through(value: int) -> int:
            return value

        async def main() -> dict[str, float]:
            meter = Arrivals(tokens)
            nodes = [through] * length
            for number in range(tokens):
                value = number
                for node in nodes:
                    value = await node(value)
                meter.take(value)
            return meter.figures(length + 1)

        return asyncio.run(main())


PEERS = [Calls(), Bare(), Awaits()]
