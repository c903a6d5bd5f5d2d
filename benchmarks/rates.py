"""How true a rate is kept on the real clock: hfg's `max_rate_hz`, and the timers that one writes by hand."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from time import perf_counter

import hfg
from benchmarks.ours import run

__all__ = ["by_asyncio", "by_asyncio_without_bursts", "by_hfg", "error"]

Ticker = Callable[[int, int, Callable[[], None]], None]


def by_hfg(rate_hz: int, times: int, tick: Callable[[], None]) -> None:
    """Let a source with a rate tick (F11)."""

    def ticks() -> Iterator[int]:
        for number in range(times):
            tick()
            yield number

    graph = hfg.Graph("rate")
    graph.add(hfg.node(ticks)(), max_rate_hz=rate_hz)
    run(graph)


def by_asyncio(rate_hz: int, times: int, tick: Callable[[], None]) -> None:
    """Sleep until the next tick of an absolute schedule: errors do not add up, and nothing is left out."""

    async def main() -> None:
        loop = asyncio.get_running_loop()
        began = loop.time()
        for number in range(times):
            await asyncio.sleep(began + number / rate_hz - loop.time())
            tick()

    asyncio.run(main())


def by_asyncio_without_bursts(rate_hz: int, times: int, tick: Callable[[], None]) -> None:
    """The same by rule F11: what was missed by more than a period is not made up, so pauses of the machine cost."""

    async def main() -> None:
        loop = asyncio.get_running_loop()
        began = loop.time()
        number = 0
        for _ in range(times):
            await asyncio.sleep(began + number / rate_hz - loop.time())
            tick()
            number = max(number, int((loop.time() - began) * rate_hz)) + 1

    asyncio.run(main())


def error(ticker: Ticker, rate_hz: int, times: int) -> dict[str, float]:
    """Percent by which the mean rate differs from what was asked for.

    Beside it: milliseconds that a hundredth of the ticks exceed, being later than their place on the first one's grid.
    """
    ticks: list[float] = []
    ticker(rate_hz, times, lambda: ticks.append(perf_counter()))
    if len(ticks) != times or times < 2:
        raise RuntimeError(f"{len(ticks)} of {times} ticks; at least two and all have to be made")
    mean_hz = (times - 1) / (ticks[-1] - ticks[0])
    late = sorted((at - ticks[0]) * 1000 - number * 1000 / rate_hz for number, at in enumerate(ticks))
    return {"error": abs(mean_hz / rate_hz - 1) * 100, "late p99 ms": late[len(late) * 99 // 100]}
