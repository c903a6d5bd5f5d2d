"""Random graphs, cut at random, over real processes and Zenoh, by `make soak` (rules F7, G1, L1)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

import hfg
from hfg.graph import Graph
from hfg.trace import NodeEnded, TokenSent, TraceEvent
from tests.parts.test_cut_graphs import cut_at_random, run, sequences
from tests.support.making import SYNCHRONOUS, random_plan

pytest.importorskip("zenoh", reason="processes speak over Zenoh")

GRAPHS = 50
ALLOWED = replace(SYNCHRONOUS, boxes=False)  # types that are made on the spot cannot be found by name elsewhere


def run_for_real(build: Callable[[], Graph]) -> tuple[str, list[TraceEvent]]:
    """How a graph in parts ended in real time, and what was seen."""
    trace: list[TraceEvent] = []
    try:
        hfg.run(build(), trace=trace)
    except hfg.errors.RunError as error:
        return type(error).__name__, trace
    return "done", trace


@pytest.mark.soak
@pytest.mark.rule("F7", "G1", "L1")
@pytest.mark.timeout(3600)
def test_graphs_in_real_processes_carry_on_every_edge_what_they_carry_in_one() -> None:
    crossed = 0
    for seed in range(GRAPHS):
        plan = random_plan(seed, ALLOWED)
        build = cut_at_random(plan, seed)
        outcome, trace = run(plan.build)
        found_outcome, found_trace = run_for_real(build)
        assert found_outcome == outcome, f"seed {seed}\n{plan}"
        if outcome != "done":
            continue
        ended = {event.node for event in trace if isinstance(event, NodeEnded)}
        wanted, found = sequences(trace, TokenSent), sequences(found_trace, TokenSent)
        for label in wanted.keys() | found.keys():
            expected, values = wanted.get(label, []), found.get(label, [])
            both = min(len(expected), len(values))
            assert expected[:both] == values[:both], f"seed {seed}, edge {label}\n{plan}"
            if label.split(" -> ")[1].rsplit(".", 1)[0] not in ended:  # its last tokens may be drained on the way
                assert len(expected) == len(values), f"seed {seed}, edge {label}\n{plan}"
            crossed += len(values)
    assert crossed > 0
