"""Nodes are disabled, enabled and reset (rules F10, A9)."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

import pytest

import hfg
from hfg.testing import recorder, replay
from hfg.testing.nodes import Pulse, Script
from hfg.trace import NodeEnabled, TokenDropped, TraceEvent
from tests.semantics.nodes import (
    Both,
    Countdown,
    Ear,
    Hooks,
    Keep,
    Send,
    add,
    drive,
    forward_later,
    numbers,
    of_kind,
    run,
    slow_numbers,
)

# --- F10 ---


@pytest.mark.rule("F10")
def test_producers_neither_send_to_a_disabled_node_nor_wait_for_it(fast: bool) -> None:
    graph = hfg.Graph()
    source, off, on = graph.add(numbers(count=3)), graph.add(Keep(), enabled=False), graph.add(Keep())
    graph.connect(source.out, off.value)
    graph.connect(source.out, on.value)
    report = run(graph, fast)
    assert (off.values, on.values) == ([], [1, 2, 3])
    assert report.edges["numbers.out -> keep.value"].sent == 0


@pytest.mark.rule("F10")
def test_disabling_discards_and_counts_what_lies_on_inputs_and_in_slot_queues(fast: bool) -> None:
    async def main() -> tuple[hfg.Statistics, list[object]]:
        graph = hfg.Graph()
        node, values, calls = graph.add(SlowBoth()), graph.add(Ear(), name="values"), graph.add(Ear(), name="calls")
        graph.connect(values.passed, node.value)
        graph.connect(calls.passed, node.call)
        async with hfg.running(graph, fast=fast) as run:
            await run.trigger(node.call, 0)
            await asyncio.sleep(0.1)
            await run.trigger(node.disable)  # its place is behind the call under way
            for number in (1, 2, 3):
                await run.trigger(calls.passed, number)
                await run.trigger(values.passed, number)
            await asyncio.sleep(10)
            report = run.statistics()
        return report, node.story

    report, story = drive(main)
    assert story == [("call", 0)]
    for label in ("values.passed -> slow_both.value", "calls.passed -> slow_both.call"):
        assert (report.edges[label].dropped, report.edges[label].untaken) == (3, 0)


class SlowBoth(hfg.Node):
    """A second for each firing and call."""

    value = hfg.Input(int)
    story = hfg.State(factory=list)

    async def process(self, value: int) -> None:
        await asyncio.sleep(1)
        self.story.append(("fire", value))

    @hfg.slot
    async def call(self, value: int) -> None:
        await asyncio.sleep(1)
        self.story.append(("call", value))


@pytest.mark.rule("F10")
def test_a_producer_that_waits_for_a_node_goes_on_when_it_is_disabled(fast: bool) -> None:
    async def main() -> list[object]:
        graph = hfg.Graph()
        joined, free = graph.add(add()), graph.add(Keep())
        graph.connect(graph.input("in", int), joined.a)
        never = graph.add(Ear())
        graph.connect(never.passed, joined.b)
        graph.connect(graph.inputs["in"], free.value)
        async with hfg.running(graph, fast=fast) as run, run.feed("in") as feed:
            sending = asyncio.create_task(feed.send(1))
            await run.wait_quiet()
            assert not sending.done()
            await run.trigger(joined.disable)
            await sending
            await feed.send(2)
        return free.values

    assert drive(main) == [1, 2]


@pytest.mark.rule("F10", "R7")
def test_untaken_tokens_on_the_outputs_of_a_disabled_node_are_discarded_its_signals_are_delivered() -> None:
    trace: list[TraceEvent] = []

    async def main() -> list[object]:
        graph = hfg.Graph()
        send, busy = graph.add(Send()), graph.add(add())
        never = graph.add(Ear())
        graph.connect(graph.input("in", int), send.value)
        graph.connect(send.out, busy.a)
        graph.connect(never.passed, busy.b)
        lazy = graph.add(Lazy())
        graph.connect(send.rang, lazy.value)
        async with hfg.running(graph, trace=trace.append) as run, run.feed("in", end=False) as feed:
            sending = asyncio.create_task(feed.send(1))
            await asyncio.sleep(0.1)
            await run.trigger(send.disable)
            await sending
            await asyncio.sleep(5)
            return lazy.values

    assert drive(main) == [1]
    dropped = [(event.edge, event.reason) for event in of_kind(trace, TokenDropped)]
    assert dropped == [("send.out -> add.a", "disabled")]
    assert [(event.node, event.enabled) for event in of_kind(trace, NodeEnabled)] == [("send", False)]


class Lazy(hfg.Node):
    """Waits before it is ready."""

    value = hfg.Input(int)
    values = hfg.State(factory=list)

    async def ready(self) -> bool:
        await asyncio.sleep(1)
        return True

    def process(self, value: int) -> None:
        self.values.append(value)


class Box(hfg.Subgraph):
    """A slow node in a box."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        slow = graph.add(forward_later(), name="slow")
        graph.connect(self.value.inner, slow.value)
        graph.connect(slow.out, self.out.inner)


@pytest.mark.rule("F10", "G2")
def test_a_firing_under_way_is_finished_and_its_outputs_go_nowhere(fast: bool) -> None:
    async def main() -> tuple[list[object], hfg.Statistics]:
        graph = hfg.Graph()
        box, sink = graph.add(Box()), graph.add(Keep())
        graph.connect(graph.input("in", int), box.value)
        graph.connect(box.out, sink.value)
        async with hfg.running(graph, fast=fast) as run, run.feed("in", end=False) as feed:
            sending = asyncio.create_task(feed.send(1))
            await asyncio.sleep(0.5)
            await run.trigger(box.disable)
            await sending
            assert run.now() == 0.5
            await asyncio.sleep(2)
            report = run.statistics()
            await run.trigger(box.enable)
            await run.wait_quiet()
            await feed.send(2)
        return sink.values, report

    values, report = drive(main)
    assert values == [2]
    assert report.edges["box/slow.out -> keep.value"].sent == 0
    assert report.nodes["box/slow"].firings == 1


@pytest.mark.rule("F10", "A9")
def test_enabling_starts_afresh_with_setup_and_a_generator_from_its_beginning(fast: bool) -> None:
    async def main() -> tuple[list[object], list[object], list[object]]:
        graph = hfg.Graph()
        source, sink = graph.add(slow_numbers(count=100, pause_s=1)), graph.add(Keep())
        hooks = graph.add(Hooks())
        graph.connect(source.out, sink.value)
        graph.connect(graph.input("in", int), hooks.value)
        async with hfg.running(graph, fast=fast) as run, run.feed("in", end=False) as feed:
            await feed.send(7)
            await asyncio.sleep(1.5)
            await run.trigger(source.disable)  # a call: it waits for the firing under way
            await run.trigger(hooks.disable)
            await asyncio.sleep(10)
            await feed.send(8)
            first = list(sink.values)
            await run.trigger(source.enable)
            await run.trigger(hooks.enable)
            await asyncio.sleep(2.5)
            await feed.send(9)
            story = list(hooks.story)
        return first, sink.values, story

    first, values, story = drive(main)
    assert first == [1, 2]
    assert values[2:] == [1, 2]
    assert story == ["setup", 9]  # State is set afresh too


@pytest.mark.rule("F10", "F12")
def test_a_node_that_has_ended_is_not_ended_any_more_when_enabled(fast: bool) -> None:
    async def main() -> list[object]:
        graph = hfg.Graph()
        source, sink = graph.add(numbers(count=2)), graph.add(Keep())
        graph.connect(source.out, sink.value)
        async with hfg.running(graph, fast=fast) as run:
            await run.wait_quiet()
            for port in (sink.disable, source.disable, sink.enable, source.enable):
                await run.trigger(port)
                await run.wait_quiet()
            return sink.values

    assert drive(main) == [1, 2]


@pytest.mark.rule("F10", "A8")
def test_enabling_keeps_activity(fast: bool) -> None:
    async def main() -> list[list[str]]:
        graph = hfg.Graph()
        node = graph.add(Both())
        graph.start.activates(node.begin)
        story = []
        async with hfg.running(graph, fast=fast) as run:
            for port in (node.disable, node.enable):
                await run.wait_quiet()
                await run.trigger(port)
                await run.wait_quiet()
                story.append(run.active())
        return story

    assert drive(main) == [["both"], ["both"]]


@pytest.mark.rule("F10")
def test_enable_works_by_an_edge_while_the_node_is_disabled(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(slow_numbers(count=3, pause_s=1)), graph.add(Keep(), enabled=False)
    late = graph.add(Countdown(count=1))
    graph.connect(source.out, node.value)
    graph.connect(late.out, node.enable)
    run(graph, fast)
    assert node.values == [1, 2, 3]


@pytest.mark.rule("F10", "A9")
def test_reset_tears_down_and_sets_up_but_keeps_tokens_and_activity(fast: bool) -> None:
    async def main() -> tuple[list[Any], list[str], list[str]]:
        graph = hfg.Graph()
        node, source = graph.add(Resettable()), graph.add(Ear())
        graph.connect(source.passed, node.value)
        graph.start.activates(node.begin)
        async with hfg.running(graph, fast=fast) as run:
            await run.wait_quiet()
            await run.trigger(source.passed, 1)
            await run.trigger(node.reset)
            await run.trigger(source.passed, 2)
            await run.wait_quiet()
            return node.values, Resettable.story, run.active()

    Resettable.story.clear()
    values, story, active = drive(main)
    assert story[:3] == ["setup", "teardown", "setup"]
    assert values in ([2], [1, 2])
    assert active == ["resettable"]


class Resettable(hfg.Node):
    value = hfg.Input(int)
    values = hfg.State(factory=list)
    story: list[str] = []  # noqa: RUF012 - over setups

    def setup(self) -> None:
        self.story.append("setup")

    def teardown(self) -> None:
        self.story.append("teardown")

    def process(self, value: int) -> None:
        self.values.append(value)

    @hfg.slot
    def begin(self) -> None:
        pass


@pytest.mark.rule("F8", "F10", "P7")
@pytest.mark.parametrize("seed", range(12))
def test_a_queue_that_is_full_when_its_consumer_is_enabled_holds_its_source(seed: int) -> None:
    graph = hfg.Graph()
    script, pulse, node = graph.add(Script(count=3)), graph.add(Pulse()), graph.add(add(), enabled=False)
    graph.connect(script.ports.events["seen"], pulse.value)
    graph.connect(pulse.pulse, node.b, capacity=1, initial=[0])
    graph.connect(graph.start, node.enable)
    trace = recorder()
    with contextlib.suppress(hfg.errors.RunError):  # it stalls, for nothing feeds the other input
        hfg.run(graph, clock="virtual", policy="random", seed=seed, trace=trace)
    replay(graph, trace)
