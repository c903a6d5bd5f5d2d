"""Who is next: deadlines, fair shares, groups on the loop, and nodes that move between groups (rules R1, R2, F7)."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest

import hfg
from hfg import commands
from hfg.engine.executing.groups import LoopGroup
from hfg.engine.model.policies import EarliestDeadline, FairShare, Priority
from hfg.errors import GraphError, RunError, UsageError
from hfg.testing import Divergence, recorder, reference_run, replay
from hfg.testing.invariants import broken, of_graph
from tests.semantics.nodes import Burst, Where, forward, numbers, run
from tests.support.making import SYNCHRONOUS, Allowed, random_plan

COSTS_S = (0.001, 0.003, 0.009)
POLICIES = ("priority", "deadline", "fair")


class Busy(hfg.Node):
    """Computes as long as it is told, on the virtual clock."""

    value = hfg.Input(int)
    cost_s = hfg.Parameter(0.01)
    order: list[str] = []  # noqa: RUF012 - of all
    begun = hfg.State(factory=list)

    def process(self, value: int) -> None:
        assert self.place is not None
        self.order.append(self.place.name)
        self.begun.append(hfg.now())
        loop = asyncio.get_running_loop()
        assert isinstance(loop, hfg.VirtualTimeLoop)
        loop.spend(self.cost_s)


@hfg.node
def ticks() -> Iterator[int]:
    """More than there is time for."""
    yield from range(1_000_000)


def loaded(policy: str, group: str = "loop", **options: Any) -> dict[str, float]:
    """How long each of three nodes computed, when there was more to do than time."""
    graph = hfg.Graph()
    graph.group(group, threads=0, policy=policy)  # type: ignore[arg-type]
    nodes = [graph.add(Busy(cost_s=cost), name=f"takes_{cost * 1000:.0f}_ms", group=group) for cost in COSTS_S]
    for node in nodes:
        graph.connect(graph.add(ticks(), group=group).out, node.value)
    run(graph, until_s=3, **options)
    return {node.place.name: len(node.begun) * node.cost_s for node in nodes}


# --- fair share ---


@pytest.mark.slow
@pytest.mark.rule("R2")
@pytest.mark.parametrize("group", ["loop", "side"])
def test_a_fair_share_is_the_same_time_for_each_however_long_a_firing_takes(group: str, fast: bool) -> None:
    shares = loaded("fair", group, fast=fast)
    assert max(shares.values()) - min(shares.values()) <= 0.02
    assert sum(shares.values()) >= 2.9


@pytest.mark.rule("R2")
def test_first_in_first_out_gives_each_the_same_number_of_firings_and_so_the_slow_most_of_the_time() -> None:
    shares = loaded("fifo")
    assert shares["takes_9_ms"] > 8 * shares["takes_1_ms"]


@pytest.mark.rule("R2")
def test_nobody_saves_up_time_while_it_has_nothing_to_do() -> None:
    """A node that comes late gets its share from then on, not all that it missed."""
    graph = hfg.Graph()
    graph.group("loop", policy="fair")
    first, late = graph.add(Busy(), name="first"), graph.add(Busy(), name="late")
    graph.connect(graph.add(ticks()).out, first.value)
    waking = graph.add(Later())
    graph.connect(waking.out, late.value)
    run(graph, until_s=4)
    assert len(late.begun) > 90
    assert abs(len([begun for begun in first.begun if begun > late.begun[0]]) - len(late.begun)) <= 2


class Later(hfg.Node):
    """A source that has nothing for two seconds."""

    out = hfg.Output(int)

    async def process(self) -> int:
        if hfg.now() < 2:
            await asyncio.sleep(2 - hfg.now())
        return 1


class Account:
    """Stands for a worker: policies look at nothing else of it."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __repr__(self) -> str:
        return self.name


@pytest.mark.rule("R2")
def test_who_comes_back_before_its_turn_was_charged_waits_for_those_it_owes() -> None:
    heavy, light = Account("heavy"), Account("light")
    policy: Any = FairShare()
    for worker in (heavy, light):
        policy.push(worker)
    served = []
    for _ in range(8):
        worker = policy.pop()
        served.append(str(worker))
        policy.push(worker)  # during its turn, as a slot that calls itself does
        policy.charge(worker, 3.0 if worker is heavy else 1.0)
    assert served == ["heavy", "light", "light", "light", "heavy", "light", "light", "light"]
    assert len(policy) == 2


def test_only_shared_time_is_measured() -> None:
    """Whoever chooses another policy pays nothing for this one."""
    reads = 0

    def clock() -> float:
        nonlocal reads
        reads += 1
        return 0.0

    group = LoopGroup("loop", Priority(), clock)
    node: Any = _Stepping()
    group.push(node)
    group.take().step(node)
    assert (node.steps, reads) == (1, 0)
    fair = LoopGroup("loop", FairShare(), clock)
    fair.push(node)
    turn = fair.take()
    turn.step(turn)
    assert (node.steps, reads) == (2, 2)


class _Stepping:
    priority = 0
    steps = 0

    def step(self, _worker: object) -> None:
        self.steps += 1


@pytest.mark.rule("R2")
def test_a_thread_that_is_shared_fairly_is_charged_for_what_its_jobs_take() -> None:
    """Real time: the slow node's first firing puts it behind many of the quick one's."""
    order: list[str] = []
    graph = hfg.Graph()
    graph.group("work", threads=1, policy="fair")
    for name, pause_s in (("slow", 0.02), ("quick", 0.0)):
        node = graph.add(Noting(pause_s=pause_s), name=name, group="work")
        node.order = order
        graph.connect(graph.add(Burst(count=10), name=f"for_{name}").rang, node.value)
    hfg.run(graph)
    assert order.count("quick") == order.count("slow") == 10
    assert order[:2] == ["slow", "quick"]
    assert order.index("slow", 2) > 2  # it would be 2 in turns


class Noting(hfg.Node):
    value = hfg.Input(int)
    pause_s = hfg.Parameter(0.0)
    order: list[str]

    def process(self, value: int) -> None:
        assert self.place is not None
        self.order.append(self.place.name)
        time.sleep(self.pause_s)


# --- earliest deadline ---


def served(policy: str, deadlines: dict[str, float | None], **options: Any) -> list[str]:
    """Who is first of those that become ready together."""
    Busy.order.clear()
    graph = hfg.Graph()
    graph.group("loop", policy=policy)  # type: ignore[arg-type]
    source = graph.add(numbers(count=1))
    for name, deadline_s in deadlines.items():
        graph.connect(source.out, graph.add(Busy(cost_s=1.0), name=name, deadline_s=deadline_s).value)
    run(graph, **options)
    return list(Busy.order)


@pytest.mark.rule("R2")
def test_the_earliest_deadline_goes_first_and_who_has_none_comes_last(fast: bool) -> None:
    deadlines = {"none": None, "relaxed": 10.0, "urgent": 1.5, "also_none": None, "soon": 3.0}
    assert served("deadline", deadlines, fast=fast) == ["urgent", "soon", "relaxed", "none", "also_none"]
    assert served("fifo", deadlines, fast=fast) == list(deadlines)


@pytest.mark.rule("R2")
def test_without_any_deadline_it_is_first_in_first_out() -> None:
    assert served("deadline", {"c": None, "a": None, "b": None}) == ["c", "a", "b"]


@pytest.mark.rule("R2", "T5")
def test_a_deadline_counts_from_the_stamp_of_the_oldest_token() -> None:
    """Two nodes with the same allowance: what was measured earlier is served first."""

    class Measured(hfg.Node):
        old = hfg.Output(int)
        new = hfg.Output(int)
        done = hfg.State(False)

        def process(self) -> None:
            if self.done:
                raise hfg.EndOfStream
            self.done = True
            self.old.send(1, stamp=1.0)
            self.new.send(1, stamp=2.0)

    Busy.order.clear()
    graph = hfg.Graph()
    graph.group("loop", policy="deadline")
    source = graph.add(Measured())
    for name in ("new", "old"):
        node = graph.add(Busy(), name=name, deadline_s=5.0)
        graph.connect(source.ports.outputs[name], node.value)
    run(graph)
    assert Busy.order == ["old", "new"]


@hfg.node
def onward(value: int) -> int:
    return value


def after_a_burst(**deadlines: Any) -> list[str]:
    """Two ways of two nodes each, of which the first was connected first; which of their ends was first."""
    Busy.order.clear()
    graph = hfg.Graph()
    graph.group("loop", policy="deadline")
    source = graph.add(numbers(count=1))
    for name in ("first", "second"):
        middle, end = graph.add(onward(), name=f"to_{name}"), graph.add(Busy(cost_s=1.0), name=name)
        graph.connect(source.out, middle.value)
        graph.connect(middle.out, end.value, deadline_s=deadlines.get(name))
    run(graph)
    return list(Busy.order)


@pytest.mark.rule("R2")
def test_an_edge_has_a_deadline_too_and_what_leads_to_one_must_be_done_before_it() -> None:
    assert after_a_burst() == ["first", "second"]
    assert after_a_burst(second=0.5) == ["second", "first"]  # to_second has its deadline, to_first has none
    assert after_a_burst(second=0.5, first=0.2) == ["first", "second"]


@pytest.mark.rule("R2", "R4")
def test_an_edit_of_a_running_graph_changes_deadlines() -> None:
    async def main() -> list[str]:
        Busy.order.clear()
        graph = hfg.Graph()
        graph.group("loop", policy="deadline")
        values = graph.input("values", int)
        for name in ("first", "second"):
            graph.connect(values, graph.add(Busy(), name=name).value)
        async with hfg.running(graph) as run, run.feed(values) as into:
            await into.send(1)
            await run.edit(commands.SetEdge("values", "second.value", deadline_s=0.5))
            await into.send(2)
        return list(Busy.order)

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        assert runner.run(main()) == ["first", "second", "second", "first"]


class _Token:
    def __init__(self, stamp: float) -> None:
        self.stamp = stamp


class _Edge:
    def __init__(self, *stamps: float) -> None:
        self._tokens = [_Token(stamp) for stamp in stamps]

    def contents(self) -> list[_Token]:
        return self._tokens


class _Waiting:
    """What a deadline is found from."""

    class core:  # noqa: N801
        @staticmethod
        def now() -> float:
            return 100.0

    due_s = 1.0

    def __init__(self, *, fireable: bool, calls_before: int = 0, calls: Any = None, live_inputs: Any = ()) -> None:
        self.fireable, self.calls_before, self.calls, self.live_inputs = fireable, calls_before, calls, live_inputs


@pytest.mark.rule("R2", "F9")
def test_the_deadline_is_that_of_what_comes_next_the_call_or_the_firing() -> None:
    call = _Waiting(fireable=True, calls_before=1, calls=[_Edge(5.0, 1.0)], live_inputs=[_Edge(3.0)])
    firing = _Waiting(fireable=True, live_inputs=[_Edge(4.0), _Edge(9.0)])
    source = _Waiting(fireable=True)
    policy: Any = EarliestDeadline()
    for worker in (source, call, firing):
        policy.push(worker)
    assert [policy.pop() for _ in range(3)] == [firing, call, source]


# --- F7 and the oracle, with the new policies ---


def scheduled(seed: int, allowed: Allowed) -> Any:
    """A random plan whose nodes differ in priority and deadline."""
    plan = random_plan(seed, allowed)
    deadlines = (None, 0.01, 0.5)
    return replace(
        plan,
        nodes=tuple(
            replace(node, options={**node.options, "priority": number % 3, "deadline_s": deadlines[number % 3]})
            for number, node in enumerate(plan.nodes)
        ),
    )


@pytest.mark.rule("F7", "R2")
@pytest.mark.parametrize("seed", range(100, 130))
def test_no_policy_shows_in_what_runs_over_synchronous_edges(seed: int) -> None:
    plan = scheduled(seed, replace(SYNCHRONOUS, rates=False, threads=True))
    try:
        wanted = reference_run(plan.build(), seed=seed, max_moves=1500)
    except RuntimeError:
        return  # it goes round and round
    for policy in POLICIES:
        seen = recorder()
        try:
            hfg.run(plan.build(), clock="virtual", policy=policy, trace=seen)
        except RunError:
            assert wanted.outcome != "done"
        for edge, expected in wanted.tokens.items():
            sequence = [(token.value, token.activity) for token in expected]
            found = [(token.value, token.activity) for token in seen.tokens(edge)] if edge in seen.edges() else []
            shorter = min(len(found), len(sequence))
            assert found[:shorter] == sequence[:shorter], f"{edge} with {policy}\n{plan}"
            assert wanted.outcome != "done" or len(found) == len(sequence)


@pytest.mark.slow
@pytest.mark.rule("R2")
@pytest.mark.parametrize("policy", POLICIES)
def test_the_oracle_permits_every_policy(policy: str) -> None:
    for seed in range(40):
        plan = scheduled(seed, Allowed())
        try:
            reference_run(plan.build(), seed=seed, max_moves=1500)
        except RuntimeError:
            continue
        trace, graph = recorder(), plan.build()
        with contextlib.suppress(RunError):
            hfg.run(graph, clock="virtual", policy=policy, trace=trace)
        try:
            replay(plan, trace)
        except Divergence as divergence:
            pytest.fail(f"{policy}, seed {seed}: {divergence}\n{plan}", pytrace=False)
        assert not broken(trace, of_graph(graph))


# --- groups on the loop, and moving between groups ---


@pytest.mark.rule("R1", "R2")
def test_a_group_on_the_loop_has_a_policy_of_its_own(fast: bool) -> None:
    Busy.order.clear()
    graph = hfg.Graph()
    graph.group("side", threads=0, policy="priority")
    source = graph.add(numbers(count=1))
    for number, name in enumerate("abc"):
        graph.connect(source.out, graph.add(Busy(), name=name, group="side", priority=number).value)
    run(graph, fast=fast)
    assert Busy.order == ["c", "b", "a"]


@pytest.mark.rule("R1")
@pytest.mark.parametrize("group", ["loop", "side", "work"])
def test_a_moved_node_runs_where_it_was_moved_to(group: str) -> None:
    graph = hfg.Graph()
    graph.group("first", threads=1)
    graph.group("side", threads=0)
    graph.group("work", threads=1)
    source, node = graph.add(numbers(count=3)), graph.add(Where(), group="first")
    graph.connect(source.out, node.value)
    run(graph)
    assert node.threads == {"hfg group first"}
    graph.move(node, group=group)
    run(graph)
    assert node.threads == {"hfg group work"} if group == "work" else "MainThread" in node.threads


@pytest.mark.rule("R1", "F5")
def test_moving_a_subgraph_takes_along_who_has_no_group_of_its_own() -> None:
    class Box(hfg.Subgraph):
        value = hfg.Input(int)

        def build(self, graph: hfg.Graph) -> None:
            self.free, self.bound = graph.add(Where()), graph.add(Where(), group="own")
            graph.connect(self.value.inner, self.free.value)
            graph.connect(self.free.out, self.bound.value)

    graph = hfg.Graph()
    graph.group("own", threads=1)
    graph.group("work", threads=1)
    box = graph.add(Box())
    graph.connect(graph.add(numbers(count=2)).out, box.value)
    graph.move(box, group="work")
    run(graph)
    assert (box.free.threads, box.bound.threads) == ({"hfg group work"}, {"hfg group own"})
    graph.move(box, group=None)
    run(graph)
    assert box.free.threads == {"MainThread"}


def test_moving_keeps_what_else_was_said_of_the_node() -> None:
    graph = hfg.Graph()
    graph.group("side", threads=0)
    node = graph.add(forward(), priority=3, deadline_s=0.5)
    before = node._options
    graph.move(node, group="side")
    graph.move(node, group=None)
    assert node._options == before


# --- wrong use ---


def test_moving_to_a_group_that_is_not_declared_is_refused_and_changes_nothing() -> None:
    graph = hfg.Graph()
    graph.group("vision", threads=1)
    node = graph.add(forward())
    for group in ("visoin", 3, ""):
        with pytest.raises(GraphError, match=r'"forward" cannot move to group .*not declared.*graph\.group\('):
            graph.move(node, group=group)  # type: ignore[arg-type]
    assert node._options.group is None


def test_moving_what_is_not_in_the_graph_is_refused() -> None:
    graph, other = hfg.Graph(), hfg.Graph("other")
    with pytest.raises(GraphError, match='"forward" is not in graph "graph"'):
        graph.move(other.add(forward()), group="loop")
    with pytest.raises(GraphError, match=r"graph\.move takes a node"):
        graph.move(3, group="loop")  # type: ignore[arg-type]


def test_a_policy_that_does_not_exist_is_refused_with_those_that_do() -> None:
    graph = hfg.Graph()
    with pytest.raises(GraphError, match='policy must be one of "fifo", "priority", "deadline", "fair", "random"'):
        graph.group("work", policy="earliest")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="there are deadline, fair, fifo, priority, random"):
        hfg.run(graph, policy="earliest")


@pytest.mark.parametrize("deadline_s", [0, -1, float("nan"), "soon"])
def test_a_deadline_is_a_time_above_zero(deadline_s: Any) -> None:
    with pytest.raises(GraphError, match='node "forward": deadline_s must be a number above 0'):
        hfg.Graph().add(forward(), deadline_s=deadline_s)


def test_time_that_is_spent_goes_forward() -> None:
    async def main() -> None:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, hfg.VirtualTimeLoop)
        loop.spend(0.5)
        assert hfg.now() == 0.5
        with pytest.raises(ValueError, match="time goes forward"):
            loop.spend(-1)

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
