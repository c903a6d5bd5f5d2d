"""Random graphs, cut at random into parts: their edges carry what those of the whole do (rules F7, G1, L1)."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

import pytest

import hfg
from hfg.engine.runtime import settings
from hfg.graph import Graph
from hfg.graph.structure.level import level_of
from hfg.parts.processes import launching
from hfg.testing.plans import GraphPlan
from hfg.trace import NodeEnded, TokenSent, TokenTaken, TraceEvent
from hfg_transports.memory import Faults, Network
from tests.parts.lit import lit
from tests.semantics.test_random_graphs import reference
from tests.support.making import SYNCHRONOUS, Allowed, random_plan

pytestmark = pytest.mark.slow

Sequences = dict[str, list[tuple[Any, int]]]


def sequences(trace: list[TraceEvent], kind: type[TokenSent] | type[TokenTaken]) -> Sequences:
    """What was put on each edge, or taken from it: values, markers and modifiers."""
    found: Sequences = {}
    for event in trace:
        if isinstance(event, kind):
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


def run(build: Callable[[], Graph]) -> tuple[str, list[TraceEvent]]:
    """How a graph ended, in one part or in several, and what was seen."""
    trace: list[TraceEvent] = []
    try:
        hfg.run(build(), clock="virtual", trace=trace)
    except hfg.errors.RunError as error:
        return type(error).__name__, trace
    return "done", trace


def difference(plan: GraphPlan, seed: int) -> str | None:
    """Where the cut graph does otherwise than the whole, by rule F7 with its exceptions."""
    outcome, trace = run(plan.build)
    found_outcome, found_trace = run(cut_at_random(plan, seed))
    if outcome != found_outcome:
        return f"the whole is {outcome}, the parts are {found_outcome}"
    ended = {event.node for event in trace if isinstance(event, NodeEnded)}
    for kind in (TokenSent, TokenTaken):
        wanted, found = sequences(trace, kind), sequences(found_trace, kind)
        for label, values in found.items():
            expected = wanted.get(label, [])
            both = min(len(expected), len(values))
            may_be_cut_short = outcome != "done" or label.split(" -> ")[1].rsplit(".", 1)[0] in ended
            if expected[:both] != values[:both] or (len(expected) != len(values) and not may_be_cut_short):
                return f"edge {label}, {kind.__name__}: {values}\nin place of {expected}"
        if outcome == "done" and kind is TokenSent and wanted.keys() - found.keys():
            return f"nothing ever came over {wanted.keys() - found.keys()}"
    return None


@pytest.mark.rule("F7", "G1", "L1", "L2")
@pytest.mark.parametrize("block", range(10))
def test_what_runs_over_every_edge_does_not_depend_on_where_a_graph_is_cut(
    block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    for seed in range(25 * block, 25 * block + 25):
        plan = random_plan(seed, SYNCHRONOUS)
        monkeypatch.setattr(settings, "FUSE_AFTER", 0 if seed % 2 else 25)
        found = difference(plan, seed)
        assert found is None, f"{found}\n{plan}"


@pytest.mark.rule("A10", "F7", "L1")
@pytest.mark.parametrize("block", range(4))
def test_nothing_overtakes_start_on_its_way_to_another_part(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Data and the word to begin come at different times, over a network with delays."""
    seed = 0

    class Delayed(launching.LoopLauncher):
        def __init__(self) -> None:
            super().__init__(network=Network(Faults(loss=0.3, delay_s=(0.0, 0.004)), seed=seed))

    monkeypatch.setattr(launching, "LoopLauncher", Delayed)
    for seed in range(4000 + 25 * block, 4000 + 25 * block + 25):
        plan = lit(random_plan(seed, SYNCHRONOUS), seed)
        found = difference(plan, seed)
        assert found is None, f"{found}\n{plan}"


@pytest.mark.rule("L1", "R5", "F8", "F13", "A8")
@pytest.mark.parametrize("block", range(4))
def test_graphs_with_everything_end_as_they_do_in_one_piece(block: int) -> None:
    """Where events decide, the order is another's; but all comes to its end, and to the same one."""
    for seed in range(3000 + 25 * block, 3000 + 25 * block + 25):
        plan = random_plan(seed, Allowed(disabling=False, doing=seed % 4 == 3))
        build = cut_at_random(plan, seed)
        if any(problem.check == "process-border" and problem.severity == "error" for problem in build().check()):
            continue  # a gate with nodes in several processes, or a subgraph meant itself
        if reference(plan, seed) is None:
            continue  # it goes round and round
        outcome, _ = run(plan.build)
        found, _ = run(build)
        assert found == outcome, f"{found} in place of {outcome}\n{plan}"
