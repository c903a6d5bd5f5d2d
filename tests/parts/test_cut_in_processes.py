"""Random graphs in real processes carry on every edge what they carry in one (rules A10, F7, L1, T5).

A process takes about as long to begin as a hundred graphs take to run, so each run has several graphs side by side.
"""

from __future__ import annotations

import random
from dataclasses import replace

import pytest

import hfg
from hfg.graph.structure.level import level_of
from hfg.testing.plans import GraphPlan
from hfg.trace import NodeEnded, TokenSent, TokenTaken, TraceEvent
from tests.parts.lit import lit, side_by_side
from tests.parts.test_cut_graphs import run, sequences
from tests.support.making import SYNCHRONOUS, random_plan

pytestmark = pytest.mark.slow

pytest.importorskip("zenoh", reason="processes speak over Zenoh")

ALLOWED = replace(SYNCHRONOUS, boxes=False)  # types that are made on the spot cannot be found by name elsewhere
TOGETHER = 10


def done_plans(first: int, count: int) -> list[GraphPlan]:
    """So many plans whose graphs, whole, come to a good end; of others nothing is known behind their end."""
    found: list[GraphPlan] = []
    seed = first
    while len(found) < count:
        plan = lit(random_plan(seed, ALLOWED), seed)
        if run(plan.build)[0] == "done":
            found.append(plan)
        seed += 1
    return found


def cut_behind_sources(plan: GraphPlan, seed: int) -> hfg.Graph:
    """Sources stay in the main part, which goes first; what they send is soon in the two others."""
    choose = random.Random(seed)
    graph = plan.build()
    for name in ("here", "there"):
        graph.group(name, process=True)
    for node in level_of(graph).nodes.values():
        if node.ports.inputs or choose.random() < 0.2:
            graph.move(node, group=choose.choice(["loop", "here", "here", "there", "there"]))
    return graph


@pytest.mark.rule("A10", "F7", "L1", "T5")
@pytest.mark.parametrize("block", range(5))
def test_what_runs_over_every_edge_is_the_same_in_real_processes(block: int) -> None:
    plan = side_by_side(done_plans(1000 * block, TOGETHER))
    outcome, wanted_trace = run(plan.build)
    assert outcome == "done"
    trace: list[TraceEvent] = []
    hfg.run(cut_behind_sources(plan, block), trace=trace)
    ended = {event.node for event in wanted_trace if isinstance(event, NodeEnded)}
    for kind in (TokenSent, TokenTaken):
        wanted, found = sequences(wanted_trace, kind), sequences(trace, kind)
        assert found
        for label in wanted.keys() | found.keys():
            expected, values = wanted.get(label, []), found.get(label, [])
            both = min(len(expected), len(values))
            assert expected[:both] == values[:both], f"edge {label}\n{plan}"
            if label.split(" -> ")[1].rsplit(".", 1)[0] not in ended:  # its last tokens may be drained on the way
                assert len(expected) == len(values), f"edge {label}\n{plan}"
    sent, taken = stamps(trace, TokenSent), stamps(trace, TokenTaken)
    for edge in plan.edges:
        label = f"{edge.source[0]}.{edge.source[2]} -> {edge.target[0]}.{edge.target[2]}"
        if "initial" in edge.options or label not in taken:
            continue
        found_stamps = taken[label]
        assert found_stamps == sent[label][: len(found_stamps)], f"edge {label}\n{plan}"


def stamps(trace: list[TraceEvent], kind: type[TokenSent] | type[TokenTaken]) -> dict[str, list[float]]:
    """The stamps of what was put on each edge, or taken from it."""
    found: dict[str, list[float]] = {}
    for event in trace:
        if isinstance(event, kind):
            found.setdefault(event.edge, []).append(event.token.stamp)
    return found
