"""Who can ever become active, and what the checks say of it (rules A3-A14, G2)."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from typing import Any

import pytest

import hfg
from hfg.analysis.checks import Found
from hfg.analysis.words import sets_modifiers
from hfg.engine.runtime import engine
from hfg.errors import Problem, RunError
from hfg.graph.flat import flatten, scope_end
from hfg.testing import recorder
from hfg.testing.nodes import Greeter, double, script, sink
from hfg.trace import ActivityChanged, CallEnded, CallStarted, TraceEvent
from tests.support.making import Allowed, random_plan


class Step(hfg.Node):
    """A state: entered by a slot, left by one of two events, or by an output."""

    value = hfg.Input(int, optional=True)
    other = hfg.Input(int, optional=True)
    out = hfg.Output(int)
    done = hfg.Event(int)
    lost = hfg.Event(int)

    @hfg.slot
    def enter(self, token: int) -> None: ...

    def process(self, value: int | None, other: int | None) -> int: ...


def give_up(event: Any) -> None:
    """Give activity on behalf of others."""
    event.trigger(1, activity=1)


class ByHelper(Step):
    """Its own code says nothing of activity, what it calls does."""

    def process(self, value: int | None, other: int | None) -> int:
        give_up(self.done)
        return 1


class ByKeywords(Step):
    def process(self, value: int | None, other: int | None) -> int:
        options = {"activity": 1}
        self.done.trigger(1, **options)
        return 1


@hfg.node
def made(value: int) -> int:
    return hfg.Token(value, 1)  # type: ignore[return-value]


@pytest.fixture
def graph() -> hfg.Graph:
    return hfg.Graph("mission")


def found(graph: hfg.Graph, check: str) -> list[Problem]:
    return [problem for problem in graph.check() if problem.check == check]


def one(graph: hfg.Graph, check: str) -> Problem:
    (problem,) = found(graph, check)
    return problem


def of_activity(graph: hfg.Graph) -> list[str]:
    return [p.check for p in graph.check() if p.check in ("never-active", "idle-active-edge", "activity-fork")]


# --- never active ---


@pytest.mark.rule("A3", "A10")
def test_activity_that_begins_at_start_reaches_whom_active_edges_lead_to(graph: hfg.Graph) -> None:
    first, second, third = (graph.add(Step()) for _ in range(3))
    graph.connect(graph.start, first.activate, active=True)
    graph.connect(first.done, second.enter, active=True)
    graph.connect(second.out, third.value, active=True)
    assert of_activity(graph) == []
    assert Found(flatten(graph)).spread.active == [True, True, True]


@pytest.mark.rule("A3", "A7")
def test_a_node_that_only_plain_edges_lead_to_is_never_active_nor_who_is_behind_it(graph: hfg.Graph) -> None:
    begin, first, second = (graph.add(Step(), name=name) for name in ("begin", "first", "second"))
    graph.connect(graph.start, begin.activate, active=True)
    graph.connect(begin.done, first.enter)
    graph.connect(second.done, first.enter, active=True)
    graph.connect(first.done, second.enter, active=True)
    problem = one(graph, "never-active")
    assert (problem.path, problem.severity) == ("first", "warning")
    assert 'nor "second" behind it' in problem.what
    assert '"first.done -> second.enter" is active' in problem.why
    assert "graph.start" in problem.remedy


@pytest.mark.rule("A11")
def test_a_gate_by_a_node_that_is_never_active_is_found(graph: hfg.Graph) -> None:
    begin, mode, work = (graph.add(Step(), name=name) for name in ("begin", "mode", "work"))
    graph.start.activates(begin.activate)
    graph.gate(work, by=mode)
    problem = one(graph, "never-active")
    assert problem.path == "mode"
    assert 'a gate lets "work" work only while it is active' in problem.why


@pytest.mark.rule("A12")
def test_a_time_limit_of_an_activity_that_never_comes_is_found(graph: hfg.Graph) -> None:
    begin = graph.add(Step(), name="begin")
    graph.add(Step(), name="limited", active_for_s=3.0)
    graph.start.activates(begin.activate)
    assert (one(graph, "never-active").path, one(graph, "never-active").why) == (
        "limited",
        "though it has active_for_s",
    )


@pytest.mark.rule("A10")
def test_where_nothing_begins_all_activity_may_come_from_outside_so_it_is_a_hint(graph: hfg.Graph) -> None:
    first, second = graph.add(Step()), graph.add(Step())
    graph.connect(first.done, second.enter, active=True)
    assert one(graph, "never-active").severity == "hint"
    assert "run.trigger" in one(graph, "never-active").remedy


@pytest.mark.rule("A9")
@pytest.mark.parametrize("way", ["activate", "activated", "processed", "timeout", "feed"])
def test_what_gives_activity_otherwise_is_known(graph: hfg.Graph, way: str) -> None:
    first, second = graph.add(Step(), active_for_s=1.0), graph.add(Step())
    if way == "activate":
        graph.connect(graph.add(Step()).done, first.activate)
    elif way == "feed":
        graph.connect(graph.input("orders", int), first.value, active=True)
    else:
        graph.start.activates(first.activate)
    event = first.ports.events[way] if way in ("activated", "processed", "timeout") else first.done
    graph.connect(event, second.activate if way != "feed" else second.enter, active=True)
    assert of_activity(graph) == []


@pytest.mark.rule("A4")
@pytest.mark.parametrize("kind", [Greeter, ByHelper, ByKeywords, made])
def test_code_that_sets_modifiers_by_itself_is_left_alone(graph: hfg.Graph, kind: Any) -> None:
    node, after = graph.add(kind()), graph.add(Step(), active_for_s=1.0)
    graph.connect(node.ports.outputs["out"], after.value, active=True)
    graph.connect(graph.add(script()).out, node.ports.inputs["value"])
    assert sets_modifiers(type(node)._type)
    assert of_activity(graph) == []


@pytest.mark.rule("A4")
def test_code_that_does_not_speak_of_activity_gives_none() -> None:
    assert not any(sets_modifiers(type(node)._type) for node in (Step(), double(), script(), sink()))
    assert not sets_modifiers(type(hfg.node(abs, inputs={"x": int}, outputs=int)())._type)


@pytest.mark.rule("G2")
def test_a_subgraph_is_active_when_something_inside_may_be(graph: hfg.Graph) -> None:
    class Box(hfg.Subgraph):
        begin = hfg.slot(type=int)

        def build(self, graph: hfg.Graph) -> None:
            self.step = graph.add(Step())
            graph.connect(self.begin.inner, self.step.enter, active=True)

    class Reached(Box):
        def build(self, graph: hfg.Graph) -> None:
            super().build(graph)
            graph.start.activates(self.step.activate)

    begin, work = graph.add(Step()), graph.add(Step(), name="work")
    reached, lost = graph.add(Reached()), graph.add(Box(), active_for_s=2.0)
    graph.start.activates(begin.activate)
    graph.gate(work, by=reached)
    assert one(graph, "never-active").path == "box"
    found = Found(flatten(graph)).spread
    assert (found.may_be_active(scope_end(0)), found.may_be_active(scope_end(1))) == (True, False)
    graph.connect(begin.done, lost.begin, active=True)
    assert of_activity(graph) == []


@pytest.mark.rule("A9")
def test_an_active_edge_from_deactivated_never_carries_anything(graph: hfg.Graph) -> None:
    first, second = graph.add(Step()), graph.add(Step())
    graph.start.activates(first.activate)
    graph.connect(first.deactivated, second.activate, active=True)
    assert one(graph, "idle-active-edge").path == "step.deactivated -> step_2.activate"


@pytest.mark.rule("F1")
def test_an_active_edge_from_the_output_of_a_node_that_never_fires_is_found(graph: hfg.Graph) -> None:
    class Waits(hfg.Node):
        need = hfg.Input(int)
        out = hfg.Output(int)

        def process(self, need: int) -> int: ...

    node, after = graph.add(Waits()), graph.add(Step())
    graph.start.activates(node.activate)
    graph.connect(node.out, after.value, active=True)
    assert one(graph, "idle-active-edge").why == "this node never fires"


def became_active(trace: list[TraceEvent]) -> set[str]:
    """Who has had activity; what comes over an active edge into `deactivate` is taken away in the same call (A7)."""
    had: set[str] = set()
    calls: dict[str, str] = {}  # by node, the slot under way
    for event in trace:
        if isinstance(event, CallStarted):
            calls[event.node] = event.slot
        elif isinstance(event, CallEnded):
            del calls[event.node]
        elif isinstance(event, ActivityChanged) and event.active and calls.get(event.node) != "deactivate":
            had.add(event.node)
    return had


@pytest.mark.slow
@pytest.mark.rule("A1", "A3")
@pytest.mark.parametrize("block", range(4))
def test_whoever_becomes_active_in_a_run_was_expected_to(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The analysis against the engine on random graphs: what it rules out never happens."""
    monkeypatch.setattr(engine, "_MOST_AT_ONE_INSTANT", 20_000)  # some go round for ever
    ruled_out = seen = 0
    for seed in range(50 * block, 50 * block + 50):
        graph = random_plan(seed, Allowed(failures=False, waiting=False)).build()
        flat = flatten(graph)
        analysis = Found(flat).spread
        trace = recorder()
        with contextlib.suppress(RunError):
            hfg.run(graph, clock="virtual", policy="random", seed=seed, trace=trace, until_s=5)
        became = became_active(list(trace))
        seen += len(became)
        for node, may in zip(flat.nodes, analysis.active, strict=True):
            assert may or node.path not in became, f"seed {seed}: {node.path}"
            ruled_out += not may
    assert min(ruled_out, seen) > 20


# --- forks ---


def machine(graph: hfg.Graph) -> list[Step]:
    states = [graph.add(Step(), name=name) for name in ("idle", "drive", "grasp")]
    graph.connect(graph.start, states[0].activate, active=True)
    for state, after in zip(states, (*states[1:], states[0]), strict=True):
        graph.connect(state.done, after.enter, active=True)
    return states


@pytest.mark.rule("A13")
def test_a_machine_with_an_event_for_each_transition_is_sound(graph: hfg.Graph) -> None:
    idle, drive, grasp = machine(graph)
    graph.connect(drive.lost, idle.enter, active=True)
    graph.connect(grasp.lost, grasp.enter, active=True)
    assert of_activity(graph) == []


@pytest.mark.rule("A3", "A13")
def test_one_event_that_makes_two_states_active_is_a_fork(graph: hfg.Graph) -> None:
    idle, drive, _ = machine(graph)
    graph.connect(drive.done, idle.enter, active=True)
    problem = one(graph, "activity-fork")
    assert (problem.path, problem.severity) == ("drive.done", "warning")
    assert '"grasp" and "idle" active at once' in problem.what or '"idle" and "grasp" active at once' in problem.what


@pytest.mark.rule("A10", "A13")
def test_two_initial_states_are_a_fork(graph: hfg.Graph) -> None:
    _, drive, _ = machine(graph)
    graph.start.activates(drive.activate)
    assert one(graph, "activity-fork").path == "start"


@pytest.mark.rule("A3")
def test_two_ways_at_once_that_a_node_waits_for_are_meant(graph: hfg.Graph) -> None:
    """Fork and join: both branches end in inputs of one node."""
    begin, left, right, join = (graph.add(Step(), name=name) for name in ("begin", "left", "right", "join"))
    graph.start.activates(begin.activate)
    graph.connect(begin.done, left.enter, active=True)
    graph.connect(begin.done, right.enter, active=True)
    graph.connect(left.done, join.value, active=True)
    graph.connect(right.done, join.other, active=True)
    graph.connect(join.done, begin.enter, active=True)
    assert of_activity(graph) == []


@pytest.mark.rule("A3")
def test_a_fork_into_what_never_comes_back_is_no_machine(graph: hfg.Graph) -> None:
    begin, work, lamp = graph.add(Step()), graph.add(Step()), graph.add(Step())
    graph.start.activates(begin.activate)
    graph.connect(begin.done, work.enter, active=True)
    graph.connect(begin.done, lamp.enter, active=True)
    graph.connect(work.done, begin.enter, active=True)
    assert of_activity(graph) == []


# --- limits without an end, activity that stays ---


def problems(graph: hfg.Graph, check: str) -> list[Problem]:
    return [problem for problem in graph.check() if problem.check == check]


@pytest.mark.rule("A12")
def test_a_time_limit_that_nobody_hears_of_is_told_and_one_that_somebody_does_is_not() -> None:
    graph = hfg.Graph()
    step, other = graph.add(Step(), name="step", active_for_s=3.0), graph.add(Step(), name="other")
    graph.start.activates(step.activate)
    (problem,) = problems(graph, "unheard-timeout")
    assert (problem.path, problem.severity) == ("step", "warning")
    graph.connect(step.timeout, other.activate, active=True)
    assert not problems(graph, "unheard-timeout")


@pytest.mark.rule("A12")
def test_a_subscriber_hears_of_it_too() -> None:
    graph = hfg.Graph()
    step = graph.add(Step(), active_for_s=3.0)
    graph.start.activates(step.activate)
    step.timeout.subscribe(print)
    assert not problems(graph, "unheard-timeout")


@pytest.mark.rule("A5", "A7", "A9")
def test_activity_that_stays_though_somebody_waits_until_it_leaves_is_told() -> None:
    def build(*, active: bool = False, freed: bool = False, waited: bool = True) -> list[Problem]:
        graph = hfg.Graph()
        step, after = graph.add(Step(), name="step"), graph.add(Step(), name="after")
        graph.start.activates(step.activate)
        graph.connect(step.done, after.enter, active=active)
        if waited:
            graph.connect(step.deactivated, after.ports.slots["reset"])
        if freed:
            graph.connect(after.done, step.ports.slots["deactivate"])
        return problems(graph, "captive-activity")

    (problem,) = build()
    assert (problem.path, problem.severity) == ("step", "warning")
    assert '"step.deactivated -> after.reset" waits' in problem.what
    assert not build(active=True)
    assert not build(freed=True)
    assert not build(waited=False)  # a last state


def test_a_graph_is_checked_for_activity_in_a_program_that_imports_only_hfg() -> None:
    """Nothing else has to import the module that has the checks."""
    program = (
        "import hfg\n"
        "class State(hfg.Node):\n"
        "    @hfg.slot\n"
        "    def enter(self) -> None: ...\n"
        "graph = hfg.Graph()\n"
        "graph.add(State(), active_for_s=3)\n"
        "print([problem.check for problem in graph.check()])\n"
    )
    shown = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert "unheard-timeout" in shown
