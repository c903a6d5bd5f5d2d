"""The cost of recording: ten ports of a chain, 10,000 tokens per second in total, with a recording and without.

Measured: the processor time of the whole process, the writing thread included, over the same second of the graph's
life, and of the graph's own thread; pairs of runs in turn, in one process, and the median of the pairs' ratios, so that
a machine whose speed drifts tells as little as may be. The functions of the chain do some work, about 10 us each, or
none at all. `python -m benchmarks.bench_recording`
"""

from __future__ import annotations

import argparse
import asyncio
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import hfg

LENGTH = 9
WAVES_HZ = 1000.0
SECONDS = 3.0
PAIRS = 5


@hfg.node
def numbers(*, count: int) -> Iterator[float]:
    """Count."""
    yield from map(float, range(count))


@hfg.node
def idle(value: float) -> float:
    """Pass on."""
    return value


@hfg.node
def works(value: float) -> float:
    """Work for some 10 us, as a small filter does."""
    total = value
    for _ in range(250):
        total += 0.5
    return total


@hfg.node
def sink(value: float) -> None:
    """Take."""


def chain(function: Callable[[], Any], waves: int) -> hfg.Graph:
    """A source, nine functions and a sink: ten ports with an edge."""
    graph = hfg.Graph("chain")
    port: Any = graph.add(numbers(count=waves), max_rate_hz=WAVES_HZ).out
    for number in range(LENGTH):
        node = graph.add(function(), name=f"step_{number}")
        graph.connect(port, node.ports.inputs["value"])
        port = node.ports.outputs["out"]
    graph.connect(port, graph.add(sink()).ports.inputs["value"])
    return graph


def cost(function: Callable[[], Any], file: Path | None, seconds: float) -> tuple[float, float]:
    """Processor seconds of the process, and of the graph's thread, for a second of the graph."""
    graph = chain(function, int(seconds * WAVES_HZ))

    def begin(run: hfg.Run) -> None:
        if file is not None:
            run.record(file, force=True)

    async def once() -> tuple[float, float]:
        process, thread = time.process_time(), time.thread_time()
        await hfg.run_async(graph, begin=begin)
        return (time.process_time() - process) / seconds, (time.thread_time() - thread) / seconds

    with asyncio.Runner(loop_factory=asyncio.SelectorEventLoop) as runner:  # which does not wait actively
        return runner.run(once())


def ratios(function: Callable[[], Any], folder: Path, *, pairs: int, seconds: float) -> dict[str, float]:
    """Compare, in turn."""
    without, recorded = [], []
    cost(function, folder / "warm.mcap", 0.2)
    for _ in range(pairs):
        without.append(cost(function, None, seconds))
        recorded.append(cost(function, folder / "run.mcap", seconds))
    mean: dict[str, float] = {}
    for index, name in enumerate(("process", "thread")):
        mean[f"{name}_without_s"] = statistics.median(one[index] for one in without)
        mean[f"{name}_recorded_s"] = statistics.median(one[index] for one in recorded)
        pairs_of = zip(recorded, without, strict=True)
        mean[f"{name}_ratio"] = statistics.median(after[index] / before[index] for after, before in pairs_of)
    return mean


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=PAIRS)
    parser.add_argument("--seconds", type=float, default=SECONDS)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for name, function in (("no work", idle), ("10 us each", works)):
            found = ratios(function, Path(folder), pairs=chosen.pairs, seconds=chosen.seconds)
            print(f"{name}:")
            for part, words in (("process", "the whole process"), ("thread", "the graph's own thread")):
                before, after = 1e3 * found[f"{part}_without_s"], 1e3 * found[f"{part}_recorded_s"]
                print(f"  {words:22} {before:6.1f} -> {after:6.1f} ms a second, x {found[f'{part}_ratio']:.2f}")


if __name__ == "__main__":
    main()
