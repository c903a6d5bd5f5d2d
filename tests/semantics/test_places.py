"""Calls and firings of a node form one order, by places that each of them takes (rule F9); engine and oracle alike."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest
import reactivex.operators as ops

import hfg
from hfg.testing.nodes import (
    Greeter,
    Latch,
    Script,
    Tally,
    Waiting,
    add,
    script,
)
from hfg.trace import CallStarted, FiringStarted, TokenSent
from tests.semantics.calls import note_calls


def order_of(path: str) -> Callable[[Any], list[str]]:
    """What a node does in which order: its firings by kind, its calls by slot."""

    def read(seen: Any) -> list[str]:
        return [
            event.kind if isinstance(event, FiringStarted) else event.slot
            for event in seen
            if isinstance(event, FiringStarted | CallStarted) and event.node == path
        ]

    return read


@pytest.mark.rule("F9", "A10", "P7")
def test_what_initial_tokens_enable_has_its_place_before_what_start_sets_off(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        latch = graph.add(Latch(), name="latch", max_rate_hz=1.0)
        graph.connect(latch.out, latch.second, initial=[2])
        graph.connect(graph.start, latch.ports.slots["activate"], active=True)
        graph.connect(latch.ports.events["activated"], graph.stop)
        return graph

    assert perform(build, order_of("latch")) == ["process", "activate"]


@pytest.mark.rule("F9", "A9", "F4")
def test_an_end_that_came_first_is_taken_before_a_call_that_what_it_cost_sets_off(perform: Any) -> None:
    """The END carries the activity away, so `deactivated` follows it as a sending of its own."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, sink = graph.add(Script(count=0), name="source"), graph.add(Greeter(), name="sink")
        graph.connect(source.out, sink.value, active=True)
        graph.connect(source.ports.events["deactivated"], sink.ports.slots["reset"])
        graph.connect(graph.start, source.ports.slots["activate"], active=True)
        return graph

    assert perform(build, order_of("sink"))[:2] == ["end", "reset"]


@pytest.mark.rule("F9", "P9")
def test_what_the_first_operator_gives_at_the_end_is_taken_before_what_the_next_one_gives(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, sink = graph.add(Script(count=0), name="source"), graph.add(Greeter(), name="sink")
        at_last: list[Any] = [ops.ignore_elements(), ops.default_if_empty(8)]
        graph.connect(source.ports.events["out.sent"], sink.value, through=at_last)
        graph.connect(source.ports.events["processed"], sink.ports.slots["reset"], through=at_last)
        return graph

    assert perform(build, order_of("sink"))[:2] == ["process", "reset"]


class Slow(hfg.Node):
    """An async source without outputs, so that nothing but its firing keeps it from the next."""

    count = hfg.Parameter(0)
    done = hfg.State(0)

    async def process(self) -> None:
        await asyncio.sleep(1.0)
        self.done += 1
        if self.done == 3:
            raise hfg.EndOfStream


@pytest.mark.rule("F9", "P8")
def test_a_source_is_enabled_again_as_it_fires_also_where_signals_set_its_parameters(perform: Any) -> None:
    """The signal comes amid the first firing, so the second has its place already."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        slow, counter = graph.add(Slow(), name="slow"), graph.add(Tally(), name="tally")
        other = graph.add(script(values=(1, 2, 3, 4)), name="other")
        graph.connect(other.out, counter.value)
        graph.connect(counter.full, slow.ports.parameters["count"])
        return graph

    assert perform(build, order_of("slow"))[:3] == ["process", "process", "count"]


@pytest.mark.rule("P9", "F10")
def test_operators_behind_a_node_that_begins_afresh_begin_afresh_too(perform: Any) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, waiting = graph.add(script(values=()), name="source"), graph.add(Waiting(), name="waiting")
        graph.connect(source.out, waiting.value)
        graph.connect(waiting.before, graph.add(Tally(), name="tally").value, through=[ops.start_with(5)])
        graph.connect(graph.start, waiting.ports.slots["reset"], through=[ops.delay(2.0)])
        return graph

    def read(seen: Any) -> list[tuple[float, Any, float]]:
        return [
            (event.time, event.token.value, event.token.stamp)
            for event in seen
            if isinstance(event, TokenSent) and event.edge == "waiting.before -> tally.value" and event.token.value == 5
        ]

    assert perform(build, read) == [(0.0, 5, 0.0), (2.0, 5, 2.0)]


@pytest.mark.rule("F5", "R2", "P7")
def test_who_is_freed_first_by_a_taken_wave_goes_first_fused_or_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """One input is freed as it is taken, the other is a queue: they are freed in the order of the inputs."""
    graph = hfg.Graph()
    first, second = (
        graph.add(script(values=(1, 2, 3)), name="first"),
        graph.add(script(values=(1, 2, 3)), name="second"),
    )
    both = graph.add(add(), name="both", release="pipelined")
    graph.connect(first.out, both.a)
    graph.connect(second.out, both.b, initial=[2])
    calls = note_calls(monkeypatch)
    orders = []
    for fast in (True, False):
        hfg.run(graph, clock="virtual", fast=fast)
        orders.append([note[0] for note in calls.take()[0]])
    assert orders[0] == orders[1]
    assert orders[0][-6:] == ["both", "first", "second", "both", "first", "second"]


class SlowSink(hfg.Node):
    """Takes a second for each value."""

    value = hfg.Input(int)

    async def process(self, value: int) -> None:
        await asyncio.sleep(1.0)


class Around(hfg.Subgraph):
    """Its `activated` comes back to the node inside."""

    value = hfg.Input(int)
    again = hfg.slot(type=Any)

    def build(self, graph: hfg.Graph) -> None:
        sink = graph.add(SlowSink(), name="sink")
        graph.connect(self.value.inner, sink.value, active=True)
        graph.connect(self.again.inner, sink.ports.slots["activate"])


@pytest.mark.rule("F9", "A6", "G2", "P4")
def test_a_value_that_waits_behind_one_that_brings_activity_has_its_place_before_what_that_sets_off(
    perform: Any,
) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, box = graph.add(Script(count=2), name="source"), graph.add(Around(), name="box")
        graph.connect(source.out, box.value, active=True, buffer=2, initial=[0])
        graph.connect(graph.start, source.ports.slots["activate"])
        graph.connect(box.ports.events["activated"], box.again)
        return graph

    assert perform(build, order_of("box/sink"))[:4] == ["process", "process", "process", "activate"]
