"""The counterpart of examples/many_requests.py in plain asyncio, with the same abilities: what hfg is compared with.

So many at once and no more, from a source that does not run ahead, each attempt with a time limit, tried again with
a growing pause, what fails for good left out and counted, answers in the order of the questions, counts at the end.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from dataclasses import dataclass, field

from examples.many_requests import AT_ONCE, BACKOFF_S, LIMIT_S, RETRIES, request


@dataclass
class Requests:
    """What was asked, and what became of it."""

    port: int = 0
    answers: list[int] = field(default_factory=list)
    asked: int = 0
    retries: int = 0
    failed: int = 0

    async def ask(self, number: int) -> int | None:
        self.asked += 1
        for attempt in range(RETRIES + 1):
            try:
                async with asyncio.timeout(LIMIT_S):
                    return await request(number, self.port)
            except (OSError, TimeoutError):
                if attempt < RETRIES:
                    self.retries += 1
                    await asyncio.sleep(BACKOFF_S * 2**attempt)
        self.failed += 1
        return None

    async def run(self, numbers: Iterator[int]) -> None:
        """Keep so many under way, and take in the answers in order."""
        waiting: asyncio.Queue[asyncio.Task[int | None] | None] = asyncio.Queue()
        free = asyncio.Semaphore(AT_ONCE)

        async def begin(tasks: asyncio.TaskGroup) -> None:
            for number in numbers:
                await free.acquire()
                waiting.put_nowait(tasks.create_task(self.ask(number)))
            waiting.put_nowait(None)

        async with asyncio.TaskGroup() as tasks:
            beginning = tasks.create_task(begin(tasks))
            while (task := await waiting.get()) is not None:
                answer = await task
                free.release()
                if answer is not None:
                    self.answers.append(answer)
            await beginning

    def __str__(self) -> str:
        return f"{self.asked} asked, {self.retries} tried again, {self.failed} failed, {len(self.answers)} answers"
