"""Parameters are set between firings and never without effect (rule P8)."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from typing import Any

import pytest

import hfg
from hfg import commands as c
from hfg.errors import ConnectionError as EdgeRefused
from hfg.errors import UsageError
from hfg.trace import ParameterSet
from tests.semantics.nodes import Keep, drive, named, numbers, of_kind, scale


@hfg.node
def level(*, v: float = 1.0) -> Iterator[float]:
    while True:
        yield v


@hfg.node
async def slow_level(*, v: float = 1.0) -> AsyncIterator[float]:
    while True:
        await asyncio.sleep(0.1)
        yield v


class Level(hfg.Node):
    """The same as a class: what it yields next is what is set now."""

    out = hfg.Output(float)
    v = hfg.Parameter(1.0)

    def process(self) -> Iterator[float]:
        while True:
            yield self.v


class Looks(hfg.Node):
    """Looks at its parameter before and behind a pause."""

    x = hfg.Input(int)
    gain = hfg.Parameter(1)
    seen: Any = hfg.State(factory=list)

    async def process(self, x: int) -> None:
        before = self.gain
        await asyncio.sleep(1)
        self.seen.append((before, self.gain))

    @hfg.slot
    async def look(self) -> None:
        await self.process(0)


class Around(hfg.Subgraph):
    """Its parameter stands for one inside."""

    x = hfg.Input(int)
    gain = hfg.Parameter(1)

    def build(self, graph: hfg.Graph) -> None:
        looks = graph.add(Looks())
        graph.connect(self.x.inner, looks.x)
        graph.promote(self.gain, looks.ports.parameters["gain"])


@pytest.mark.rule("P8")
@pytest.mark.parametrize("node", [Looks, Around])
def test_a_parameter_set_from_outside_waits_for_the_firing_under_way(node: Any, fast: bool) -> None:
    graph = hfg.Graph()
    looks = graph.add(node(), name="node")
    x = graph.input("x", int)
    graph.connect(x, looks.ports.inputs["x"])
    inside = graph["node"] if node is Looks else graph["node/looks"]

    async def main() -> list[tuple[int, int]]:
        async with hfg.running(graph, fast=fast) as run, run.feed(x) as feed:
            sending = asyncio.create_task(feed.send(1))
            await asyncio.sleep(0.5)
            run.set(looks.ports.parameters["gain"], 2)
            run.set(looks.ports.parameters["gain"], 3)
            assert inside.gain == 1
            await sending
            await feed.send(2)
            return list(inside.seen)

    assert drive(main) == [(1, 1), (3, 3)]


@pytest.mark.rule("P8")
def test_a_parameter_set_from_outside_waits_for_the_call_under_way(fast: bool) -> None:
    graph = hfg.Graph()
    looks = graph.add(Looks())

    async def main() -> list[tuple[int, int]]:
        async with hfg.running(graph, fast=fast) as run:
            await run.trigger(looks.look)
            await asyncio.sleep(0.5)
            run.set(looks.ports.parameters["gain"], 2)
            await run.wait_quiet()
            await run.trigger(looks.look)
            await run.wait_quiet()
            return list(looks.seen)

    assert drive(main) == [(1, 1), (2, 2)]


class Turns(hfg.Node):
    """Turns its own knob, by a subscriber, amid a call."""

    turned = hfg.Event()
    gain = hfg.Parameter(1)
    seen: Any = hfg.State(factory=list)

    @hfg.slot
    def turn(self) -> None:
        self.turned.trigger()
        self.seen.append(self.gain)


@pytest.mark.rule("P8")
def test_a_call_that_leads_to_a_new_value_goes_on_with_the_old_one(fast: bool) -> None:
    graph = hfg.Graph()
    turns = graph.add(Turns())

    async def main() -> list[int]:
        async with hfg.running(graph, fast=fast) as run:
            turns.turned.subscribe(lambda _: run.set(turns.ports.parameters["gain"], turns.gain + 1))
            await run.trigger(turns.turn)
            await run.trigger(turns.turn)
            await run.wait_quiet()
            return list(turns.seen)

    assert drive(main) == [1, 2]


class Floods(hfg.Node):
    """Waits until what it triggers has room."""

    x = hfg.Input(int)
    rang = hfg.Event(int)
    gain = hfg.Parameter(1)

    async def process(self, x: int) -> None:
        for _ in range(3):
            await self.rang.trigger_wait(self.gain)


class Holds(hfg.Node):
    """Takes signals one by one, when its other input says so."""

    go = hfg.Input(int)
    value = hfg.Input(int)
    gain = hfg.Parameter(1)
    seen: Any = hfg.State(factory=list)

    def process(self, go: int, value: int) -> None:
        self.seen.append(value)


@pytest.mark.rule("P8", "F8")
@pytest.mark.parametrize("by_command", [False, True])
def test_nobody_stands_still_because_a_node_that_waits_for_room_gets_a_parameter(by_command: bool) -> None:
    """The node of the full queue gets one, too: held for an edit, it could not make room."""
    graph = hfg.Graph()
    floods, holds = graph.add(Floods()), graph.add(Holds())
    graph.connect(graph.add(numbers(count=1)).out, floods.x)
    graph.connect(graph.add(numbers(count=3), name="goes", max_rate_hz=1).out, holds.go)
    graph.connect(floods.rang, holds.value, capacity=1)
    graph.add(level(), name="clock", max_rate_hz=100) >> graph.add(Keep(), name="ticks")  # so that it is never quiet

    async def main() -> tuple[list[int], int]:
        async with hfg.running(graph) as run:
            await asyncio.sleep(0.5)
            assert floods.gain == 1
            if by_command:
                await asyncio.wait_for(run.edit(c.SetParameter("floods.gain", 2), c.SetParameter("holds.gain", 2)), 10)
            else:
                run.set(floods.ports.parameters["gain"], 2)
                run.set(holds.ports.parameters["gain"], 2)
            await asyncio.sleep(5)
            return list(holds.seen), floods.gain

    assert drive(main) == ([1, 1, 1], 2)


@pytest.mark.rule("P8", "R3", "F10")
def test_a_parameter_of_a_node_that_rests_disabled_or_paused_is_set_at_once() -> None:
    graph = hfg.Graph()
    node = graph.add(Looks(), enabled=False)
    other = graph.add(Looks(), name="other")

    async def main() -> None:
        async with hfg.running(graph) as run:
            run.pause()
            run.set(node.ports.parameters["gain"], 2)
            run.set(other.ports.parameters["gain"], 2)
            assert (node.gain, other.gain) == (2, 2)
            run.resume()

    drive(main)


@pytest.mark.rule("P8")
def test_a_parameter_may_be_set_before_anything_has_begun() -> None:
    graph = hfg.Graph()
    source, keep = graph.add(level(), max_rate_hz=10), graph.add(Keep())
    source >> keep

    def begin(run: hfg.Run) -> None:
        run.set(source.ports.parameters["v"], 5.0)

    hfg.run(graph, clock="virtual", begin=begin, until_s=0.15)
    assert keep.values == [5.0, 5.0]


@pytest.mark.rule("P8", "R7")
def test_a_parameter_set_from_outside_is_traced_when_it_takes_effect() -> None:
    graph = hfg.Graph()
    looks = graph.add(Looks())
    x = graph.input("x", int)
    graph.connect(x, looks.x)
    trace: list[Any] = []

    async def main() -> None:
        async with hfg.running(graph, trace=trace.append) as run, run.feed(x) as feed:
            began = run.now()
            sending = asyncio.create_task(feed.send(1))
            await asyncio.sleep(0.5)
            run.set(looks.ports.parameters["gain"], 2)
            await sending
            (event,) = of_kind(trace, ParameterSet)
            assert (event.node, event.parameter, event.value) == ("looks", "gain", 2)
            assert event.time - began == pytest.approx(1.0)

    drive(main)


# --- never without effect ---


async def put(run: hfg.Run, path: str, value: Any, by_command: bool) -> None:
    """Set a parameter on one of the two ways."""
    if by_command:
        await run.edit(c.SetParameter(path, value))
    else:
        run.set(run.graph[path], value)


@pytest.mark.rule("P8")
@pytest.mark.parametrize("source", [level, slow_level])
@pytest.mark.parametrize("by_command", [False, True])
def test_what_a_running_generator_function_cannot_see_is_refused(source: Any, by_command: bool) -> None:
    graph = hfg.Graph()
    graph.add(source(), name="source", max_rate_hz=10) >> graph.add(Keep())

    async def main() -> None:
        async with hfg.running(graph) as run:
            await asyncio.sleep(0.25)
            with pytest.raises(UsageError, match=r'"source\.v" belongs to a generator function .*commands\.Replace\('):
                await put(run, "source.v", 9.0, by_command)
            assert graph["source"].v == 1.0

    drive(main)


@pytest.mark.rule("P8")
def test_the_remedies_of_the_refusal_work(fast: bool) -> None:
    graph = hfg.Graph()
    graph.add(level(), name="function", max_rate_hz=10) >> graph.add(Keep(), name="from_function")
    graph.add(Level(), name="class", max_rate_hz=10) >> graph.add(Keep(), name="from_class")

    async def main() -> None:
        async with hfg.running(graph, fast=fast) as run:
            await asyncio.sleep(0.15)
            await run.edit(c.Replace("function", named(level), parameters={"v": 9.0}))
            run.set(graph["class.v"], 9.0)
            await asyncio.sleep(0.1)
            assert graph["from_function"].values == graph["from_class"].values == [1.0, 1.0, 9.0]

    drive(main)


@pytest.mark.rule("P8", "F10")
def test_a_generator_function_that_is_enabled_by_the_same_edit_begins_with_the_new_value() -> None:
    graph = hfg.Graph()
    graph.add(level(), name="source", max_rate_hz=10) >> graph.add(Keep())

    async def main() -> None:
        async with hfg.running(graph) as run:
            await asyncio.sleep(0.15)
            await run.edit(c.Disable("source"))
            await run.edit(c.SetParameter("source.v", 9.0), c.Enable("source"))
            await asyncio.sleep(0.15)
            assert graph["keep"].values[-1] == 9.0

    drive(main)


class Boxed(hfg.Subgraph):
    """Its parameter stands for that of a generator function; another for none."""

    v = hfg.Parameter(1.0)
    idle = hfg.Parameter(1)
    out = hfg.Output(float)

    def build(self, graph: hfg.Graph) -> None:
        source = graph.add(level(), max_rate_hz=10)
        graph.promote(self.v, source.ports.parameters["v"])
        graph.connect(source.out, self.out.inner)


@pytest.mark.rule("P8", "G3")
@pytest.mark.parametrize("by_command", [False, True])
@pytest.mark.parametrize(("name", "value", "why"), [("v", 9.0, "generator function"), ("idle", 2, "none inside")])
def test_a_subgraph_hides_no_change_without_effect(by_command: bool, name: str, value: Any, why: str) -> None:
    graph = hfg.Graph()
    box = graph.add(Boxed())
    graph.connect(box.out, graph.add(Keep()).value)

    async def main() -> None:
        async with hfg.running(graph) as run:
            await asyncio.sleep(0.15)
            with pytest.raises(UsageError, match=why):
                await put(run, f"boxed.{name}", value, by_command)
            assert (graph["boxed"].v.value, graph["boxed"].idle.value, graph["boxed/level"].v) == (1.0, 1, 1.0)

    drive(main)


@pytest.mark.rule("P8")
def test_an_edge_into_a_parameter_that_nobody_would_see_is_refused() -> None:
    graph = hfg.Graph()
    values, source = graph.add(level(), name="values"), graph.add(level(), name="source")
    with pytest.raises(
        EdgeRefused, match=r'"source\.v" belongs to a generator function, .* hfg\.State, and reads self\.v'
    ):
        graph.connect(values.out, source.ports.parameters["v"])


@pytest.mark.rule("P8", "G1")
def test_the_check_sees_such_an_edge_through_a_subgraph() -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(level()).out, graph.add(Boxed()).v)
    assert [one.severity for one in graph.check() if one.check == "parameter-without-effect"] == ["error"]


@pytest.mark.rule("P8")
def test_a_parameter_is_of_this_run_and_of_one_that_goes_on() -> None:
    graph, other = hfg.Graph(), hfg.Graph()
    node, stranger = graph.add(scale()), other.add(scale())

    async def main() -> None:
        async with hfg.running(graph) as run:
            with pytest.raises(UsageError, match="is no parameter of this run"):
                run.set(stranger.ports.parameters["factor"], 3)
        with pytest.raises(hfg.errors.NotRunning, match="the run is over"):
            run.set(node.ports.parameters["factor"], 3)

    drive(main)


# --- set by tokens ---


@pytest.mark.rule("P8")
def test_signals_into_a_parameter_wait_for_the_firing_under_way(fast: bool) -> None:
    graph = hfg.Graph()
    looks, says = graph.add(Looks()), graph.add(Says())
    x = graph.input("x", int)
    graph.connect(x, looks.x)
    graph.connect(says.said, looks.ports.parameters["gain"])

    async def main() -> list[tuple[int, int]]:
        async with hfg.running(graph, fast=fast) as run, run.feed(x) as feed:
            sending = asyncio.create_task(feed.send(1))
            await asyncio.sleep(0.5)
            await run.trigger(says.say, 2)
            await sending
            await feed.send(2)
            return list(looks.seen)

    assert drive(main) == [(1, 1), (2, 2)]


class Says(hfg.Node):
    """Passes a signal on."""

    said = hfg.Event(int)

    @hfg.slot
    def say(self, value: int) -> None:
        self.said.trigger(value)


@pytest.mark.rule("P8", "F1")
def test_a_signal_into_a_parameter_lets_nothing_fire(fast: bool) -> None:
    graph = hfg.Graph()
    says, node = graph.add(Says()), graph.add(scale(), name="alone")
    graph.connect(says.said, node.ports.parameters["factor"])

    async def main() -> tuple[int, int]:
        async with hfg.running(graph, fast=fast) as run:
            await run.trigger(says.say, 7)
            await run.wait_quiet()
            return node.factor, run.statistics().nodes["alone"].firings

    assert drive(main) == (7, 0)


class Follows(hfg.Node):
    """Its knob is turned, by a subscriber, amid its firing."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    begun = hfg.Event()
    gain = hfg.Parameter(1)

    def process(self, value: int) -> int:
        self.begun.trigger()
        return self.gain


@pytest.mark.rule("P8", "R2")
def test_a_firing_that_leads_to_a_new_value_goes_on_with_the_old_one(fast: bool) -> None:
    graph = hfg.Graph()
    node, keep = graph.add(Follows()), graph.add(Keep())
    graph.add(numbers(count=4)) >> node
    graph.connect(node.out, keep.value)

    def begin(run: hfg.Run) -> None:
        node.begun.subscribe(lambda _: run.set(node.ports.parameters["gain"], node.gain + 1))

    hfg.run(graph, clock="virtual", fast=fast, begin=begin)
    assert keep.values == [1, 2, 3, 4]


class Gets(hfg.Node):
    """Reads its parameter before and behind a pause, amid a chain."""

    value = hfg.Input(int)
    out = hfg.Output(bool)
    gain = hfg.Parameter(0)

    async def process(self, value: int) -> bool:
        before = self.gain
        await asyncio.sleep(0.01)
        return before == self.gain


@pytest.mark.rule("P8", "R2")
def test_a_chain_that_runs_as_one_sees_new_values_between_firings_too(fast: bool) -> None:
    graph = hfg.Graph()
    node, keep = graph.add(Gets()), graph.add(Keep())
    graph.add(numbers(count=8)) >> node
    graph.connect(node.out, keep.value)

    async def main() -> list[bool]:
        async with hfg.running(graph, fast=fast) as run:
            for number in range(1, 9):
                await asyncio.sleep(0.01)
                run.set(node.ports.parameters["gain"], number)
                await asyncio.sleep(0.003)
                run.set(node.ports.parameters["gain"], -number)
            await run.wait_finished()
        return list(keep.values)

    assert drive(main) == [True] * 8
