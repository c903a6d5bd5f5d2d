"""Work coupled to activity, and activity that runs out (rules A11, A12)."""

from __future__ import annotations

import asyncio

import pytest

import hfg
from hfg.testing import Recorder, explore, recorder, replay
from tests.semantics.nodes import (
    Clock,
    Ear,
    Keep,
    KeepTokens,
    Send,
    Timed,
    drive,
    firings,
    forward,
    forward_later,
    numbers,
    run,
    slow_numbers,
    traced,
)


def gated(graph: hfg.Graph, **options: object) -> tuple[hfg.Node, Keep, Ear]:
    """Numbers each second from 1 to 6, through a node that is gated by `state`, which is active from 2.5 to 4.4."""
    source, state = graph.add(slow_numbers(count=6, pause_s=1)), graph.add(Ear(), name="state")
    node, sink = graph.add(forward()), graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    up, down = graph.add(slow_numbers(count=1, pause_s=2.5)), graph.add(slow_numbers(count=1, pause_s=4.4))
    graph.connect(up.out, state.activate)
    graph.connect(down.out, state.deactivate)
    return node, sink, state


@pytest.mark.rule("A11")
def test_a_suspended_node_is_silent_while_the_state_is_inactive(fast: bool) -> None:
    graph = hfg.Graph()
    node, sink, state = gated(graph)
    graph.gate(node, by=state)
    report = run(graph, fast)
    assert sink.values == [3, 4]
    assert report.nodes["forward"].silent == 4


@pytest.mark.rule("A11", "F4")
def test_a_gate_makes_silent_what_holds_values_and_end_still_ends() -> None:
    graph = hfg.Graph()
    node, _, state = gated(graph)
    graph.gate(node, by=state)
    assert firings(traced(graph), "forward") == ["silent"] * 2 + ["process"] * 2 + ["silent"] * 2 + ["end"]


@pytest.mark.rule("A11")
def test_modifiers_act_in_a_suspended_node_too(fast: bool) -> None:
    graph = hfg.Graph()
    source, send, node = graph.add(numbers(count=1)), graph.add(Send(modifier=1)), graph.add(Keep())
    state = graph.add(Ear())
    graph.connect(source.out, send.value)
    graph.connect(send.out, node.value, active=True)
    graph.gate(node, by=state)
    report = run(graph, fast)
    assert node.values == []
    assert report.nodes["keep"].active


@pytest.mark.rule("A11")
def test_the_slot_calls_of_a_suspended_node_run_as_always(fast: bool) -> None:
    graph = hfg.Graph()
    source, ear, state = graph.add(numbers(count=2)), graph.add(Ear()), graph.add(Ear())
    graph.connect(source.out, ear.hear)
    graph.gate(ear, by=state)
    run(graph, fast)
    assert ear.heard == [1, 2]


@pytest.mark.rule("A11")
def test_a_throttled_node_runs_at_the_idle_rate_and_holds_nobody_up(fast: bool) -> None:
    graph = hfg.Graph()
    source, state = graph.add(Clock(), max_rate_hz=8), graph.add(Ear(), name="state")
    node, sink, all_ = graph.add(forward()), graph.add(Timed()), graph.add(Keep(), name="all")
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    graph.connect(source.out, all_.value)
    graph.gate(node, by=state, idle_rate_hz=2)
    run(graph, fast, until_s=2.0625)
    assert [time for _, time in sink.seen] == [0, 0.5, 1.0, 1.5, 2.0]
    assert len(all_.values) == 17


@pytest.mark.rule("A11")
def test_a_throttled_node_runs_always_while_the_state_is_active(fast: bool) -> None:
    graph = hfg.Graph()
    node, sink, state = gated(graph)
    graph.gate(node, by=state, idle_rate_hz=0.1)
    run(graph, fast)
    assert sink.values == [1, 3, 4]


@pytest.mark.rule("A11")
def test_a_node_that_is_its_own_gate_works_while_it_is_active(fast: bool) -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(slow_numbers(count=6, pause_s=1)), graph.add(forward()), graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    graph.connect(graph.add(slow_numbers(count=1, pause_s=2.5)).out, node.activate)
    graph.connect(graph.add(slow_numbers(count=1, pause_s=4.5)).out, node.deactivate)
    graph.gate(node, by=node)
    run(graph, fast)
    assert sink.values == [3, 4]


@pytest.mark.rule("A11", "A6")
@pytest.mark.parametrize("boxed", [True, False])
def test_what_comes_together_with_the_activity_finds_the_gate_closed_as_the_firing_starts(boxed: bool) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        send, box = graph.add(Send(modifier=1)), graph.add(Kept())
        graph.connect(graph.add(numbers(count=3)).out, send.value)
        graph.connect(send.out, box.value, active=True)
        graph.gate(box, by=box if boxed else box.graph["keep"])
        return graph

    assert firings(traced(build()), "kept/keep") == ["silent", "process", "process", "end"]
    explore(build, runs=3, conform=True)


class Kept(hfg.Subgraph):
    value = hfg.Input(int)

    def build(self, graph: hfg.Graph) -> None:
        graph.connect(self.value.inner, graph.add(Keep()).value, active=True)


@pytest.mark.rule("A11")
def test_a_suspended_source_rests(fast: bool) -> None:
    graph = hfg.Graph()
    _, _, state = gated(graph)
    clock, sink = graph.add(Clock(), max_rate_hz=4), graph.add(Timed())
    graph.connect(clock.out, sink.value)
    graph.gate(clock, by=state)
    report = run(graph, fast)
    times = [time for _, time in sink.seen]
    assert (times[0], times[-1], len(times)) == (2.5, 4.25, 8)
    assert report.nodes["clock"].silent == 0


@pytest.mark.rule("A11", "R5")
def test_a_resting_source_does_not_keep_the_run_open(fast: bool) -> None:
    graph = hfg.Graph()
    state, clock, sink = graph.add(Ear()), graph.add(Clock(), max_rate_hz=1), graph.add(Keep())
    graph.connect(clock.out, sink.value)
    graph.gate(clock, by=state)
    assert run(graph, fast).outcome == "done"
    assert sink.values == []


@pytest.mark.rule("A11")
def test_a_throttled_source_fires_at_most_at_the_idle_rate(fast: bool) -> None:
    graph = hfg.Graph()
    _, _, state = gated(graph)
    clock, sink = graph.add(Clock(), max_rate_hz=4), graph.add(Timed())
    graph.connect(clock.out, sink.value)
    graph.gate(clock, by=state, idle_rate_hz=1)
    run(graph, fast, until_s=6)
    times = [time for _, time in sink.seen]
    assert times[:3] == [0, 1, 2]
    assert times[3:11] == [2.5, 2.75, 3.0, 3.25, 3.5, 3.75, 4.0, 4.25]
    assert times[11:] == [5.25]


@pytest.mark.rule("A11", "G1")
def test_a_source_behind_two_gates_fires_at_the_lower_idle_rate(fast: bool) -> None:
    times, trace = behind_two_gates(fast, 2.0)
    assert times == [0, 0.5, 1.0]
    if not fast:
        replay(two_gates(2.0), trace, until_s=1.2)


@pytest.mark.rule("A11", "G1")
def test_an_idle_rate_does_not_open_another_gate(fast: bool) -> None:
    times, trace = behind_two_gates(fast, None)
    assert times == []
    if not fast:
        replay(two_gates(None), trace, until_s=1.2)


class Inside(hfg.Subgraph):
    """A source, throttled to 5 a second by a state next to it."""

    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        clock, state = graph.add(Clock(), max_rate_hz=10), graph.add(Ear(), name="state")
        graph.connect(clock.out, self.out.inner)
        graph.gate(clock, by=state, idle_rate_hz=5.0)


def two_gates(outer_rate: float | None) -> hfg.Graph:
    graph = hfg.Graph()
    box, sink, state = graph.add(Inside(), name="box"), graph.add(Timed()), graph.add(Ear(), name="state")
    graph.connect(box.ports.outputs["out"], sink.value)
    graph.gate(box, by=state, idle_rate_hz=outer_rate)
    return graph


def behind_two_gates(fast: bool, outer_rate: float | None) -> tuple[list[float], Recorder]:
    """When the source fired, and the trace; there is none on the short ways."""
    graph, trace = two_gates(outer_rate), recorder()
    hfg.run(graph, clock="virtual", until_s=1.2, fast=fast, trace=None if fast else trace)
    return [time for _, time in graph["timed"].seen], trace


@pytest.mark.rule("A11")
def test_the_state_is_looked_at_when_a_firing_starts(fast: bool) -> None:
    graph = hfg.Graph()
    source, slow, sink = graph.add(numbers(count=2)), graph.add(forward_later()), graph.add(Keep())
    state, down = graph.add(Ear()), graph.add(slow_numbers(count=1, pause_s=0.5))
    graph.start.activates(state.begin)
    graph.connect(down.out, state.deactivate)
    graph.connect(source.out, slow.value)
    graph.connect(slow.out, sink.value)
    graph.gate(slow, by=state)
    run(graph, fast)
    assert sink.values == [1]


@pytest.mark.rule("A11", "G1")
def test_a_gate_on_a_subgraph_gates_everything_inside(fast: bool) -> None:
    graph = hfg.Graph()
    box, sink, state = graph.add(Box()), graph.add(Keep()), graph.add(Ear())
    source = graph.add(numbers(count=3))
    graph.connect(source.out, box.value)
    graph.connect(box.out, sink.value)
    graph.gate(box, by=state)
    report = run(graph, fast)
    assert sink.values == []
    assert [report.nodes[name].silent for name in ("box/first", "box/second")] == [3, 3]


class Box(hfg.Subgraph):
    """Two nodes in a row."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        first, second = graph.add(forward(), name="first"), graph.add(forward(), name="second")
        graph.connect(self.value.inner, first.value)
        graph.connect(first.out, second.value)
        graph.connect(second.out, self.out.inner)


class StateBox(hfg.Subgraph):
    """A state in a box."""

    on = hfg.slot(type=object)
    off = hfg.slot(type=object)

    def build(self, graph: hfg.Graph) -> None:
        ear = graph.add(Ear(), name="ear")
        graph.connect(self.on.inner, ear.activate)
        graph.connect(self.off.inner, ear.deactivate)


@pytest.mark.rule("A11", "G2")
def test_a_subgraph_may_be_the_state_of_a_gate(fast: bool) -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(slow_numbers(count=6, pause_s=1)), graph.add(forward()), graph.add(Keep())
    state = graph.add(StateBox())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    up, down = graph.add(slow_numbers(count=1, pause_s=2.5)), graph.add(slow_numbers(count=1, pause_s=4.5))
    graph.connect(up.out, state.on)
    graph.connect(down.out, state.off)
    graph.gate(node, by=state)
    run(graph, fast)
    assert sink.values == [3, 4]


# --- A12 ---


class Worker(hfg.Node):
    """Active from `begin` on; may pass its activity on."""

    rang = hfg.Event()

    @hfg.slot
    def begin(self) -> None:
        pass

    @hfg.slot
    def ring(self, value: object) -> None:
        self.rang.trigger()


@pytest.mark.rule("A12")
def test_a_timeout_moves_the_activity_of_who_was_active_too_long(fast: bool) -> None:
    graph = hfg.Graph()
    node, ear, times = graph.add(Worker(), active_for_s=5), graph.add(Ear()), graph.add(Timed())
    graph.start.activates(node.begin)
    graph.connect(node.timeout, ear.begin, active=True)
    graph.connect(node.timeout, times.value)
    report = run(graph, fast)
    assert times.seen == [(None, 5)]
    assert (report.nodes["worker"].active, report.nodes["ear"].active) == (False, True)


@pytest.mark.rule("A12", "T5")
def test_the_signal_of_a_timeout_is_stamped_now(fast: bool) -> None:
    graph = hfg.Graph()
    node, sink = graph.add(Worker(), active_for_s=5), graph.add(KeepTokens())
    graph.start.activates(node.begin)
    graph.connect(node.timeout, sink.value)
    run(graph, fast)
    assert [(token.value, token.stamp) for token in sink.tokens] == [(None, 5)]


@pytest.mark.rule("A12")
def test_a_timeout_is_triggered_once_as_long_as_the_node_stays_active(fast: bool) -> None:
    graph = hfg.Graph()
    node, times = graph.add(Worker(), active_for_s=1), graph.add(Timed())
    later = graph.add(slow_numbers(count=3, pause_s=1))
    graph.start.activates(node.begin)
    graph.connect(later.out, node.activate)  # no change from 0 to 1
    graph.connect(node.timeout, times.value)
    report = run(graph, fast)
    assert times.seen == [(None, 1)]
    assert report.nodes["worker"].active


@pytest.mark.rule("A12")
def test_activity_that_leaves_in_time_stops_the_clock(fast: bool) -> None:
    graph = hfg.Graph()
    node, ear, times = graph.add(Worker(), active_for_s=5), graph.add(Ear()), graph.add(Timed())
    ring = graph.add(slow_numbers(count=1, pause_s=3))
    graph.start.activates(node.begin)
    graph.connect(ring.out, node.ring)
    graph.connect(node.rang, ear.begin, active=True)
    graph.connect(node.timeout, times.value)
    report = run(graph, fast)
    assert times.seen == []
    assert report.duration_s == 3


@pytest.mark.rule("A12")
def test_the_clock_restarts_on_a_change_from_0_to_1(fast: bool) -> None:
    graph = hfg.Graph()
    node, times = graph.add(Worker(), active_for_s=2), graph.add(Timed())
    off, on = graph.add(slow_numbers(count=1, pause_s=1)), graph.add(slow_numbers(count=1, pause_s=1.5))
    graph.start.activates(node.begin)
    graph.connect(off.out, node.deactivate)
    graph.connect(on.out, node.activate)
    graph.connect(node.timeout, times.value)
    run(graph, fast)
    assert times.seen == [(None, 3.5)]


@pytest.mark.rule("A12", "R5")
def test_a_timeout_that_leads_nowhere_does_not_keep_the_run_open(fast: bool) -> None:
    graph = hfg.Graph()
    node = graph.add(Worker(), active_for_s=5)
    graph.start.activates(node.begin)
    assert run(graph, fast).duration_s == 0


@pytest.mark.rule("A12")
def test_somebody_may_wait_for_a_timeout_from_outside() -> None:
    async def main() -> float:
        graph = hfg.Graph()
        node = graph.add(Worker(), active_for_s=5)
        async with hfg.running(graph) as run:
            waiting = asyncio.create_task(run.wait_for(node.timeout))
            await asyncio.sleep(1)
            await run.trigger(node.begin, activity=1)
            await waiting
            return run.now()

    assert drive(main) == 6


@pytest.mark.rule("A12", "A14")
def test_reset_of_activity_stops_the_clock_and_start_may_begin_it_anew(fast: bool) -> None:
    async def main() -> list[object]:
        graph = hfg.Graph()
        node, times = graph.add(Worker(), active_for_s=2), graph.add(Timed())
        graph.start.activates(node.begin)
        graph.connect(node.timeout, times.value)
        async with hfg.running(graph, fast=fast) as run:
            await asyncio.sleep(1)
            run.reset_activity()
            await asyncio.sleep(5)
        return times.seen

    assert drive(main) == [(None, 3)]
