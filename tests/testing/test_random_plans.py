"""What occurs in the graphs that the tests draw at random: each combination in which something was wrong once.

`tests/semantics/test_random_graphs.py` and the soak draw from the same. Where the structure alone does not say it,
the oracle runs the graphs that may have it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import pytest

from hfg.base.token import END
from hfg.testing import reference_run
from hfg.testing.plans import EdgePlan, GraphPlan, NodePlan
from hfg.testing.reference import ReferenceReport
from hfg.trace import ActivityChanged, TokenDrained, TokenDropped, TokenSent
from tests.support.making import WIDE, random_plan
from tests.support.operators import WITH_TIME

SEEDS = range(500)
PLANS = [random_plan(seed, WIDE) for seed in SEEDS]
THREADS = [random_plan(seed, replace(WIDE, threads=True, lossy=False, gates=False)) for seed in range(40)]
SOURCES = ("script", "Script", "ascript", "Hums")


def nodes(plan: GraphPlan, *types: str) -> list[NodePlan]:
    return [node for node in plan.nodes if node.type in types]


def into(plan: GraphPlan, node: NodePlan) -> list[EdgePlan]:
    return [edge for edge in plan.edges if edge.target[0] == node.name]


def is_fed_by_events(plan: GraphPlan) -> bool:
    return any(edge.source[1] == "event" and edge.target[1] == "input" for edge in plan.edges)


# --- what the structure says

STRUCTURE: dict[str, Callable[[GraphPlan], object]] = {
    "an operator with a scheduler on an edge": lambda plan: any(
        one.arguments[0] in WITH_TIME for edge in plan.edges for one in edge.options.get("through", ())
    ),
    "an operator that speaks as it is connected": lambda plan: any(
        one.arguments[0] in ("start_with", "beside_a_timer")
        for edge in plan.edges
        for one in edge.options.get("through", ())
    ),
    "iteration inside of iteration": lambda plan: nodes(plan, "EachOfEach"),
    "iteration in a subgraph": lambda plan: any(
        node.name in box.members for node in nodes(plan, "EachOfEach") for box in plan.boxes
    ),
    "a teardown that hangs": lambda plan: nodes(plan, "Clings"),
    "a source without end and without a rate": lambda plan: any(
        "max_rate_hz" not in node.options for node in nodes(plan, "Hums")
    ),
    "a source without end behind a gate": lambda plan: any(
        gate.target == node.name for node in nodes(plan, *SOURCES) for gate in plan.gates
    ),
    "a source that waits for its parameter": lambda plan: any(
        edge.target[1] == "parameter" for node in nodes(plan, *SOURCES) for edge in into(plan, node)
    ),
    "a source without end that waits for its parameter": lambda plan: any(
        edge.target[1] == "parameter" for node in nodes(plan, "Hums") for edge in into(plan, node)
    ),
    "a node disabled from the start with an initial token": lambda plan: any(
        "initial" in edge.options
        for node in plan.nodes
        if node.options.get("enabled") is False
        for edge in plan.edges
        if node.name in (edge.source[0], edge.target[0])
    ),
    "a ring of tokens with a modifier": lambda plan: any(
        "initial" in edge.options and edge.options.get("active") for edge in plan.edges
    ),
}


@pytest.mark.parametrize("what", STRUCTURE)
def test_each_combination_of_parts_occurs(what: str) -> None:
    assert sum(bool(STRUCTURE[what](plan)) for plan in PLANS) >= 3


@pytest.mark.rule("R6", "R5")
def test_threads_occur_beside_sources_without_end_in_virtual_time() -> None:
    assert any(
        "max_rate_hz" not in hums.options and any("group" in node.options for node in plan.nodes)
        for plan in THREADS
        for hums in nodes(plan, "Hums")
    )


# --- what only a run shows


def ends_by_events(report: ReferenceReport) -> bool:
    """F13: a node is told END by an event."""
    return any(
        isinstance(event, TokenSent) and event.token.value is END and is_signal(event) for event in report.events
    )


def is_signal(event: TokenSent) -> bool:
    source = event.edge.partition(" -> ")[0].rpartition(".")[2]
    return source not in ("out", "total", "lefts", "even", "odd", "rest", "factor", "offset", "most", "count", "tone")


def signal_behind_end(report: ReferenceReport) -> bool:
    """F13, F4: a signal comes on an edge that has ended."""
    ended = set()
    for event in report.events:
        if isinstance(event, TokenSent) and event.token.value is END and is_signal(event):
            ended.add(event.edge)
        if isinstance(event, TokenDropped) and event.reason == "ended" and event.edge in ended:
            return True
    return False


def drains_modifiers_in_their_order(report: ReferenceReport) -> bool:
    """F12: of one edge several tokens are drained, and one that does not come last has a modifier."""
    drained: dict[str, list[int]] = {}
    for event in report.events:
        if isinstance(event, TokenDrained):
            drained.setdefault(event.edge, []).append(event.token.activity)
    return any(any(of_edge[:-1]) for of_edge in drained.values())


def drains_activity(report: ReferenceReport) -> bool:
    return any(isinstance(event, TokenDrained) and event.token.activity for event in report.events)


def gives_a_source_up(report: ReferenceReport) -> bool:
    """R5: what lies before a source that works for nobody is drained."""
    return any(move.kind == "give up" for move in report.moves)


def completes_operators(report: ReferenceReport) -> bool:
    return any(move.kind == "complete" for move in report.moves)


def hangs_at_last(report: ReferenceReport) -> bool:
    return report.events[-1].time >= 5.0


def relays_activity(report: ReferenceReport) -> bool:
    """A4, A5: an active node passes on +1."""
    return any(isinstance(event, ActivityChanged) and event.cause == "sent" for event in report.events)


RUNS: dict[str, tuple[Callable[[ReferenceReport], bool], Callable[[GraphPlan], Any]]] = {
    "an end by events": (ends_by_events, is_fed_by_events),
    "a signal behind the end of its edge": (signal_behind_end, is_fed_by_events),
    "a modifier that is drained": (
        drains_activity,
        lambda plan: any(edge.options.get("active") and edge.source[1] == "output" for edge in plan.edges),
    ),
    "a modifier that is drained before END": (
        drains_modifiers_in_their_order,
        lambda plan: any(
            edge.options.get("active") and edge.options.keys() & {"initial", "buffer"} for edge in plan.edges
        ),
    ),
    "a source that is given up": (
        gives_a_source_up,
        lambda plan: any(edge.target[1] == "parameter" for node in nodes(plan, *SOURCES) for edge in into(plan, node)),
    ),
    "operators that complete": (
        completes_operators,
        lambda plan: any("through" in edge.options for edge in plan.edges),
    ),
    "a teardown that takes all of its limit": (hangs_at_last, lambda plan: nodes(plan, "Clings")),
    "activity that is sent on": (relays_activity, lambda plan: nodes(plan, "Passing", "Relay")),
}


def runs(plans: Iterable[tuple[int, GraphPlan]]) -> Iterable[ReferenceReport]:
    for seed, plan in plans:
        try:
            yield reference_run(plan.build(), seed=seed, max_moves=600)
        except RuntimeError:  # it goes round and round
            continue


@pytest.mark.slow
@pytest.mark.parametrize("what", RUNS)
def test_each_combination_of_happenings_occurs(what: str) -> None:
    shows, may = RUNS[what]
    assert any(shows(report) for report in runs((seed, plan) for seed, plan in enumerate(PLANS) if may(plan)))
