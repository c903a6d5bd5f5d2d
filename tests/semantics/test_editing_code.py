"""Edits and the code of nodes: setup and teardown, their failures, cancelled edits, nodes that edit (rule R4)."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from typing import Any

import pytest

import hfg
from hfg import commands as c
from hfg.errors import NodeError, UsageError
from hfg.testing import Recorder, recorder
from hfg.testing.nodes import Waiting, script, sink
from hfg.trace import NodeEnabled, ParameterSet
from tests.semantics.nodes import named
from tests.support.edits import drawn

LOG: list[str] = []
REFUSES: set[str] = set()
RUNS: list[hfg.Run] = []


@pytest.fixture(autouse=True)
def _clean() -> Iterator[None]:
    yield
    for kept in (LOG, REFUSES, RUNS):
        kept.clear()


class Device(hfg.Node):
    """Takes its time to open and to close, and may fail at both."""

    gain = hfg.Parameter(1)

    async def setup(self) -> None:
        LOG.append(f"open {self.gain}")
        if "open" in REFUSES:
            raise RuntimeError("no such device")

    async def teardown(self) -> None:
        try:
            await asyncio.sleep(0.01)
        except asyncio.CancelledError:
            LOG.append("close cut off")
            raise
        LOG.append("close")
        if "close" in REFUSES:
            raise RuntimeError("it hangs")

    def process(self, value: int) -> int:
        return value * self.gain


class Other(Device):
    """Another one."""

    async def setup(self) -> None:
        LOG.append(f"open other {self.gain}")
        if "other" in REFUSES:
            raise RuntimeError("no such device")


class Restless(hfg.Node):
    """Edits the graph while it is set up."""

    async def setup(self) -> None:
        await RUNS[0].edit(c.Rename("script", "other"))

    def process(self, value: int) -> None: ...


class Leaver(hfg.Node):
    """Edits the graph when it has been removed."""

    async def teardown(self) -> None:
        await RUNS[0].edit(c.Rename("script", "other"))
        LOG.append("edited")

    def process(self, value: int) -> None: ...


class Editor(hfg.Node):
    """Sets a parameter of another node in the middle of a firing."""

    whom = hfg.Parameter("")
    after_s = hfg.Parameter(0.001)

    async def process(self, value: int) -> None:
        await asyncio.sleep(self.after_s)
        try:
            await RUNS[0].edit(c.SetParameter(self.whom, "nobody.whom"))
        except UsageError as error:
            LOG.append(str(error))
        else:
            LOG.append(f"{self.whom} was set")


def line() -> hfg.Graph:
    graph = hfg.Graph("line")
    source = graph.add(script(values=tuple(range(20))), max_rate_hz=250.0)
    source >> graph.add(Device(), name="device") >> graph.add(sink(), name="sink")
    return graph


def drive(graph: hfg.Graph, body: Callable[[hfg.Run], Awaitable[Any]]) -> Recorder:
    trace = recorder()

    async def main() -> None:
        async with hfg.running(graph, trace=trace) as run:
            RUNS.append(run)
            await body(run)

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    return trace


# --- parameters ---


@pytest.mark.rule("R4", "P8")
@pytest.mark.parametrize(
    ("edits", "seen"),
    [
        ((c.Add(named(Device), "new"), c.SetParameter("new.gain", 5)), "open 5"),
        ((c.Replace("device", named(Other)), c.SetParameter("device.gain", 6)), "open other 6"),
        ((c.SetParameter("device.gain", 7), c.Replace("device", named(Other))), "open other 7"),
    ],
)
def test_a_node_is_set_up_with_the_parameters_of_the_whole_edit(edits: tuple[c.Command, ...], seen: str) -> None:
    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        await run.edit(*edits)

    drive(line(), body)
    assert [entry for entry in LOG if entry.startswith("open")] == ["open 1", seen]


@pytest.mark.rule("R4", "F10")
def test_a_node_that_is_enabled_is_set_up_with_the_parameters_of_the_whole_edit() -> None:
    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        await run.edit(c.Disable("device"))
        await run.edit(c.SetParameter("device.gain", 9), c.Enable("device"))
        assert run.graph["device"].gain == 9

    trace = drive(line(), body)
    assert LOG[-2:] == ["open 9", "close"]
    assert [(event.parameter, event.value) for event in trace if isinstance(event, ParameterSet)] == [("gain", 9)]


@pytest.mark.rule("R4")
def test_a_cancelled_edit_leaves_a_parameter_that_was_set_meanwhile() -> None:
    graph = hfg.Graph()
    graph.add(script(values=(1, 2, 3)), max_rate_hz=100.0) >> graph.add(Waiting(pause_s=0.005), name="slow")

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        editing = asyncio.create_task(run.edit(c.SetParameter("slow.pause_s", 0.001)))
        await asyncio.sleep(0)
        run.set(graph["slow"].ports.parameters["pause_s"], 0.004)
        editing.cancel()
        await asyncio.wait({editing})
        assert editing.cancelled()
        await asyncio.sleep(0.005)  # until the firing is over
        assert graph["slow"].pause_s == 0.004

    drive(graph, body)


@pytest.mark.rule("R4", "F10")
def test_disabled_and_enabled_in_one_edit_is_as_it_was() -> None:
    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        REFUSES.add("open")
        await run.edit(c.Disable("device"), c.Enable("device"))
        await run.wait_finished()

    trace = drive(line(), body)
    assert LOG == ["open 1", "close"]
    assert not [event for event in trace if isinstance(event, NodeEnabled)]


# --- failures ---


@pytest.mark.rule("R4", "X3")
def test_a_node_whose_teardown_fails_is_replaced_and_the_failure_told_at_the_end() -> None:
    graph = line()

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        REFUSES.add("close")
        await run.edit(c.Replace("device", named(Other)))
        REFUSES.clear()
        await run.wait_finished()
        assert ["it hangs" in error for error in run.report().errors] == [True]

    drive(graph, body)
    assert LOG == ["open 1", "close", "open other 1", "close"]


@pytest.mark.rule("R4")
def test_a_node_whose_successor_cannot_be_set_up_is_set_up_again() -> None:
    graph = line()
    before = drawn(graph)

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        REFUSES.add("other")
        with pytest.raises(NodeError, match="no such device"):
            await run.edit(c.Replace("device", named(Other)))
        assert drawn(graph) == before
        await run.wait_finished()

    trace = drive(graph, body)
    assert LOG == ["open 1", "close", "open other 1", "close", "open 1", "close"]
    assert trace.values("device.out -> sink.value")[:-1] == list(range(20))


@pytest.mark.rule("R4")
def test_a_run_fails_if_neither_the_successor_nor_the_node_itself_can_be_set_up() -> None:
    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        REFUSES.update({"other", "open"})
        with pytest.raises(NodeError, match="no such device"):
            await run.edit(c.Replace("device", named(Other)))
        await run.wait_finished()

    with pytest.raises(NodeError, match='node "device" failed in setup'):
        drive(line(), body)


@pytest.mark.rule("R4")
def test_an_edit_cancelled_while_it_replaces_a_node_sets_it_up_again() -> None:
    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.005):
                await run.edit(c.Replace("device", named(Other)))
        await run.wait_finished()

    drive(line(), body)
    assert LOG == ["open 1", "close cut off", "open 1", "close"]


@pytest.mark.rule("R4")
def test_an_edit_cancelled_behind_its_effect_is_in_the_history_and_the_teardown_goes_on() -> None:
    graph = line()
    before = drawn(graph)

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.005):
                await run.edit(c.Remove("device"))
        assert LOG == ["open 1"]
        assert "device" not in graph.nodes
        await asyncio.sleep(0.01)
        assert LOG == ["open 1", "close"]
        await run.undo()

    drive(graph, body)
    assert drawn(graph) == before
    with pytest.raises(UsageError, match="nothing to undo"):
        graph.undo()


@pytest.mark.rule("R4", "X3")
def test_a_run_that_ends_waits_for_the_teardown_of_nodes_that_were_removed() -> None:
    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        editing = asyncio.create_task(run.edit(c.Remove("device")))
        await asyncio.sleep(0.001)
        editing.cancel()
        await asyncio.wait({editing})

    drive(line(), body)
    assert LOG == ["open 1", "close"]


@pytest.mark.rule("R4", "X3")
def test_the_failing_teardown_of_a_removed_node_is_told_at_the_end() -> None:
    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        REFUSES.add("close")
        await run.edit(c.Remove("device"))
        await run.wait_finished()
        assert ["it hangs" in error for error in run.report().errors] == [True]

    drive(line(), body)


# --- nodes that edit ---


def test_a_setup_that_waits_for_an_edit_behind_its_own_is_told() -> None:
    async def body(run: hfg.Run) -> None:
        with pytest.raises(NodeError, match='"new" edits the graph in the middle of its code and would wait for ever'):
            await run.edit(c.Add(named(Restless), "new"))
        await run.edit(c.Rename("script", "first"))  # the turn is free

    drive(line(), body)


def test_a_teardown_may_edit() -> None:
    graph = hfg.Graph()
    graph.add(script(values=(1,)), max_rate_hz=1.0) >> graph.add(Leaver(), name="leaver")

    async def body(run: hfg.Run) -> None:
        await run.edit(c.Remove("leaver"))

    drive(graph, body)
    assert LOG == ["edited"]
    assert list(graph.nodes) == ["other"]


def editors(**whom: tuple[str, float]) -> hfg.Graph:
    graph = hfg.Graph()
    source = graph.add(script(values=(1,)))
    for name, (other, after_s) in whom.items():
        source >> graph.add(Editor(whom=other, after_s=after_s), name=name)
    return graph


def test_of_two_nodes_that_edit_each_other_the_second_is_told() -> None:
    async def body(run: hfg.Run) -> None:
        await run.wait_finished()

    drive(editors(a=("b.whom", 0.001), b=("a.whom", 0.002)), body)
    assert LOG[0].startswith('"b" edits the graph in the middle of its code')
    assert LOG[1:] == ["b.whom was set"]


def test_a_node_that_sets_its_own_parameter_by_an_edit_is_told_and_keeps_it() -> None:
    async def body(run: hfg.Run) -> None:
        await run.wait_finished()
        assert run.graph["a"].whom == "a.whom"

    drive(editors(a=("a.whom", 0.001)), body)
    assert LOG[0].startswith('"a" edits the graph in the middle of its code')


def test_a_node_that_waits_behind_an_edit_that_comes_to_need_it_is_told() -> None:
    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.0005)
        first = asyncio.create_task(run.edit(c.Rename("slow", "one")))  # for which the others wait
        await asyncio.sleep(0.0001)
        second = asyncio.create_task(run.edit(c.Rename("a", "two")))
        await asyncio.gather(first, second)
        await run.wait_finished()

    graph = editors(a=("slow.pause_s", 0.001))
    graph["script"] >> graph.add(Waiting(pause_s=0.01), name="slow")
    drive(graph, body)
    assert [entry[:24] for entry in LOG] == ['"a" edits the graph in t']
    assert list(graph.nodes) == ["script", "two", "one"]


def test_an_edit_that_is_cancelled_in_the_queue_leaves_its_turn_to_the_next() -> None:
    graph = editors()
    graph["script"] >> graph.add(Waiting(pause_s=0.01), name="slow")

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.001)
        edits = [asyncio.create_task(run.edit(c.Rename("slow", "one")))]
        edits += [asyncio.create_task(run.edit(c.Add("hfg.testing.nodes:sink", name))) for name in "xyz"]
        await asyncio.sleep(0.001)
        edits[2].cancel()
        await asyncio.gather(*edits, return_exceptions=True)

    drive(graph, body)
    assert list(graph.nodes) == ["script", "one", "x", "z"]
