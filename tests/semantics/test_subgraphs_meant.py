"""Edges and gates that mean a subgraph itself, judged by the oracle (rules A8, A11, F10, G2)."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import hfg
from hfg.ports import OutputPort
from hfg.testing import Recorder, recorder, replay
from hfg.testing.nodes import (
    Counter,
    Pulse,
    Relay,
    Script,
    Waiting,
    add,
    ascript,
    double,
    script,
    sink,
)
from hfg.trace import (
    ActivityChanged,
    ActivityLost,
    CallStarted,
    EventTriggered,
    FiringEnded,
    FiringStarted,
    NodeEnabled,
    TokenDropped,
    TraceEvent,
)
from tests.semantics.nodes import Farewell


class Inner(hfg.Subgraph):
    """One node, and an event that can carry its activity out."""

    begin = hfg.slot(type=object)

    def build(self, graph: hfg.Graph) -> None:
        node = graph.add(Pulse(), name="node")
        graph.connect(self.begin.inner, node.activate, active=True)


class Outer(hfg.Subgraph):
    """A subgraph in a subgraph, whose event it passes on."""

    begin = hfg.slot(type=object)
    begun = hfg.Event()

    def build(self, graph: hfg.Graph) -> None:
        inner = graph.add(Inner(), name="inner")
        graph.connect(self.begin.inner, inner.begin, active=True)
        graph.connect(inner.activated, self.begun.inner)


class Leaving(hfg.Subgraph):
    """What is said in it switches it off."""

    say = hfg.slot(type=int)
    hush = hfg.slot(type=object)
    said = hfg.Event(int)

    def build(self, graph: hfg.Graph) -> None:
        relay = graph.add(Relay(), name="relay")
        graph.connect(self.say.inner, relay.say, active=True)
        graph.connect(self.hush.inner, relay.deactivate)
        graph.connect(relay.said, self.said.inner, active=True)


class Left(hfg.Subgraph):
    """Around such a one."""

    say = hfg.slot(type=int)
    hush = hfg.slot(type=object)

    def build(self, graph: hfg.Graph) -> None:
        inner = graph.add(Leaving(), name="inner")
        graph.connect(self.say.inner, inner.say, active=True)
        graph.connect(self.hush.inner, inner.hush)
        graph.connect(inner.said, inner.disable, active=True)


class Working(hfg.Subgraph):
    """A slow and a quick pipeline."""

    def build(self, graph: hfg.Graph) -> None:
        graph.add(script(values=(1, 2)), name="some") >> graph.add(Waiting(pause_s=0.01), name="slow")
        graph.add(script(values=(1, 2)), name="others") >> graph.add(double(), name="quick")


def judged(build: Callable[[], hfg.Graph]) -> Recorder:
    """Run it in virtual time and compare with the oracle."""
    trace = recorder()
    hfg.run(build(), clock="virtual", trace=trace)
    replay(build(), trace)
    return trace


def of_kind(trace: Recorder, *kinds: type[TraceEvent]) -> list[TraceEvent]:
    return [event for event in trace if isinstance(event, kinds)]


def clock(graph: hfg.Graph, *pauses_s: float) -> list[OutputPort[int]]:
    """Give outputs that speak once, each after its pause."""
    return [
        graph.add(ascript(values=(1,), pause_s=pause), name=f"at_{number}").out for number, pause in enumerate(pauses_s)
    ]


@pytest.mark.rule("A8", "G2")
@pytest.mark.parametrize("slot", ["deactivate", "reset", "enable"])
def test_activity_that_a_slot_of_the_subgraph_itself_takes_is_counted_as_lost(slot: str) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        box = graph.add(Inner(), name="box")
        graph.start.activates(box.ports.slots[slot])
        return graph

    trace = judged(build)
    assert [event.edge for event in trace if isinstance(event, ActivityLost)] == [f"start -> box.{slot}"]
    assert not of_kind(trace, ActivityChanged)


@pytest.mark.rule("F10", "G2")
def test_the_slots_of_a_disabled_subgraph_are_deaf_but_for_enable() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        box = graph.add(Outer(), name="box")
        off, unheard, on, heard = clock(graph, 0.001, 0.002, 0.003, 0.004)
        graph.connect(off, box.disable)
        graph.connect(unheard, box.reset)
        graph.connect(on, box.enable)
        graph.connect(heard, box.reset)
        return graph

    calls = [(event.slot, event.time) for event in judged(build) if isinstance(event, CallStarted)]
    assert calls == [("disable", 0.001), ("enable", 0.003), ("reset", 0.004)]


@pytest.mark.rule("F10", "G2")
def test_what_waits_for_the_slots_of_a_subgraph_that_is_disabled_is_dropped() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        pulse = graph.add(Pulse(), name="pulse")
        graph.add(script(values=(3,))) >> pulse  # three signals in one firing
        graph.connect(pulse.pulse, graph.add(Working(), name="box").disable)
        return graph

    trace = judged(build)
    assert len(of_kind(trace, CallStarted)) == 1
    assert [event.edge for event in trace if isinstance(event, TokenDropped)].count("pulse.pulse -> box.disable") == 2


@pytest.mark.rule("F10", "G2")
def test_a_subgraph_that_is_disabled_is_deaf_to_what_follows_from_that() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, box = graph.add(script(values=(1,)), name="source"), graph.add(Left(), name="box")
        graph.connect(source.out, box.say, active=True)
        graph.connect(box.deactivated, box.hush)
        graph.start.activates(source.activate)
        return graph

    trace = judged(build)
    assert [event.node for event in trace if isinstance(event, NodeEnabled)] == ["box/inner"]
    assert [event.slot for event in trace if isinstance(event, CallStarted)] == ["activate", "say", "disable"]


@pytest.mark.rule("A9", "G2")
def test_the_reset_of_a_subgraph_waits_for_nobody_and_reaches_each_behind_its_firing() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        box = graph.add(Working(), name="box")
        graph.connect(clock(graph, 0.015)[0], box.reset)
        return graph

    trace = judged(build)
    (call,) = of_kind(trace, CallStarted)
    assert call.time == 0.015
    quick = [round(e.time, 6) for e in trace if isinstance(e, FiringStarted) and e.node == "box/others"]
    slow = [(round(e.time, 6), e.outcome) for e in trace if isinstance(e, FiringEnded) and e.node == "box/slow"]
    assert quick == [0.0, 0.0, 0.0, 0.015, 0.015, 0.015]  # its generator begins anew at once
    assert slow[1] == (0.02, "done")  # the firing under way is finished, and what it gives leaves


@pytest.mark.rule("G2")
def test_activity_that_leaves_an_inner_subgraph_has_left_before_the_outer_one_is_looked_at() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        box, relay, heard = graph.add(Outer(), name="box"), graph.add(Relay(), name="relay"), graph.add(Counter())
        inner = graph["box/inner"]
        box.graph.connect(inner.ports.events["activated"], box.graph.add(Relay(), name="kept").activate, active=True)
        graph.connect(box.activated, heard.tell)
        graph.connect(box.deactivated, relay.deactivate)
        graph.start.activates(box.begin)
        return graph

    trace = judged(build)
    told = [event.event for event in trace if isinstance(event, EventTriggered) and event.event.startswith("box")]
    assert told == ["box/inner.activated", "box.activated"]
    changes = [(event.node, event.active) for event in trace if isinstance(event, ActivityChanged)]
    assert changes == [("box/inner/node", True), ("box/inner/node", False), ("box/kept", True)]


@pytest.mark.rule("A11", "F9", "G2")
def test_a_gate_by_a_subgraph_opens_before_the_events_of_those_inside_arrive() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        box, gated = graph.add(Outer(), name="box"), graph.add(Script(count=1), name="gated")
        graph.gate(gated, by=box)
        graph.connect(box.begun, gated.deactivate)
        graph.start.activates(box.begin)
        graph.connect(gated.out, graph.add(sink()).value)
        return graph

    trace = judged(build)
    did = [type(e).__name__ for e in trace if isinstance(e, FiringStarted | CallStarted) and e.node == "gated"]
    assert did[:2] == ["FiringStarted", "CallStarted"]


@pytest.mark.rule("A8", "F9", "F10")
def test_what_goes_back_to_a_sender_is_told_behind_all_that_disabling_frees() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, join = graph.add(Script(count=2), name="source"), graph.add(add(), name="join")
        graph.connect(source.out, join.a, active=True)  # lies there, for nothing comes to the other input
        graph.connect(graph.add(script(), name="other", enabled=False).out, join.b)
        graph.connect(source.activated, source.deactivate)
        graph.connect(clock(graph, 0.005)[0], join.disable)
        graph.start.activates(source.activate)
        return graph

    trace = judged(build)
    did = [
        type(e).__name__
        for e in trace
        if isinstance(e, FiringStarted | CallStarted) and e.node == "source" and e.time == 0.005
    ]
    assert did[:2] == ["FiringStarted", "CallStarted"]


@pytest.mark.rule("A9", "F4", "G2")
def test_what_the_end_of_a_node_brings_is_told_by_the_node_first_and_by_subgraphs_last() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, box, heard = graph.add(Script(count=0), name="source"), graph.add(Inner(), name="box"), Counter()
        graph.start.activates(source.activate)
        graph.connect(source.out, box.begin, active=True)
        graph.connect(box.activated, graph.add(heard, name="heard").tell)
        graph.connect(source.deactivated, heard.tell)
        return graph

    told = [event.event for event in judged(build) if isinstance(event, EventTriggered)]
    assert told[1:3] == ["source.deactivated", "box.activated"]


@pytest.mark.rule("A9", "F12")
def test_activity_that_the_end_of_a_firing_lets_in_is_told_at_once() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, slow = graph.add(Farewell(), name="source"), graph.add(Waiting(pause_s=0.01), name="slow")
        source >> slow  # END has to wait until the firing is over
        graph.connect(source.out, slow.enable, active=True)
        graph.connect(slow.activated, graph.add(Counter()).tell)
        graph.connect(clock(graph, 0.005)[0], source.activate)
        return graph

    trace = judged(build)
    told = next(number for number, event in enumerate(trace) if getattr(event, "event", "") == "slow.activated")
    begun = [number for number, event in enumerate(trace) if isinstance(event, FiringStarted) and event.node == "slow"]
    assert begun[0] < told < begun[1]
