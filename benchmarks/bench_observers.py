"""What looking at a run costs: a chain of 10 functions with nobody, statistics, a recorder, a tap, monitors.

Measured: the wall time of a run divided by its hops, the best of several short runs in a fresh process; values are
small integers and user code adds nothing. An observer's price is its case less `nobody`, on the same machine in turn.

`python -m benchmarks.bench_observers --against REVISION` compares this tree with another revision of it, with nobody
looking: pairs of fresh processes in turn, the ratio of the minima, and beside it the ratio of this tree with itself.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import hfg
from hfg import monitors as m

LENGTH = 10
REPEATS = 12
TOKENS = 2_000


@hfg.node
def numbers(*, count: int = 10) -> Iterator[int]:
    """Count."""
    yield from range(count)


@hfg.node
def through(value: int) -> int:
    """Pass on."""
    return value


@hfg.node
def sink(value: int) -> None:
    """Take."""


def chain(tokens: int) -> hfg.Graph:
    """A source, ten functions and a sink: eleven hops."""
    graph = hfg.Graph("chain")
    port: Any = graph.add(numbers(count=tokens)).out
    for _ in range(LENGTH):
        node = graph.add(through())
        graph.connect(port, node.ports.inputs["value"])
        port = node.ports.outputs["out"]
    graph.connect(port, graph.add(sink()).ports.inputs["value"])
    return graph


def hop(look: Callable[[Any], Any], tokens: int) -> float:
    """Microseconds a hop, the best of several runs."""

    async def once() -> float:
        async with hfg.running(chain(tokens)) as run:
            kept = look(run)  # what looks, until the run is over
            began = time.perf_counter()
            await run.wait_finished()
            took = time.perf_counter() - began
            del kept
            return took

    return min(asyncio.run(once()) for _ in range(REPEATS)) / tokens / (LENGTH + 1) * 1e6


def nobody(run: Any) -> None:
    """Look at nothing."""


def statistics(run: Any) -> Any:
    """Measure times."""
    return run.statistics()


def recorder(run: Any) -> Any:
    """Record the whole trace."""
    return run.trace([])


def function(run: Any) -> Any:
    """A function at the trace that does nothing."""
    return run.trace(lambda _event: None)


def tap(run: Any) -> Any:
    """Look at one edge in the middle."""
    return run.tap("through_5.out")


def monitors(run: Any) -> Any:
    """Ten monitors, each at an edge of its own."""
    edges = ["through.out", *(f"through_{number}.out" for number in range(2, LENGTH + 1))]
    never: Any = {f"edge_{number}": m.never(m.sent(edge, _is_negative)) for number, edge in enumerate(edges)}
    return m.watch(run, **never)


def _is_negative(value: int) -> bool:
    return value < 0


def against(revision: str, pairs: int) -> None:
    """Compare with another revision and print the ratios."""
    root = Path(__file__).resolve().parent.parent
    with tempfile.TemporaryDirectory() as folder:
        archive = subprocess.run(["git", "archive", revision, "hfg"], cwd=root, check=True, capture_output=True)
        subprocess.run(["tar", "-x", "-C", folder], input=archive.stdout, check=True)
        trees = {"before": folder, "here": str(root), "here again": str(root)}
        found: dict[str, list[float]] = {name: [] for name in trees}
        for number in range(pairs):
            order = list(trees) if number % 2 else list(reversed(trees))
            for name in order:
                found[name].append(_process(trees[name]))
            print(f"\r{number + 1} of {pairs}", end="", file=sys.stderr, flush=True)
    best = {name: min(values) for name, values in found.items()}
    for name, value in best.items():
        print(f"{name:12} {value:.4f} us a hop, the best of {pairs}")
    print(f"here / before     {best['here'] / best['before']:.3f}")
    print(f"here / here again {best['here'] / best['here again']:.3f}   (what the machine alone makes of it)")


def _process(tree: str) -> float:
    command = [sys.executable, str(Path(__file__).resolve()), "--alone"]
    environment = {**os.environ, "PYTHONPATH": tree}
    done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True, check=True, timeout=300)
    return float(done.stdout)


def main() -> None:
    """Compare two revisions."""
    parser = argparse.ArgumentParser(description="What hfg costs with nobody looking, against another revision.")
    parser.add_argument("--against", metavar="REVISION", help="of this repository")
    parser.add_argument("--pairs", type=int, default=30)
    parser.add_argument("--alone", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.alone:
        print(hop(nobody, TOKENS))
    elif arguments.against:
        against(arguments.against, arguments.pairs)
    else:
        parser.error("say --against REVISION; python -m benchmarks bench_observers measures what observers cost")


if __name__ == "__main__":
    main()
else:
    from benchmarks.measure import Case

    CASES = {
        name: Case(partial(hop, look), TOKENS)
        for name, look in {
            "nobody": nobody,
            "statistics": statistics,
            "recorder of the whole trace": recorder,
            "function at the trace": function,
            "tap on one edge of eleven": tap,
            "ten monitors on ten edges": monitors,
        }.items()
    }
