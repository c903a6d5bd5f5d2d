"""An edit of one edge, and of one node, in a running graph.

Measured: milliseconds of loop time that `await run.edit(...)` takes while a chain of functions runs and nobody is in
  the middle of a firing: an edge drawn, rubbed out, made active; an edge at the port of a subgraph; a node added.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Sequence
from functools import partial
from statistics import median

import hfg
from benchmarks.measure import Case
from benchmarks.nodes import through
from hfg import commands

DISTRIBUTIONS = ("hfg",)
LENGTHS = (100, 1_000, 10_000)
TIMES = 50
TYPE = "benchmarks.nodes:through"


def chain(length: int) -> hfg.Graph:
    """A chain with a spare node, and a subgraph of some nodes in the middle."""
    length = max(length, 8)
    graph = hfg.Graph("chain")
    previous = graph.add(through(), name="n0")
    for number in range(1, length):
        node = graph.add(through(), name=f"n{number}")
        graph.connect(previous.out, node.ports.inputs["value"])
        previous = node
    graph.add(through(), name="spare")
    middle = length // 2
    graph.edit(commands.Enclose(tuple(f"n{number}" for number in range(middle, min(middle + 10, length - 1))), "box"))
    return graph


def edit(edits: Sequence[commands.Command], length: int) -> float:
    """Milliseconds of the median edit; each is undone, which is not counted."""

    async def main() -> float:
        took = []
        async with hfg.running(chain(length)) as run:
            await run.wait_quiet()
            for _ in range(TIMES):
                began = time.perf_counter()
                await run.edit(*edits)
                took.append(time.perf_counter() - began)
                await run.undo()
        return median(took) * 1000

    return asyncio.run(main())


EDITS = {
    "connect": [commands.Connect("n1.out", "spare.value")],
    "disconnect": [commands.Disconnect("n1.out", "n2.value")],
    "connect behind a subgraph": [commands.Connect("box.out", "spare.value")],
    "make active": [commands.MakeActive("n1.out", "n2.value")],
    "add a node": [commands.Add(TYPE, "another")],
}
CASES = {
    f"{name} | {length}": Case(partial(edit, edits), length, "ms")
    for name, edits in EDITS.items()
    for length in LENGTHS
}
