"""Requests that wait, eight at once: hfg's `concurrency`, and a semaphore with gather as one writes it by hand."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from time import perf_counter

import hfg
from benchmarks.ours import run

__all__ = ["by_hand", "by_hfg"]

AT_ONCE = 8
TAKES_S = 0.08


async def request(number: int) -> int:
    """Wait for another one."""
    await asyncio.sleep(TAKES_S)
    return number


def by_hfg(requests: int) -> dict[str, float]:
    """Seconds until all answers are there, in order."""
    answers = []

    def numbers() -> Iterator[int]:
        yield from range(requests)

    def keep(answer: int) -> None:
        answers.append(answer)

    graph = hfg.Graph("requests")
    asking = graph.add(hfg.node(request)(), concurrency=AT_ONCE)
    graph.connect(graph.add(hfg.node(numbers)()).out, asking.number)
    graph.connect(asking.out, graph.add(hfg.node(keep)()).answer)
    began = perf_counter()
    run(graph)
    return _seconds(began, answers, requests)


def by_hand(requests: int) -> dict[str, float]:
    """The same."""

    async def main() -> list[int]:
        free = asyncio.Semaphore(AT_ONCE)

        async def ask(number: int) -> int:
            async with free:
                return await request(number)

        return await asyncio.gather(*map(ask, range(requests)))

    began = perf_counter()
    return _seconds(began, asyncio.run(main()), requests)


def _seconds(began: float, answers: list[int], requests: int) -> dict[str, float]:
    if answers != list(range(requests)):
        raise RuntimeError(f"{len(answers)} of {requests} answers, or not in order")
    return {"wall": perf_counter() - began}
