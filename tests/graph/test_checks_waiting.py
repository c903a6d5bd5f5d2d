"""Rings behind queues, nodes without a process function, nodes that need the loop (rules F2, F8, R1)."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from hfg.engine.executing.watchdog import remedy_for
from hfg.errors import Problem
from hfg.nodes import activity


def found(graph: hfg.Graph, check: str) -> list[Problem]:
    return [problem for problem in graph.check() if problem.check == check]


@hfg.node
def numbers(*, count: int = 2) -> Iterator[int]:
    yield from range(count)


@hfg.node
def double(value: int) -> int:
    return 2 * value


class Gate(hfg.Node):
    """Asks in a loop, or once for each answer."""

    many = hfg.Event(int)
    single = hfg.Event(int)

    async def pump(self) -> None:
        for number in range(100):
            await self.many.trigger_wait(number)

    @hfg.slot
    async def hear(self, value: int) -> None:
        await asyncio.sleep(0)
        self.single.trigger(value)


def ring(event: str, **options: Any) -> hfg.Graph:
    graph = hfg.Graph()
    gate, asked = graph.add(Gate(), name="gate"), graph.add(double())
    graph.connect(getattr(gate, event), asked.value, **options)
    graph.connect(asked.out, gate.hear)
    return graph


# --- rings ---


@pytest.mark.rule("F8")
def test_a_ring_whose_code_triggers_in_a_loop_is_told_with_its_place() -> None:
    (problem,) = found(ring("many"), "waiting-ring")
    assert (problem.severity, problem.path) == ("hint", "gate.many -> double.value")
    assert "gate -> double -> gate" in problem.what
    assert "cannot be seen from outside" in problem.why


@pytest.mark.rule("F8")
def test_a_ring_that_makes_one_signal_of_one_or_loses_some_is_harmless() -> None:
    """An `await` is a loop in bytecode, but none that triggers twice."""
    assert not found(ring("single"), "waiting-ring")
    assert not found(ring("many", overflow="latest"), "waiting-ring")
    assert not found(ring("many", overflow="drop_oldest", capacity=4), "waiting-ring")


@pytest.mark.rule("F8", "P7")
def test_where_as_many_go_round_as_there_were_at_first_the_capacity_is_computed_and_suffices() -> None:
    def sent_round(capacity: int) -> hfg.Graph:
        graph = hfg.Graph()
        first, second = graph.add(double(), name="first"), graph.add(double(), name="second")
        graph.connect(first.out.sent, second.value, capacity=capacity)
        graph.connect(second.out.sent, first.value, initial=[0] * 5)
        return graph

    (problem,) = found(sent_round(4), "waiting-ring")
    assert "5 signals go round" in problem.what
    assert "capacity=6" in problem.remedy
    assert not found(sent_round(6), "waiting-ring")


# --- nodes without a process function ---


@pytest.mark.rule("F2")
def test_a_class_with_inputs_and_no_process_is_refused_and_the_near_name_told() -> None:
    class Typo(hfg.Node):
        value = hfg.Input(int)

        def proces(self, value: int) -> None: ...

    class Nothing(hfg.Node):
        value = hfg.Input(int)

        @hfg.slot
        def hear(self) -> None: ...

    graph = hfg.Graph()
    typo, nothing = graph.add(Typo()), graph.add(Nothing())
    source = graph.add(numbers())
    graph.connect(source.out, typo.value)
    graph.connect(source.out, nothing.value)
    near, bare = found(graph, "missing-process")
    assert (near.path, near.severity) == ("typo", "error")
    assert near.why == "its method proces() looks like a misspelt process()"
    assert (bare.path, bare.why) == ("nothing", "what comes to its inputs is never taken (rules F1, F2)")


def test_nodes_that_live_by_their_slots_and_subgraphs_lack_nothing() -> None:
    class Box(hfg.Subgraph):
        value = hfg.Input(int)

        def build(self, graph: hfg.Graph) -> None:
            graph.connect(self.value.inner, graph.add(double()).value)

    graph = hfg.Graph()
    graph.connect(graph.add(numbers()).out, graph.add(Box()).value)
    graph.add(Gate())
    assert not found(graph, "missing-process")


# --- nodes that need the loop ---


class Timed:
    """A helper that begins a task of a node."""

    def __init__(self, node: hfg.Node) -> None:
        self.node = node

    def begin(self) -> None:
        self.node.start_soon(asyncio.sleep(1))


class ByItself(hfg.Node):
    @hfg.slot
    def begin(self) -> None:
        self.start_soon(asyncio.sleep(1))


class ByHelper(hfg.Node):
    @hfg.slot
    def begin(self) -> None:
        Timed(self).begin()


class Plain(hfg.Node):
    @hfg.slot
    def begin(self) -> None: ...


@pytest.mark.rule("R1")
@pytest.mark.parametrize("node", [ByItself, ByHelper, activity.Wait, activity.TimeLimit])
def test_a_node_that_begins_tasks_is_refused_in_a_thread_before_the_run(node: type[hfg.Node]) -> None:
    graph = hfg.Graph()
    graph.group("work")
    graph.add(node(), name="node", group="work")
    (problem,) = found(graph, "async-in-thread")
    assert (problem.path, problem.severity) == ("node", "error")
    assert problem.what == 'its code begins tasks (start_soon), but its group "work" is a thread'


@pytest.mark.rule("R1")
def test_others_may_be_in_threads() -> None:
    graph = hfg.Graph()
    graph.group("work")
    graph.add(Plain(), group="work")
    graph.add(double(), group="work")
    assert not found(graph, "async-in-thread")


# --- advice that works ---


def block() -> None:
    time.sleep(0.05)


@hfg.node
async def slow_async(value: int) -> int:
    block()
    return value


@hfg.node
async def slow_beside(value: int) -> int:
    await asyncio.to_thread(block)
    return value


@hfg.node
def slow_plain(value: int) -> int:
    time.sleep(0.05)
    return value


class SlowSlot(hfg.Node):
    """A plain function that blocks, beside a slot that needs the loop."""

    value = hfg.Input(int)

    def process(self, value: int) -> None:
        time.sleep(0.05)

    @hfg.slot
    async def hear(self, value: int) -> None: ...


def accepted(node: hfg.Node, **options: Any) -> bool:
    """Whether the checks accept it so."""
    graph = hfg.Graph()
    if "group" in options:
        graph.group(options["group"], threads=1)
    graph.connect(graph.add(numbers(count=1)).out, graph.add(node, **options).ports.inputs["value"])
    return not [problem for problem in graph.check() if problem.severity == "error"]


@pytest.mark.rule("R1")
@pytest.mark.parametrize("node", [slow_plain(), slow_async(), SlowSlot(), activity.Wait(), ByHelper(), slow_beside()])
def test_what_the_watchdog_advises_is_accepted_by_the_checks(node: hfg.Node) -> None:
    """A thread is advised to whom the checks let into one, and to nobody else."""
    advice = remedy_for(node)
    if "value" not in node._type.inputs:
        assert "asyncio.to_thread" in advice
    elif 'group="work"' in advice:
        assert accepted(node, group="work")
    else:
        assert not accepted(type(node)(), group="work")
        assert "asyncio.to_thread" in advice
        assert accepted(slow_beside())  # which is the same, written so


@pytest.mark.rule("X2", "F14")
def test_what_checks_advise_is_accepted_by_them() -> None:
    """A thread is advised only for nodes that may be in one."""
    graph = hfg.Graph()
    graph.add(SlowSlot(), name="bound", max_duration_s=1.0)
    graph.add(slow_plain(), name="free", max_duration_s=1.0)
    remedies = {problem.path: problem.remedy for problem in found(graph, "limit-without-effect")}
    assert "thread" not in remedies["bound"]
    assert 'group="work"' in remedies["free"]
    advised = hfg.Graph()
    advised.group("work")
    advised.add(slow_plain(), group="work", max_duration_s=1.0)
    assert not found(advised, "limit-without-effect")
    assert not found(advised, "async-in-thread")


@pytest.mark.rule("F8", "L1")
def test_a_ring_of_queues_that_wait_may_not_lead_through_another_process() -> None:
    def crossing(**options: Any) -> list[Problem]:
        graph = hfg.Graph()
        graph.group("far", process=True)
        here, there = graph.add(Gate(), name="here"), graph.add(Gate(), name="there", group="far")
        graph.connect(here.single, there.hear)
        graph.connect(there.single, here.hear, **options)
        return [problem for problem in found(graph, "process-border") if "queues wait" in problem.what]

    (problem,) = crossing()
    assert problem.severity == "error"
    assert not crossing(overflow="latest")
