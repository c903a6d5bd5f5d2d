"""aiostream: a pipeline of maps that is pulled from its end."""

from __future__ import annotations

import asyncio
from typing import Any

from aiostream import pipe, stream

from benchmarks.meters import Arrivals, Laps
from benchmarks.works import Participant


def through(value: int) -> int:
    """Pass on."""
    return value


def mapped(length: int, tokens: int) -> Any:
    """Numbers behind `length` maps."""
    found: Any = stream.iterate(range(tokens))
    for _ in range(length):
        found = found | pipe.map(through)
    return found


class Aiostream(Participant):
    """Asynchronous pull."""

    name = "aiostream"

    def chain(self, length: int, tokens: int) -> dict[str, float]:
        """A."""

        async def main() -> dict[str, float]:
            meter = Arrivals(tokens)
            async with mapped(length, tokens).stream() as values:
                async for value in values:
                    meter.take(value)
            return meter.figures(length + 1)

        return asyncio.run(main())

    def flight(self, length: int, tokens: int) -> dict[str, float]:
        """B: each is pulled when the one before is there."""

        async def main() -> dict[str, float]:
            meter = Laps(tokens)
            async with mapped(length, tokens).stream() as values:
                meter.lap()
                async for _ in values:
                    meter.lap()
            return meter.figures(length + 1)

        return asyncio.run(main())

    def join(self, tokens: int) -> dict[str, float]:
        """C, from two sources."""

        async def main() -> dict[str, float]:
            meter = Arrivals(tokens)
            both = stream.zip(mapped(1, tokens), mapped(1, tokens)) | pipe.map(lambda pair: pair[0])
            async with both.stream() as values:
                async for value in values:
                    meter.take(value)
            return meter.figures()

        return asyncio.run(main())


PEERS = [Aiostream()]
