"""The engine against the oracle on random graphs: all it does must be permitted, all that follows must happen.

A failure prints the smallest graph found, as a program. `test_soak.py` does the same with many more.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, assume, given, settings

import hfg
from hfg.engine.runtime import settings as run_settings
from hfg.testing import Divergence, ReferenceReport, graphs, recorder, reference_run, replay, schedules
from hfg.testing.conformance import Replay
from hfg.testing.invariants import broken, of_graph
from hfg.testing.plans import GraphPlan
from hfg.trace import TraceEvent
from tests.support.making import SYNCHRONOUS, WIDE, Allowed, random_plan
from tests.support.shrinking import shrink

pytestmark = pytest.mark.slow

MOST_MOVES = 1500
MOST_EVENTS = 5_000  # what ends under one schedule may go round for ever under another: then a run is stopped
EVERYTHING = Allowed()
SEVERAL_AT_ONCE = Allowed(concurrency=True)
TRIED_AGAIN = Allowed(concurrency=True, retries=True)
TENDING = Allowed(tasks=True, max_nodes=6)
SENDING = Allowed(sending=True)
DOING = Allowed(doing=True, clinging=True, max_nodes=5)
THREADS = Allowed(threads=True, lossy=False, gates=False)


def reference(plan: GraphPlan, seed: int) -> ReferenceReport | None:
    """Run the oracle; None if the graph goes round and round."""
    try:
        return reference_run(plan.build(), seed=seed, max_moves=MOST_MOVES)
    except RuntimeError:
        return None


def difference(plan: GraphPlan, seed: int) -> str | None:
    """Run the engine under one schedule; say what the oracle or an invariant has against it."""
    trace, graph = recorder(), plan.build()
    running: list[hfg.Run] = []

    def see(event: TraceEvent) -> None:
        trace(event)
        if len(trace) == MOST_EVENTS:
            running[0].stop()

    try:
        hfg.run(graph, clock="virtual", policy="random", seed=seed, trace=see, begin=running.append)
    except hfg.errors.RunError:
        pass
    except hfg.errors.EngineInternalError as error:
        return f"{type(error).__name__}: {error}"
    try:
        if len(trace) < MOST_EVENTS:
            replay(plan, trace)
        else:
            _replay_beginning(plan, trace[:MOST_EVENTS])
    except Divergence as divergence:
        return str(divergence)
    found = broken(trace, of_graph(graph))
    return "\n".join(found) if found else None


def _replay_beginning(plan: GraphPlan, events: Sequence[TraceEvent]) -> None:
    """What it did until it was stopped, which the oracle knows nothing of."""
    replaying = Replay(plan.build())
    try:
        for event in events:
            replaying.see(event)
    finally:
        replaying.machine.close()


def check(plan: GraphPlan, seed: int, compare: Callable[[GraphPlan, int], str | None] = difference) -> None:
    why = compare(plan, seed)
    if why is None:
        return

    def still(smaller: GraphPlan) -> bool:
        return reference(smaller, seed) is not None and compare(smaller, seed) is not None

    small = shrink(plan, still)
    pytest.fail(f"schedule {seed} of\n{small}\n\n{compare(small, seed)}", pytrace=False)


@pytest.mark.rule("F1", "F3", "F4", "F5", "F8", "F9", "A3", "A5", "A6", "G1", "R5", "R7")
@pytest.mark.parametrize("block", range(12))
def test_the_engine_does_what_the_oracle_permits(block: int) -> None:
    for seed in range(25 * block, 25 * block + 25):
        plan = random_plan(seed, EVERYTHING)
        if reference(plan, seed) is not None:
            check(plan, seed)


@pytest.mark.rule("P9", "F12", "F13", "G4", "R5", "X3")
@pytest.mark.parametrize("block", range(5))
def test_so_it_does_with_all_in_which_something_was_wrong_once(block: int) -> None:
    """With operators, last words, sources without end, iteration inside of iteration, teardowns that hang."""
    for seed in range(25 * block, 25 * block + 25):
        plan = random_plan(seed, WIDE)
        if reference(plan, seed) is not None:
            check(plan, seed)


@pytest.mark.rule("F10", "X1")
def test_a_node_that_is_enabled_while_its_cancelled_tasks_end_takes_its_time() -> None:
    plan = random_plan(790000422, replace(Allowed(), max_nodes=5, tasks=True, sending=True, doing=True, rings=True))
    assert reference(plan, 790000422) is not None
    check(plan, 790000422)


def has_several_at_once(plan: GraphPlan) -> bool:
    return any("concurrency" in node.options for node in plan.nodes)


@pytest.mark.rule("F14", "F9")
@pytest.mark.parametrize("block", range(4))
def test_so_it_does_with_several_firings_of_a_node_at_once(block: int) -> None:
    drawn = ((seed, random_plan(seed, SEVERAL_AT_ONCE)) for seed in itertools.count(300 * block))
    chosen = ((seed, plan) for seed, plan in drawn if has_several_at_once(plan) and reference(plan, seed) is not None)
    for seed, plan in itertools.islice(chosen, 15):
        check(plan, seed)


@pytest.mark.rule("X1", "X2")
@pytest.mark.parametrize("block", range(4))
def test_so_it_does_where_firings_that_fail_are_tried_again(block: int) -> None:
    """One at a time, several at once, in threads; with limits of time, and signals behind which nobody tries again."""
    for seed in range(25 * block, 25 * block + 25):
        plan = random_plan(seed, replace(TRIED_AGAIN, threads=seed % 5 == 0))
        if reference(plan, seed) is not None:
            check(plan, seed)


@pytest.mark.rule("X1", "X3", "R5", "F10", "T5", "F8", "F13")
@pytest.mark.parametrize("block", range(4))
def test_so_it_does_where_nodes_start_tasks_beside_their_firings(block: int) -> None:
    """Tasks that speak later, wait for room or fail; nodes that are disabled, reset and restarted meanwhile."""
    for seed in range(25 * block, 25 * block + 25):
        plan = random_plan(seed, replace(TENDING, concurrency=seed % 5 == 0, retries=seed % 5 == 0))
        if any(node.type in ("Tends", "Beats") for node in plan.nodes) and reference(plan, seed) is not None:
            check(plan, seed)


@pytest.mark.rule("F3", "F9", "T5", "A4")
@pytest.mark.parametrize("block", range(4))
def test_so_it_does_where_nodes_send_in_every_way_there_is(block: int) -> None:
    """By `send`, return, both, helpers, tokens, loans and tasks, from plain and async code; watched and not."""
    for seed in range(20 * block, 20 * block + 20):
        plan = random_plan(seed, replace(SENDING, concurrency=seed % 3 == 0, retries=seed % 5 == 0))
        if reference(plan, seed) is not None:
            check(plan, seed)
            check(plan, seed, short_ways_differ)


@pytest.mark.rule("A15", "X1", "R5", "F10")
@pytest.mark.parametrize("block", range(4))
def test_so_it_does_where_nodes_have_do_activities(block: int) -> None:
    """Some return at once, some tell something, fail, resist their end or last; some are disabled, reset, restarted."""
    drawn = ((seed, random_plan(seed, DOING)) for seed in itertools.count(300 * block))
    chosen = ((seed, plan) for seed, plan in drawn if "Works" in {node.type for node in plan.nodes})
    runs = ((seed, plan) for seed, plan in chosen if reference(plan, seed) is not None)
    for seed, plan in itertools.islice(runs, 15):
        check(plan, seed)


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(graphs(), schedules())
def test_hypothesis_finds_nothing_either(plan: GraphPlan, seed: int) -> None:
    assume(reference(plan, seed) is not None)
    assert difference(plan, seed) is None


@pytest.mark.rule("R1")
@pytest.mark.parametrize("seed", range(40))
def test_threads_change_nothing_of_it(seed: int) -> None:
    plan = random_plan(seed, THREADS)
    if reference(plan, seed) is not None:
        check(plan, seed)


def modes(plan: GraphPlan, release: str, group: str | None) -> GraphPlan:
    """The same graph with another mode and, for every other node, another group."""
    nodes = []
    for index, node in enumerate(plan.nodes):
        options = {**node.options, "release": release}
        if group is not None and index % 2 and node.type not in ("ascript", "slow_double", "Waiting"):
            options["group"] = group
        nodes.append(replace(node, options=options))
    return replace(plan, nodes=tuple(nodes), groups=() if group is None else (group,))


@pytest.mark.rule("F7")
@pytest.mark.parametrize("seed", range(60))
def test_sequences_depend_neither_on_schedule_nor_modes_nor_groups(seed: int) -> None:
    """On synchronous edges alone; of runs that do not end by themselves one sequence is a prefix of the other."""
    plan = random_plan(seed, replace(SYNCHRONOUS, rates=False))
    wanted = reference(plan, seed)
    if wanted is None:
        return
    sequences = {edge: [(token.value, token.activity) for token in sent] for edge, sent in wanted.tokens.items()}
    for release, group, policy in [
        ("sequential", None, "random"),
        ("pipelined", None, "fifo"),
        ("auto", "side", "random"),
    ]:
        seen = recorder()
        graph = modes(plan, release, group).build()
        try:
            hfg.run(graph, clock="virtual", policy=policy, seed=seed if policy == "random" else None, trace=seen)
        except hfg.errors.RunError:
            assert wanted.outcome != "done"
        for edge, sequence in sequences.items():
            found = [(token.value, token.activity) for token in seen.tokens(edge)] if edge in seen.edges() else []
            shorter = min(len(found), len(sequence))
            assert found[:shorter] == sequence[:shorter], f"{edge} with {release}, {group}, {policy}\n{plan}"


def unwatched(plan: GraphPlan, seed: int, policy: str, fast: bool) -> hfg.Report | str:
    """What a run that nobody watches has done; what ends under one schedule may go round for ever under another."""
    try:
        drawn = seed if policy == "random" else None
        return hfg.run(plan.build(), clock="virtual", policy=policy, seed=drawn, fast=fast, until_s=30.0)
    except hfg.errors.RunError as error:
        return error.report  # type: ignore[attr-defined, no-any-return]
    except hfg.errors.EngineInternalError as error:
        return str(error)


def short_ways_differ(plan: GraphPlan, seed: int) -> str | None:
    """The short ways of the engine must lead to the very same, in the same order; they are for runs without trace.

    Not under a random policy: it also draws for workers that a short way queues although they cannot move.
    """
    short, general = (unwatched(plan, seed, "fifo", fast) for fast in (True, False))
    return None if short == general else f"short ways: {short}\n  general way: {general}"


@pytest.mark.rule("F7", "R7")
@pytest.mark.parametrize("block", range(10))
def test_a_run_that_nobody_watches_does_the_same(block: int) -> None:
    for seed in range(25 * block, 25 * block + 25):
        plan = random_plan(seed, EVERYTHING)
        if reference(plan, seed) is not None:
            check(plan, seed, short_ways_differ)


@pytest.mark.rule("G1")
@pytest.mark.parametrize("seed", range(40))
def test_grouping_and_dissolving_change_nothing(seed: int) -> None:
    plan = random_plan(seed, replace(SYNCHRONOUS, rates=False))
    if not plan.boxes or reference(plan, seed) is None:
        return
    boxed, flat = recorder(), recorder()
    for one, seen in ((plan, boxed), (plan.flat(), flat)):
        try:
            hfg.run(one.build(), clock="virtual", trace=seen)
        except hfg.errors.RunError:
            return
    paths = plan.paths()
    for edge in plan.edges:
        inside = f"{paths[edge.source[0]]}.{edge.source[2]} -> {paths[edge.target[0]]}.{edge.target[2]}"
        outside = f"{edge.source[0]}.{edge.source[2]} -> {edge.target[0]}.{edge.target[2]}"
        assert boxed.values(inside) == flat.values(outside), f"{outside}\n{plan}"


SEEN_TO_FAIL = (201805, 202779, 204777, 209093)  # a place or a following that a fused wave or a lost call left behind


@pytest.mark.rule("F1", "F5", "R2")
@pytest.mark.parametrize("seeds", [SEEN_TO_FAIL, *(range(25 * block, 25 * block + 25) for block in range(8))])
def test_what_is_fused_from_the_first_firing_on_leaves_all_in_order(
    seeds: Sequence[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nobody listens, for nothing is fused then: the invariants that are asked for after every step are the test."""
    monkeypatch.setattr(run_settings, "FUSE_AFTER", 0)
    for seed in seeds:
        plan = random_plan(seed, EVERYTHING)
        if reference(plan, seed) is None:
            continue
        try:
            hfg.run(plan.build(), clock="virtual")
        except hfg.errors.RunError:
            continue
