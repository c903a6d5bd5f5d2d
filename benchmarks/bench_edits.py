"""An edit of one edge, and of one node, in a running graph.

Measured: milliseconds of loop time that `await run.edit(...)` takes while a chain of functions runs and nobody is in
  the middle of a firing: an edge drawn, removed, made active; an edge at the port of a subgraph; a node added, removed
  from the end and from the middle with its edges, put between two others, copied, replaced.
Not measured: the first edit of a run, which makes the index by which the others find what they touch.
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
            await run.edit(*edits)
            await run.undo()
            for _ in range(TIMES):
                began = time.perf_counter()
                await run.edit(*edits)
                took.append(time.perf_counter() - began)
                await run.undo()
        return median(took) * 1000

    return asyncio.run(main())


BETWEEN: list[commands.Command] = [
    commands.Disconnect("n1.out", "n2.value"),
    commands.Add(TYPE, "another"),
    commands.Connect("n1.out", "another.value"),
    commands.Connect("another.out", "n2.value"),
]
EDITS: dict[str, list[commands.Command]] = {
    "connect": [commands.Connect("n1.out", "spare.value")],
    "disconnect": [commands.Disconnect("n1.out", "n2.value")],
    "connect behind a subgraph": [commands.Connect("box.out", "spare.value")],
    "make active": [commands.MakeActive("n1.out", "n2.value")],
    "add a node": [commands.Add(TYPE, "another")],
    "remove a node": [commands.Remove("spare")],
    "remove a node with edges": [commands.Remove("n3")],
    "put a node between two": BETWEEN,
    "copy a node": [commands.Copy("n2", "another")],
    "replace a node": [commands.Replace("n2", TYPE)],
}
CASES = {
    f"{name} | {length}": Case(partial(edit, edits), length, "ms")
    for name, edits in EDITS.items()
    for length in LENGTHS
}
