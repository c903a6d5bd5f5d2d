"""asyncio.Queue(1) and a task per node: what one writes without a framework."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from itertools import pairwise

from benchmarks.meters import Arrivals, Laps
from benchmarks.works import Participant

Queue = asyncio.Queue[int]
LAST = -1


async def through(before: Queue, *after: Queue) -> None:
    """Pass on until the last one."""
    value = 0
    while value != LAST:
        value = await before.get()
        for queue in after:
            await queue.put(value)


async def through_waiting(before: Queue, after: Queue) -> None:
    """Pass on after one more pass of the loop, until the last one."""
    value = 0
    while value != LAST:
        value = await before.get()
        await asyncio.sleep(0)
        await after.put(value)


async def consume(before: Queue, take: Callable[[int], None]) -> None:
    """Take until the last one."""
    while (value := await before.get()) != LAST:
        take(value)


async def produce(tokens: int, after: Queue) -> None:
    """Count, and say that it was the last."""
    for value in range(tokens):
        await after.put(value)
    await after.put(LAST)


async def all_of(*works: Awaitable[None]) -> None:
    """A task each."""
    await asyncio.gather(*works)


class Queues(Participant):
    """A place for one value between each two tasks: the back-pressure of a chain, by the standard library."""

    name = "asyncio.Queue(1)"

    def __init__(self, node: Callable[[Queue, Queue], Awaitable[None]] = through) -> None:
        self.node = node

    def chain(self, length: int, tokens: int) -> dict[str, float]:
        """A."""
        meter = Arrivals(tokens)

        async def main() -> None:
            queues = [Queue(1) for _ in range(length + 1)]
            nodes = [self.node(before, after) for before, after in pairwise(queues)]
            await all_of(produce(tokens, queues[0]), *nodes, consume(queues[-1], meter.take))

        asyncio.run(main())
        return meter.figures(length + 1)

    def flight(self, length: int, tokens: int) -> dict[str, float]:
        """B: the source takes what comes out at the end."""
        meter = Laps(tokens)

        async def main() -> None:
            queues = [Queue(1) for _ in range(length + 1)]

            async def source() -> None:
                for value in range(tokens):
                    meter.lap()
                    await queues[0].put(value)
                    await queues[-1].get()
                meter.lap()
                await queues[0].put(LAST)

            await all_of(source(), *(self.node(before, after) for before, after in pairwise(queues)))

        asyncio.run(main())
        return meter.figures(length + 1)

    def join(self, tokens: int) -> dict[str, float]:
        """C."""
        meter = Arrivals(tokens)

        async def main() -> None:
            source, left, right, left_out, right_out, joined = (Queue(1) for _ in range(6))

            async def both() -> None:
                value = 0
                while value != LAST:
                    value = await left_out.get()
                    await right_out.get()
                    await joined.put(value)

            await all_of(
                produce(tokens, source),
                through(source, left, right),
                through(left, left_out),
                through(right, right_out),
                both(),
                consume(joined, meter.take),
            )

        asyncio.run(main())
        return meter.figures()


PEERS = [Queues()]
