"""Restarts, and what else happens to the node meanwhile: one setup at a time, each torn down (X1, F10, A9, X3)."""

from __future__ import annotations

import asyncio
from typing import Any, ClassVar

import pytest
import reactivex
from reactivex import operators as ops

import hfg
from hfg import END
from hfg.testing import recorder, replay
from hfg.testing.nodes import script
from tests.semantics.nodes import Ear, Keep, drive, numbers, run, value_of
from tests.support.kinds import Unsteady


class Device(hfg.Node):
    """Fails at its first value; opening takes a second; writes down its life and is never opened twice."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    story: list[Any] = []  # noqa: RUF012 - over setups
    opened = 0

    async def setup(self) -> None:
        await asyncio.sleep(1)
        Device.opened += 1
        assert Device.opened == 1
        self.story.append(("open", hfg.now()))

    def teardown(self) -> None:
        Device.opened -= 1
        self.story.append(("close", hfg.now()))

    def process(self, value: int) -> int:
        if value == 1:
            raise ValueError("one")
        return value


class Box(hfg.Subgraph):
    """A device that rests ten seconds before it is opened again, and a neighbour."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    call = hfg.slot(type=int)

    def build(self, graph: hfg.Graph) -> None:
        device = graph.add(Device(), on_error="restart", restart_backoff_s=10)
        graph.connect(self.value.inner, device.value)
        graph.connect(device.out, self.out.inner)
        graph.connect(self.call.inner, graph.add(Ear()).hear)


def life(*acts: tuple[float, str]) -> tuple[list[Any], list[Any], hfg.Statistics]:
    """Let the device fail at 1 s and do to its box what is said, at these moments; 2 is fed from the beginning."""
    Device.story.clear()
    Device.opened = 0

    async def main() -> tuple[list[Any], hfg.Statistics]:
        graph = hfg.Graph()
        box, sink = graph.add(Box()), graph.add(Keep())
        graph.connect(graph.input("in", int), box.value)
        graph.connect(box.out, sink.value)
        async with hfg.running(graph) as run:
            async with run.feed("in", end=False) as feed:
                await feed.send(1)
                for moment, slot in acts:
                    await asyncio.sleep(moment - hfg.now())
                    await run.trigger(box.call if slot == "call" else box.ports.slots[slot], 0)
                await asyncio.sleep(40 - hfg.now())
                await asyncio.wait([asyncio.ensure_future(feed.send(2))], timeout=1)
            report = run.statistics()
        return [*sink.values, *graph["box/ear"].heard], report

    values, report = drive(main)
    return list(Device.story), values, report


@pytest.mark.rule("X1", "F10")
def test_a_node_enabled_in_its_back_off_is_set_up_once_when_that_is_over() -> None:
    story, values, _ = life((3, "disable"), (4, "enable"), (5, "call"))
    assert story == [("open", 1), ("close", 1), ("open", 12), ("close", 40)]
    assert values == [2, 0]  # its neighbour did not wait for it


@pytest.mark.rule("X1", "F10")
def test_a_node_disabled_in_its_back_off_comes_back_when_it_is_enabled() -> None:
    story, values, _ = life((3, "disable"), (30, "enable"))
    assert story == [("open", 1), ("close", 1), ("open", 31), ("close", 40)]
    assert values == [2]


@pytest.mark.rule("X1", "F10", "X3")
def test_a_node_disabled_in_its_back_off_for_good_is_torn_down_once() -> None:
    story, values, report = life((3, "disable"))
    assert story == [("open", 1), ("close", 1)]
    assert values == []
    assert report.nodes["box/device"].restarts == 1


@pytest.mark.rule("X1", "F10")
def test_a_node_enabled_while_its_restart_sets_it_up_is_set_up_again_behind_that() -> None:
    story, values, _ = life((11.2, "disable"), (11.5, "enable"))
    assert story == [("open", 1), ("close", 1), ("open", 12), ("close", 12), ("open", 13), ("close", 40)]
    assert values == [2]


@pytest.mark.rule("X1", "A9")
def test_a_reset_in_the_back_off_changes_nothing() -> None:
    story, values, _ = life((3, "reset"))
    assert story == [("open", 1), ("close", 1), ("open", 12), ("close", 40)]
    assert values == [2]


@pytest.mark.rule("X1", "X3")
def test_a_run_that_ends_in_a_back_off_does_not_tear_down_again(fast: bool) -> None:
    Fails.story.clear()
    graph = hfg.Graph()
    graph.connect(graph.start, graph.add(Fails(), on_error="restart", restart_backoff_s=10).value)
    assert run(graph, fast, until_s=5).outcome == "until"
    assert Fails.story == ["open", "close"]


@pytest.mark.rule("X1")
def test_a_failure_beside_a_firing_waits_for_its_end_before_the_node_is_torn_down(fast: bool) -> None:
    class Tends(hfg.Node):
        story: list[Any] = []  # noqa: RUF012

        async def process(self, value: int) -> None:
            self.story.append("begin")
            self.start_soon(self._fail())
            await asyncio.sleep(1)
            self.story.append("end")

        async def _fail(self) -> None:
            await asyncio.sleep(0.5)
            raise ValueError("beside")

        def teardown(self) -> None:
            self.story.append("close")

    graph = hfg.Graph()
    node, source = graph.add(Tends(), on_error="restart"), graph.add(numbers(count=1))
    graph.connect(source.out, node.ports.inputs["value"])
    run(graph, fast)
    assert Tends.story == ["begin", "end", "close", "close"]


@pytest.mark.rule("F10")
def test_enabling_closes_what_the_setup_before_had_opened(fast: bool) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        node = graph.add(Fails())
        async with hfg.running(graph, fast=fast) as run:
            for port in (node.disable, node.enable):
                await run.trigger(port)
                await run.wait_quiet()

    Fails.story.clear()
    drive(main)
    assert Fails.story == ["open", "close"] * 2


class Fails(hfg.Node):
    """Opens, fails, closes."""

    value = hfg.Input(object)
    story: list[str] = []  # noqa: RUF012 - over setups

    def setup(self) -> None:
        self.story.append("open")

    def teardown(self) -> None:
        self.story.append("close")

    def process(self, value: object) -> None:
        raise ValueError("always")


class TellsItself(hfg.Node):
    """Triggers, out of a slot, over an operator that fails into another slot of its own."""

    back = hfg.Event(int)
    story: ClassVar[list[str]] = []

    def setup(self) -> None:
        self.story.append("up")

    def teardown(self) -> None:
        self.story.append("down")

    @hfg.slot
    def say(self, value: int) -> None:
        self.back.trigger(value)
        self.story.append(f"said {value}")

    @hfg.slot
    def hear(self, value: int) -> None:
        self.story.append(f"heard {value}")


@pytest.mark.rule("X1", "F9", "P9")
def test_a_call_that_makes_an_operator_fail_is_over_before_its_node_is_restarted(fast: bool) -> None:
    graph = hfg.Graph()
    TellsItself.story.clear()
    node, start = graph.add(TellsItself(), on_error="restart", restart_backoff_s=0.1), graph.add(Starter())
    graph.connect(graph.add(numbers(count=2), max_rate_hz=1).out, start.value)
    graph.connect(start.signal, node.say)
    graph.connect(node.back, node.hear, through=[ops.map(lambda token: value_of(token) / (value_of(token) - 1))])
    report = run(graph, fast)
    assert TellsItself.story == ["up", "said 1", "down", "up", "said 2", "down"]
    assert report.nodes["tells_itself"].restarts == 1


class Starter(hfg.Node):
    """Turns values into signals."""

    value = hfg.Input(int)
    signal = hfg.Event(int)

    def process(self, value: int) -> None:
        self.signal.trigger(value)


class Stumbles(hfg.Node):
    """Fails at every second value."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        if value % 2 == 0:
            raise ValueError(f"cannot do {value}")
        return value


class Pairs(hfg.Node):
    """Waits for a signal, as long as one may come."""

    value = hfg.Input(int)
    other = hfg.Input(int, optional=True)

    def process(self, value: int, other: int | None) -> None:
        pass


@pytest.mark.rule("X1", "P9")
def test_events_that_have_completed_do_not_begin_afresh_with_a_restart() -> None:
    """The node waits for a signal that only the completion gives out; being restarted later it has ended no less."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, node, both = graph.add(numbers(count=4)), graph.add(Stumbles(), on_error="restart"), graph.add(Pairs())
        graph.connect(source.out, node.value)
        graph.connect(node.out, both.value)
        graph.connect(node.ports.events["out.sent"], both.other, through=[ops.concat(reactivex.of(9))])
        return graph

    seen = recorder()
    report = run(build(), trace=seen)
    (label,) = [edge for edge in seen.edges() if edge.startswith("stumbles.out.sent")]
    assert seen.values(label) == [1, 9, END]
    assert (report.nodes["stumbles"].restarts, report.edges[label].dropped) == (2, 1)
    replay(build, seen)


@pytest.mark.rule("X1", "F14")
@pytest.mark.parametrize("limit", [1, 5])
def test_failures_amid_a_restart_belong_to_it(limit: int) -> None:
    """Three firings fail at once: one restart, after the first of its pauses."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        node = graph.add(Unsteady(), concurrency=3, on_error="restart", restart_limit=limit, restart_backoff_s=0.5)
        graph.connect(graph.add(script(values=(1, 1, 1))).out, node.value)
        return graph

    seen = recorder()
    report = run(build(), trace=seen)
    assert (report.nodes["unsteady"].restarts, len(report.errors)) == (1, 3)
    assert report.duration_s == pytest.approx(0.503)
    replay(build, seen)
