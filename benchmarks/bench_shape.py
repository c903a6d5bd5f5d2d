"""From 1 to 10,000 nodes: building and checking, the cost of a hop, memory per node.

Measured: `build and check` is the wall time to make, add, connect and check a chain of functions; `hop` the time an
  edge takes in the steady state of a run through such a chain; `memory` what the process grows by per node with one
  edge, built and running.
"""

from __future__ import annotations

import asyncio
import gc
import time
from functools import partial
from pathlib import Path

import hfg
from benchmarks.measure import Case
from benchmarks.meters import Arrivals
from benchmarks.nodes import through
from benchmarks.ours import Kind

DISTRIBUTIONS = ("hfg",)
LENGTHS = (1, 10, 100, 1_000, 10_000)
HOPS = 200_000
LEAST_TOKENS = 300
"""Fewer would not reach a steady state: what fires together is fused after some firings."""
LARGEST = LENGTHS[-1]
FUNCTION = Kind("function", through)


def chain(length: int) -> hfg.Graph:
    """A chain that is run with one token or not at all."""
    return FUNCTION.chain_graph(length, 1, Arrivals(1))


def build(length: int) -> dict[str, float]:
    """Seconds to build and check, by the clock and of the processor."""
    began, began_cpu = time.perf_counter(), time.process_time()
    chain(length).check()
    return {"wall": time.perf_counter() - began, "cpu": time.process_time() - began_cpu}


def resident() -> int:
    """Bytes of this process in memory, where the system tells it in this way."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


def memory(length: int) -> float:
    """Kilobytes per node with one edge, while its graph runs."""

    async def main() -> float:
        async with hfg.running(chain(10)) as run:
            await run.wait_finished()
        before = resident()
        async with hfg.running(chain(length)) as run:
            await run.wait_quiet()
            return (resident() - before) / length / 1000

    return asyncio.run(main())


CASES = {
    f"hop | {length}": Case(partial(FUNCTION.chain, length), max(LEAST_TOKENS, HOPS // length)) for length in LENGTHS
}
CASES |= {f"build and check | {length}": Case(build, length, "s") for length in LENGTHS[2:]}
if Path("/proc/self/statm").exists():
    CASES[f"memory of a node | {LARGEST}"] = Case(memory, LARGEST, "kB")
