"""Random graphs, cut at random into parts: their edges carry what those of the whole do (rules F7, G1, L1)."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable
from typing import Any

import pytest

import hfg
from hfg.engine.runtime.settings import Settings
from hfg.graph import Graph
from hfg.graph.flat import cut, flatten
from hfg.graph.structure.level import level_of
from hfg.parts.local import LocalParts
from hfg.testing.making import SYNCHRONOUS, Allowed, random_plan
from hfg.testing.plans import GraphPlan
from hfg.trace import NodeEnded, TokenSent, TraceEvent

Sequences = dict[str, list[tuple[Any, int]]]


def sequences(trace: list[TraceEvent]) -> Sequences:
    """What was put on each edge: values, markers and modifiers."""
    found: Sequences = {}
    for event in trace:
        if isinstance(event, TokenSent):
            found.setdefault(event.edge, []).append((event.token.value, event.token.activity))
    return found


def cut_at_random(plan: GraphPlan, seed: int) -> Callable[[], Graph]:
    """Build the graph of a plan, its nodes and subgraphs in one to three processes besides the main one."""

    def build() -> Graph:
        choose = random.Random(seed)
        graph = plan.build()
        names = [f"process{number}" for number in range(choose.randint(1, 3))]
        for name in names:
            graph.group(name, process=True)
        for node in level_of(graph).nodes.values():
            where = choose.choice([None, *names])
            if where is not None:
                graph.move(node, group=where)
        return graph

    return build


def run_whole(plan: GraphPlan) -> tuple[str, list[TraceEvent]]:
    trace: list[TraceEvent] = []
    try:
        hfg.run(plan.build(), clock="virtual", trace=trace)
    except hfg.errors.RunError as error:
        return type(error).__name__, trace
    return "done", trace


def run_cut(build: Callable[[], Graph], fuse_after: int | None) -> tuple[str, dict[str, list[TraceEvent]]]:
    """How a graph in parts ended, and what each part has seen."""
    traces: dict[str, list[TraceEvent]] = {}

    def settings(name: str) -> Settings:
        made = Settings(trace=traces.setdefault(name, []))
        if fuse_after is not None:
            made.fuse_after = fuse_after
        return made

    async def run() -> str:
        try:
            await LocalParts(build, settings).run()
        except hfg.errors.RunError as error:
            return type(error).__name__
        return "done"

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        return runner.run(run()), traces


def difference(plan: GraphPlan, seed: int, fuse_after: int | None = None) -> str | None:
    """Where the cut graph does otherwise than the whole, by rule F7 with its exceptions."""
    outcome, trace = run_whole(plan)
    found_outcome, traces = run_cut(cut_at_random(plan, seed), fuse_after)
    if outcome != found_outcome:
        return f"the whole is {outcome}, the parts are {found_outcome}"
    wanted = sequences(trace)
    ended = {event.node for event in trace if isinstance(event, NodeEnded)}
    parts = {name: sequences(seen) for name, seen in traces.items()}
    for name, found in parts.items():
        for label, values in found.items():
            expected = wanted.get(label, [])
            both = min(len(expected), len(values))
            may_be_cut_short = outcome != "done" or label.split(" -> ")[1].rsplit(".", 1)[0] in ended
            if expected[:both] != values[:both] or (len(expected) != len(values) and not may_be_cut_short):
                return f'part "{name}", edge {label}: {values}\nin place of {expected}'
    if outcome == "done":
        missing = [label for label in wanted if not any(label in found for found in parts.values())]
        if missing:
            return f"nothing ever came over {missing}"
    return None


@pytest.mark.rule("F7", "G1", "L1")
@pytest.mark.parametrize("block", range(20))
def test_what_runs_over_every_edge_does_not_depend_on_where_a_graph_is_cut(block: int) -> None:
    for seed in range(25 * block, 25 * block + 25):
        plan = random_plan(seed, SYNCHRONOUS)
        found = difference(plan, seed, fuse_after=0 if seed % 2 else None)
        assert found is None, f"{found}\n{plan}"


@pytest.mark.rule("F7", "G1", "L1", "L2")
@pytest.mark.parametrize("block", range(10))
def test_as_much_comes_over_real_links_as_in_one_piece(block: int) -> None:
    for seed in range(20 * block, 20 * block + 20):
        plan = random_plan(seed, SYNCHRONOUS)
        outcome, trace = run_whole(plan)
        ended = {event.node for event in trace if isinstance(event, NodeEnded)}
        found, edges = "done", {}
        try:
            edges = hfg.run(cut_at_random(plan, seed)(), clock="virtual").edges
        except hfg.errors.RunError as error:
            found = type(error).__name__
        assert found == outcome, f"{plan}"
        if outcome != "done":
            continue
        wanted = {label: len(tokens) for label, tokens in sequences(trace).items()}
        for label in edges.keys() | wanted.keys():
            count = edges[label].sent if label in edges else 0
            if label.split(" -> ")[1].rsplit(".", 1)[0] not in ended:  # its last tokens may be drained on the way
                assert count == wanted.get(label, 0), f"edge {label}\n{plan}"


@pytest.mark.rule("L1", "R5", "F8", "F13", "A8")
@pytest.mark.parametrize("block", range(4))
def test_graphs_with_everything_end_as_they_do_in_one_piece(block: int) -> None:
    """Where events decide, the order is another's; but all comes to its end, and to the same one."""
    for seed in range(3000 + 25 * block, 3000 + 25 * block + 25):
        plan = random_plan(seed, Allowed(disabling=False))
        outcome, _ = run_whole(plan)
        build = cut_at_random(plan, seed)
        if cut(flatten(build())).findings:
            continue  # a gate, or the ports of a subgraph, whose nodes are in several processes
        found, _ = run_cut(build, None)
        assert found == outcome, f"{found} in place of {outcome}\n{plan}"
