"""Costs that users meet: many short runs, large graphs in which little is active, states that are subgraphs, edits.

Measured: processor time. `a small graph`: `hfg.run` of a source and two nodes from beginning to end, again and again.
  `an edit`: `run.edit` of an edge at a member of a fused chain that runs. `100 states`: a step round a ring of 100
  subgraphs, beside one round 10. `10,000 nodes`: a wave of chains of ten, of which a node in a hundred is active,
  beside the same with none. `a mission`: a tick of nine tasks with a repair each, and a battery, beside a behaviour
  tree of 30 nodes.
Not measured: start and end of the runs, but for the small graph.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from itertools import pairwise
from statistics import median
from time import process_time
from typing import Any

import hfg
from benchmarks.alive import LENGTH, Looks, Stays, Stopwatch, flat, take
from benchmarks.bench_alive import by_hfg, ratio
from benchmarks.goals import Goal, Side
from benchmarks.measure import Case
from benchmarks.nodes import through
from hfg import commands

DISTRIBUTIONS = ("hfg", "py_trees")
SHOWS_CASES = True
WAVES = 200
TASKS = 9
TICKS = 2


class Task(hfg.Node):
    """A task of the mission: done after some ticks, then the next one is active."""

    done = hfg.Event()
    wrong = hfg.Event()
    left = TICKS

    @hfg.slot(while_active=True)
    def tick(self) -> None:
        self.left -= 1
        if not self.left:
            self.left = TICKS
            self.done.trigger()

    @hfg.slot
    def begin(self) -> None:
        pass


class Battery(hfg.Node):
    """Looks at each tick whether the mission may go on."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    low = hfg.Event()

    def process(self, value: int) -> int:
        if value < 0:
            self.low.trigger()
        return value


def tree(watch: Stopwatch) -> hfg.Graph:
    """Nine tasks one after another, each with one that repairs it, and a battery."""
    graph = hfg.Graph("tree")
    battery, charge = graph.add(Battery()), graph.add(Task(), name="charge")
    graph.connect(graph.add(watch.source()).out, battery.value)
    graph.connect(battery.low, charge.begin)
    tasks = [graph.add(Task(), name=f"task{number}") for number in range(TASKS)]
    for number, (task, following) in enumerate(pairwise([*tasks, tasks[0]])):
        repair = graph.add(Task(), name=f"repair{number}")
        task.wrong.activates(repair.begin)
        repair.done.activates(following.begin)
        task.done.activates(following.begin)
        graph.connect(battery.out, task.tick)
        graph.connect(battery.out, repair.tick)
    graph.start.activates(tasks[0].begin)
    return graph


def beside_py_trees(ticks: int) -> dict[str, float]:
    """Microseconds a tick, of both, and their ratio."""
    peer = import_module("benchmarks.peers.with_py_trees").Mission(TASKS, TICKS)
    return ratio(lambda: by_hfg(tree, ticks), lambda: peer.tick(ticks)["cpu"])


def wide(nodes: int, active: bool, watch: Stopwatch) -> hfg.Graph:
    """Chains of ten behind one source; of each tenth chain a node is active for good."""
    graph = hfg.Graph("wide")
    out = graph.add(watch.source()).out
    for number in range(-(-nodes // LENGTH)):
        last: Any = out
        for place in range(LENGTH):
            odd = active and place == 0 and number % 10 == 0
            node = graph.add(Looks() if odd else through(), name=f"n{number}_{place}")
            graph.connect(last, node.value)
            if isinstance(node, Looks):
                graph.start.activates(node.begin)
            last = node.out
        graph.connect(last, graph.add(take(), name=f"take{number}").value)
    return graph


def one_in_a_hundred(nodes: int) -> dict[str, float]:
    """Microseconds a wave, with and without active nodes, and the ratio."""
    return ratio(lambda: by_hfg(partial(wide, nodes, True), WAVES), lambda: by_hfg(partial(wide, nodes, False), WAVES))


class State(hfg.Subgraph):
    """A state with an inside."""

    hear = hfg.slot(type=int)
    enter = hfg.slot(type=object)
    left = hfg.Event()

    def build(self, graph: hfg.Graph) -> None:
        inner = graph.add(Stays(), name="inner")
        graph.connect(self.hear.inner, inner.hear)
        self.enter.inner.activates(inner.enter)
        inner.left.activates(self.left.inner)


def subgraphs(count: int, watch: Stopwatch) -> hfg.Graph:
    """A ring of states that are subgraphs, and one letter again and again."""
    graph = hfg.Graph("subgraphs")
    out = graph.add(watch.source()).out
    nodes = [graph.add(State(), name=f"s{number}") for number in range(count)]
    for before, behind in pairwise([*nodes, nodes[0]]):
        graph.connect(out, before.hear)
        before.left.activates(behind.enter)
    graph.start.activates(nodes[0].enter)
    return graph


def hundred_states(steps: int) -> dict[str, float]:
    """Microseconds a step round 100 states and round 10, and the ratio."""
    return ratio(lambda: by_hfg(partial(subgraphs, 100), steps), lambda: by_hfg(partial(subgraphs, 10), steps))


@hfg.node
def three() -> Iterator[int]:
    """Count to three."""
    yield from range(3)


def small(times: int) -> float:
    """Microseconds of a run of a small graph; that is what a unit test of a graph costs."""
    began = process_time()
    for _ in range(times):
        graph = hfg.Graph("small")
        node = graph.add(through())
        graph.connect(graph.add(three()).out, node.value)
        graph.connect(node.out, graph.add(take()).value)
        hfg.run(graph)
    return (process_time() - began) * 1e6 / times


class Spare(hfg.Node):
    """Takes what an edit leads to it."""

    value = hfg.Input(int, optional=True)

    def process(self, value: int | None) -> None:
        pass


def edits(times: int) -> dict[str, float]:
    """Microseconds of an edit; the next one comes when the chain is fused again."""
    watch = Stopwatch(100_000_000)
    graph = flat(watch)
    graph.add(Spare(), name="spare")

    async def main() -> float:
        async with hfg.running(graph, block_warning_s=0) as run:
            took = []
            for _ in range(times):
                while not run.explain("n5")["n5"].fused:  # noqa: ASYNC110 - waves go on meanwhile
                    await asyncio.sleep(0)
                began = process_time()
                await run.edit(commands.Connect("n5.out", "spare.value"))
                took.append(process_time() - began)
                await run.undo()
            return median(took) * 1e6

    return {"cpu": asyncio.run(main())}


CASES = {
    "a small graph, run from beginning to end": Case(small, 10_000),
    "an edit in a fused chain of ten, as it runs": Case(edits, 200),
    "10,000 nodes, one in a hundred active": Case(one_in_a_hundred, 10_000, "x"),
    "100 states that are subgraphs / 10": Case(hundred_states, 5_000, "x"),
}
SKIPPED: dict[str, str] = {}
_TREE = "a mission as an activity graph / as a behaviour tree of 30 nodes"
if find_spec("py_trees") is None:
    SKIPPED[_TREE] = "py_trees is not installed"
else:
    CASES[_TREE] = Case(beside_py_trees, 20_000, "x")
GOALS = [Goal(_TREE, Side(_TREE, "ratio"), 1.0, 0.5)]
