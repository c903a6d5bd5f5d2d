"""From 1 to 10,000 nodes: building and checking, the cost of a hop, memory per node.

Measured: `build` is the wall time to make, add, connect and check a chain of 10,000 functions; `hop` the time per
  edge of a run of few tokens through it
(beside a chain of 10 in the same process kind); `memory` what the process grows by per node with one edge, built and
running. Values are small integers.
"""

from __future__ import annotations

import asyncio
import gc
import time
from collections.abc import Callable
from pathlib import Path

import hfg
from benchmarks.bench_hop import chain, through, timed

NODES = 10_000
UNIT = ""


def build() -> float:
    """Seconds to build and check."""
    began = time.perf_counter()
    graph = chain(through, NODES, 1)
    graph.check()
    return time.perf_counter() - began


def hop(length: int, tokens: int) -> Callable[[], float]:
    """Microseconds per hop."""
    return lambda: timed(chain(through, length, tokens), length + 1, tokens)


def resident() -> int:
    """Bytes of this process in memory."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


def memory() -> float:
    """Kilobytes per node with one edge, while its graph runs."""

    async def main() -> float:
        async with hfg.running(chain(through, 10, 1)) as run:
            await run.wait_finished()
        before = resident()
        async with hfg.running(chain(through, NODES, 1)) as run:
            await run.wait_quiet()
            return (resident() - before) / NODES / 1000

    return asyncio.run(main())


CASES: dict[str, Callable[[], float]] = {
    "build and check 10,000 nodes, s": build,
    "hop in a chain of 10, us": hop(10, 18_000),
    "hop in a chain of 100, us": hop(100, 2_000),
    "hop in a chain of 1,000, us": hop(1_000, 1_000),
    "hop in a chain of 10,000, us": hop(NODES, 200),
    "memory per node with one edge, kB": memory,
}


def ratios(medians: dict[str, float]) -> list[str]:
    """The ratio that holds on any machine."""
    return [
        f"hop at 10,000 nodes / at 10: "
        f"{medians['hop in a chain of 10,000, us'] / medians['hop in a chain of 10, us']:.2f}"
    ]
