"""Nodes that wait for each other in a ring that only full queues close, beside whatever else lives (rule F8)."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import replace
from typing import Any

import pytest
from reactivex import operators as ops

import hfg
from hfg.engine import Glance
from hfg.graph import commands as c
from hfg.testing import reference_run
from hfg.testing.conformance import Replay
from hfg.testing.plans import GraphPlan, NodePlan
from hfg.trace import QueueGrown, RunEnded, TokenDropped, TraceEvent
from tests.semantics.nodes import Clock, Ear, Keep, Ringing, add, drive, of_kind, run, traced
from tests.semantics.test_random_graphs import check, reference
from tests.support.making import Allowed, random_plan


class Gate(hfg.Node):
    """Asks by an event, and hears the answers by a slot."""

    request = hfg.Event(int)
    aside = hfg.Event(int)
    count = hfg.Parameter(40)
    by_task = hfg.Parameter(False)
    heard = hfg.State(0)

    def setup(self) -> None:
        if self.by_task:
            self.start_soon(self.pump())

    async def pump(self) -> None:
        for number in range(self.count):
            await self.request.trigger_wait(number)

    @hfg.slot
    def begin(self) -> None:
        for number in range(0 if self.by_task else self.count):
            self.request.trigger(number)
        self.aside.trigger(0)

    @hfg.slot
    def answer(self, value: int) -> None:
        self.heard += 1


@hfg.node
async def ask(value: int) -> int:
    await asyncio.sleep(0.01)
    return value


def gateway(**options: Any) -> tuple[hfg.Graph, Gate]:
    """A question, somebody who takes his time, and the answer."""
    graph = hfg.Graph()
    gate = graph.add(Gate(by_task=options.pop("by_task", False)), name="gate")
    asked = graph.add(ask(), name="ask", **options)
    graph.connect(graph.start, gate.begin)
    graph.connect(gate.request, asked.value)
    graph.connect(asked.out, gate.answer)
    return graph, gate


@hfg.node
async def waits_for_ever() -> AsyncIterator[int]:
    await asyncio.Event().wait()
    yield 1


class Lives(hfg.Node):
    """A task that never comes to its end."""

    ticked = hfg.Event(int)

    def setup(self) -> None:
        self.start_soon(self.tick())

    async def tick(self) -> None:
        while True:
            await asyncio.sleep(0.007)
            self.ticked.trigger(1)


def a_source_with_a_rate(graph: hfg.Graph) -> None:
    graph.connect(graph.add(Clock(), max_rate_hz=2).out, graph.add(Keep()).value)


def a_task(graph: hfg.Graph) -> None:
    graph.connect(graph.add(Lives()).ticked, graph.add(Keep()).value)


def a_source_that_waits(graph: hfg.Graph) -> None:
    graph.connect(graph.add(waits_for_ever()).out, graph.add(Keep()).value)


def another_ring_that_is_slow(graph: hfg.Graph) -> None:
    gate, asked = graph.add(Gate(count=20)), graph.add(slow())
    graph.connect(graph.start, gate.begin)
    graph.connect(gate.request, asked.value)
    graph.connect(asked.out, gate.answer)


@hfg.node
async def slow(value: int) -> int:
    await asyncio.sleep(1)
    return value


BESIDE: list[Callable[[hfg.Graph], None]] = [
    a_source_with_a_rate,
    a_task,
    a_source_that_waits,
    another_ring_that_is_slow,
]


@pytest.mark.rule("F8")
@pytest.mark.parametrize("beside", BESIDE)
@pytest.mark.parametrize("options", [{}, {"concurrency": 8}, {"by_task": True}, {"by_task": True, "concurrency": 3}])
def test_a_ring_grows_whatever_else_lives(
    beside: Callable[[hfg.Graph], None], options: dict[str, Any], fast: bool
) -> None:
    graph, gate = gateway(**options)
    beside(graph)
    run(graph, fast, until_s=3)
    assert gate.heard == 40


@pytest.mark.rule("F8", "F5", "P10")
def test_a_ring_grows_before_an_input_that_is_open(fast: bool) -> None:
    async def main() -> int:
        graph, gate = gateway()
        graph.connect(graph.input("open", int), graph.add(Keep()).value)
        async with hfg.running(graph, fast=fast) as run:
            await asyncio.sleep(1)
            run.stop()
        return gate.heard

    assert drive(main) == 40


@pytest.mark.rule("F8", "R7")
def test_it_grows_as_soon_as_it_has_closed_and_no_more_than_it_must() -> None:
    graph, _ = gateway()
    a_task(graph)
    grown = of_kind(traced(graph, until_s=1), QueueGrown)
    assert [(event.time, event.capacity) for event in grown] == [(0.01, places) for places in range(17, 41)]


@pytest.mark.rule("F8")
@pytest.mark.parametrize("first", [True, False])
def test_the_smallest_queue_of_the_ring_grows_not_one_beside_it(first: bool) -> None:
    """Of equals the one created first; a queue outside the ring that is smaller has nothing to do with it."""

    class Twice(hfg.Node):
        passed = hfg.Event(int)
        calls = hfg.State(0)

        @hfg.slot
        def hear(self, value: int) -> None:
            self.calls += 1
            if self.calls < 4:
                self.passed.trigger(value)
                self.passed.trigger(value)

    graph = hfg.Graph()
    a, b, slower = graph.add(Twice(), name="a"), graph.add(Twice(), name="b"), graph.add(slow())
    flood = graph.add(Ear(), name="flood")
    graph.connect(graph.add(Ringing(count=1)).rang, a.hear)
    graph.connect(graph.add(Lives()).ticked, flood.hear)
    graph.connect(flood.passed, slower.value, capacity=1)
    edges = [("a", a.passed, b.hear), ("b", b.passed, a.hear)]
    for _, source, target in edges if first else edges[::-1]:
        graph.connect(source, target, capacity=2)
    grown = of_kind(traced(graph, until_s=1), QueueGrown)
    wanted = "a.passed -> b.hear" if first else "b.passed -> a.hear"
    assert grown[0].edge == wanted
    assert not any("flood" in event.edge for event in grown)


@pytest.mark.rule("F8", "F6")
def test_a_node_that_waits_for_a_signal_of_the_ring_is_of_it(fast: bool) -> None:
    """It joins two events of one node, of which the second comes only when there is room behind the first."""

    class Pump(hfg.Node):
        many = hfg.Event(int)
        once = hfg.Event(int)

        def setup(self) -> None:
            self.start_soon(self.pump())

        async def pump(self) -> None:
            for number in range(5):
                await self.many.trigger_wait(number)
            self.once.trigger(7)

    graph = hfg.Graph()
    pump, join, keep = graph.add(Pump()), graph.add(add()), graph.add(Keep())
    graph.connect(pump.many, join.a, capacity=2)
    graph.connect(pump.once, join.b)
    graph.connect(join.out, keep.value)
    a_task(graph)
    report = run(graph, fast, until_s=1)
    assert (keep.values, report.edges["pump.many -> add.a"].grown) == ([7], 4)


@pytest.mark.rule("F8", "F6")
@pytest.mark.parametrize("who", ["task", "input", "timer"])
def test_a_ring_that_something_else_may_still_open_does_not_grow(who: str) -> None:
    """The signal that is missing may come from a task of the node, from outside, or out of operators."""

    class Both(hfg.Node):
        many = hfg.Event(int)
        once = hfg.Event(int)

        def setup(self) -> None:
            if who == "task":
                self.start_soon(self.speak())

        async def speak(self) -> None:
            for _ in range(5):
                await asyncio.sleep(0.1)
                self.once.trigger(7)

        @hfg.slot
        def begin(self) -> None:
            if who == "timer":
                self.once.trigger(7)
            for number in range(2):
                self.many.trigger(number)

    async def main() -> hfg.Report:
        graph = hfg.Graph()
        both, join = graph.add(Both()), graph.add(add())
        graph.connect(graph.start, both.begin)
        graph.connect(both.many, join.a, capacity=1)
        if who == "input":
            graph.connect(graph.input("open", int), join.b)
        elif who == "timer":
            graph.connect(both.once, join.b, through=[ops.delay(0.5)])
        else:
            graph.connect(both.once, join.b)
        async with hfg.running(graph) as run:
            await asyncio.sleep(0.05)
            run.stop()
        return run.report()

    assert drive(main).edges["both.many -> add.a"].grown == 0


@pytest.mark.rule("F8")
def test_growing_over_its_limit_is_a_failure_though_something_else_lives() -> None:
    graph = hfg.Graph()
    gate, asked = graph.add(Gate(), name="gate"), graph.add(ask(), name="ask")
    graph.connect(graph.start, gate.begin)
    graph.connect(gate.request, asked.value, capacity=4, capacity_limit=6)
    graph.connect(asked.out, gate.answer)
    a_task(graph)
    with pytest.raises(hfg.errors.QueueLimit, match="wait for each other, and its capacity_limit = 6"):
        run(graph)


@pytest.mark.rule("F8")
def test_who_is_only_slower_than_its_producer_makes_no_ring() -> None:
    graph = hfg.Graph()
    source, ear, asked = graph.add(Lives()), graph.add(Ear()), graph.add(slow())
    graph.connect(source.ticked, ear.hear, capacity=3)
    graph.connect(ear.passed, asked.value, capacity=2)
    graph.connect(asked.out, graph.add(Keep()).value)
    assert of_kind(traced(graph, until_s=3), QueueGrown) == []


@pytest.mark.rule("F8", "G1")
def test_a_ring_through_the_ports_of_subgraphs_is_one(fast: bool) -> None:
    class Asks(hfg.Subgraph):
        """Somebody who answers, in a box."""

        question = hfg.Input(int)
        reply = hfg.Output(int)

        def build(self, inside: hfg.Graph) -> None:
            inner = inside.add(ask())
            inside.connect(self.question.inner, inner.value)
            inside.connect(inner.out, self.reply.inner)

    graph = hfg.Graph()
    gate, box = graph.add(Gate()), graph.add(Asks())
    graph.connect(graph.start, gate.begin)
    graph.connect(gate.request, box.question)
    graph.connect(box.reply, gate.answer)
    a_task(graph)
    run(graph, fast, until_s=2)
    assert gate.heard == 40


@pytest.mark.rule("F8", "R3")
def test_nothing_grows_while_the_run_is_paused() -> None:
    async def main() -> tuple[int, int]:
        graph, gate = gateway()
        a_task(graph)
        async with hfg.running(graph) as run:
            run.pause()
            await asyncio.sleep(1)
            before = gate.heard
            run.resume()
            await asyncio.sleep(1)
            run.stop()
        return before, gate.heard

    assert drive(main) == (0, 40)


# --- rings that something closes ---


class Pump(hfg.Node):
    """Sends one thing often, and another when that is through."""

    many = hfg.Event(int)
    once = hfg.Event(int)

    def setup(self) -> None:
        self.start_soon(self.pump())

    async def pump(self) -> None:
        for number in range(5):
            await self.many.trigger_wait(number)
        self.once.trigger(7)


class Between(hfg.Node):
    """Hands on what comes, which is nothing."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        return value


class Late(hfg.Node):
    """Speaks once, after a while."""

    now = hfg.Event(int)

    def setup(self) -> None:
        self.start_soon(self.speak())

    async def speak(self) -> None:
        await asyncio.sleep(0.06)
        self.now.trigger(1)


def opened(slot: str) -> hfg.Graph:
    """Would be a ring, were it not for `between`, which waits for somebody whose code goes on for ever."""
    graph = hfg.Graph()
    pump, join, relay = graph.add(Pump(), name="pump"), graph.add(add(), name="join"), graph.add(Ear(), name="relay")
    never, between = graph.add(waits_for_ever(), name="never"), graph.add(Between(), name="between")
    graph.connect(pump.many, join.a, capacity=2)
    graph.connect(pump.once, relay.hear)
    first = graph.add(Between(), name="first")  # an edit of its edges need not wait for that code
    graph.connect(never.out, first.value)
    graph.connect(first.out, between.value)
    graph.connect(between.out, relay.hear)
    graph.connect(relay.passed, join.b)
    graph.connect(join.out, graph.add(Keep(), name="keep").value)
    a_task(graph)
    if slot:
        graph.connect(graph.add(Late(), name="late").now, between.ports.slots[slot])
    return graph


async def close_by_edit(run: hfg.Run, *edit: c.Command) -> None:
    await run.edit(*edit)


async def close_by_itself(run: hfg.Run) -> None:
    await asyncio.sleep(0.01)


async def close_while_paused(run: hfg.Run) -> None:
    run.pause()
    await run.edit(c.Disable("between"))
    await asyncio.sleep(0.1)
    assert run.report().edges["pump.many -> join.a"].grown == 0
    run.resume()


CLOSE: dict[str, Callable[[hfg.Run], Awaitable[None]]] = {
    "an edge is removed": lambda run: close_by_edit(run, c.Disconnect("between.out", "relay.hear")),
    "a node is removed": lambda run: close_by_edit(run, c.Remove("between")),
    "a node is disabled": lambda run: close_by_edit(run, c.Disable("between")),
    "a node is replaced": lambda run: close_by_edit(
        run, c.Disconnect("first.out", "between.value"), c.Replace("between", "hfg.testing.nodes:double")
    ),
    "an edge comes to lead elsewhere": lambda run: close_by_edit(
        run, c.Disconnect("relay.passed", "join.b"), c.Connect("pump.once", "join.b")
    ),
    "disable": close_by_itself,  # the slot
    "it is disabled in a pause": close_while_paused,
}


@pytest.mark.rule("F8", "R4", "F10", "R3")
@pytest.mark.parametrize("how", CLOSE)
def test_a_ring_grows_when_what_opened_it_is_gone(how: str) -> None:
    """Beside what lives on, and so the graph is never quiet; at the moment at which the ring closes."""
    trace: list[TraceEvent] = []
    slot = how if CLOSE[how] is close_by_itself else ""

    async def main() -> tuple[Any, list[int], int]:
        async with asyncio.timeout(10), hfg.running(opened(slot), trace=trace) as run:
            await asyncio.sleep(0.05)
            before = run.report().edges["pump.many -> join.a"].grown
            await CLOSE[how](run)
            await asyncio.sleep(0)
            await asyncio.sleep(0.001)
            keep: Any = run.graph["keep"]
            values = list(keep.values)
            run.stop()
        return before, values, run.report().edges["pump.many -> join.a"].grown

    assert drive(main) == (0, [7], 4)
    replaying = Replay(opened(slot), held_open=True)
    for event in trace if CLOSE[how] is not close_while_paused else ():  # of which a trace does not tell
        if isinstance(event, RunEnded) or (isinstance(event, TokenDropped) and event.reason == "stopped"):
            break
        replaying.see(event)
    replaying.machine.close()


class Slowly(hfg.Node):
    """Asks often; an edit waits for it meanwhile."""

    many = hfg.Event(int)
    once = hfg.Event(int)

    @hfg.slot
    async def begin(self) -> None:
        for number in range(5):
            await self.many.trigger_wait(number)
        self.once.trigger(7)


@pytest.mark.rule("F8", "R4")
def test_a_ring_grows_whose_nodes_an_edit_waits_for() -> None:
    """The edit waits for the code of one and holds the other: nothing but a longer queue lets it go on."""

    async def main() -> list[int]:
        graph = hfg.Graph()
        asks, join, keep = graph.add(Slowly(), name="asks"), graph.add(add(), name="join"), graph.add(Keep())
        graph.connect(graph.input("go", int), asks.begin)
        graph.connect(asks.many, join.a, capacity=2)
        graph.connect(asks.once, join.b)
        graph.connect(join.out, keep.value)
        a_task(graph)
        async with hfg.running(graph) as run:
            await asyncio.sleep(0.05)
            await run.trigger(asks.begin)
            async with asyncio.timeout(1):
                await run.edit(c.Rename("asks", "asked"), c.Disconnect("join.out", f"{keep.place.path}.value"))
            run.stop()
        return keep.values

    drive(main)


# --- random graphs ---

RINGS = Allowed(rings=True, max_nodes=4)


@pytest.mark.slow
@pytest.mark.rule("F8", "F6", "F9")
@pytest.mark.parametrize("block", range(4))
def test_random_rings_beside_what_lives_on_grow_when_the_oracle_says_so(block: int) -> None:
    for seed in range(20 * block, 20 * block + 20):
        allowed = Allowed(rings=True, max_nodes=4, concurrency=seed % 3 == 0, tasks=seed % 4 == 0)
        plan = random_plan(seed, allowed)
        if reference(plan, seed) is not None:
            check(plan, seed)


def answers(plan: GraphPlan) -> dict[str, int] | None:
    """How many answers each gate of a plan has heard in its first second; None if it goes round for ever."""
    graph = plan.build()
    try:
        hfg.run(graph, clock="virtual", until_s=1.0)
    except hfg.errors.RunError:
        return None
    return {name: node.heard for name, node in graph.nodes.items() if name.startswith("gate")}  # type: ignore[attr-defined]


def lives(plan: GraphPlan) -> GraphPlan:
    """The same graph with something beside it that never ends and that nobody hears."""
    beside = (NodePlan("beside", "Watch", {"count": 10**6, "period_s": 0.013}), NodePlan("none", "Watch", {"count": 0}))
    return replace(plan, nodes=(*plan.nodes, *beside))


@pytest.mark.slow
@pytest.mark.rule("F8")
@pytest.mark.parametrize("block", range(3))
def test_no_ring_stands_still_because_something_lives_beside_it(block: int) -> None:
    """An invariant without the oracle: what a graph has answered by itself it answers beside a ticker too."""
    allowed = Allowed(rings=True, max_nodes=2, failures=False, disabling=False, gates=False)
    for seed in range(30 * block, 30 * block + 30):
        plan = random_plan(seed, allowed)
        alone = answers(plan)
        assert alone is None or answers(lives(plan)) == alone, f"seed {seed}:\n{plan}"


@pytest.mark.rule("F8")
def test_the_oracle_sees_a_ring_beside_what_waits() -> None:
    graph, _ = gateway()
    a_source_with_a_rate(graph)
    report = reference_run(graph, until_s=2.0)
    assert report.grown == {"gate.request -> ask.value": 24}
    assert len(report.values("ask.out -> gate.answer")) == 40


class Doubles(hfg.Node):
    """Sends two requests for each answer, so that more and more of them go round."""

    request = hfg.Event(int)

    most = hfg.Parameter(400)
    sent = hfg.State(0)

    @hfg.slot
    def begin(self) -> None:
        self.request.trigger(0)

    @hfg.slot
    def answer(self, number: int) -> None:
        for _ in range(2):
            if self.sent < self.most:
                self.sent += 1
                self.request.trigger(number)


class Answers(hfg.Node):
    reply = hfg.Event(int)

    @hfg.slot
    def ask(self, number: int) -> None:
        self.reply.trigger(number)


def doubling(most: int, capacity: int) -> hfg.Graph:
    graph = hfg.Graph("doubling")
    gate, answers = graph.add(Doubles(most=most), name="gate"), graph.add(Answers(), name="answers")
    graph.connect(gate.request, answers.ask, capacity=capacity)
    graph.connect(answers.reply, gate.answer, capacity=capacity)
    graph.start.activates(gate.begin)
    return graph


def run_doubling(most: int, capacity: int = 4) -> tuple[hfg.Report, Glance]:
    graph, runs = doubling(most, capacity), list[hfg.Run]()
    report = hfg.run(graph, clock="virtual", begin=runs.append)
    return report, runs[0].glance()


@pytest.mark.rule("F8")
def test_a_ring_whose_queues_grow_many_times_over_is_reported_once(caplog: pytest.LogCaptureFixture) -> None:
    report, glance = run_doubling(most=400)
    (error,) = report.errors
    assert 'the queue of "gate.request -> answers.ask" has grown from capacity=4 to 65' in error
    assert "because the nodes of the ring gate -> answers -> gate wait for each other (rule F8)" in error
    assert "declare capacity=130" in error
    assert caplog.messages.count(error) == 1
    assert set(glance.growing) == {edge for edge, one in report.edges.items() if one.grown > 60}
    assert min(glance.growing.values()) > 64


@pytest.mark.rule("F8")
@pytest.mark.parametrize(("most", "capacity"), [(40, 4), (400, 64)], ids=["a few more", "as declared"])
def test_a_ring_whose_queues_grow_a_little_is_not_reported(
    caplog: pytest.LogCaptureFixture, most: int, capacity: int
) -> None:
    report, glance = run_doubling(most, capacity)
    assert any(edge.grown for edge in report.edges.values())
    assert (report.errors, glance.growing, caplog.messages) == ([], {}, [])
