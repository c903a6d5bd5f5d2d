"""Enabling and disabling by edits and by subgraphs, also amid firings and back-offs (rules F10, G2, R4)."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

import hfg
from hfg import commands as c
from hfg.errors import NodeError
from hfg.testing import Recorder, recorder, replay
from hfg.testing.nodes import (
    Failing,
    Latch,
    Scaled,
    Waiting,
    add,
    ascript,
    double,
    script,
    sink,
)
from hfg.trace import (
    CallStarted,
    EventTriggered,
    FiringEnded,
    FiringStarted,
    NodeEnabled,
    NodeEnded,
    StructureChanged,
    TokenDropped,
)
from tests.semantics.nodes import Farewell, Last, named
from tests.support.edits import drawn


class Pair(hfg.Subgraph):
    """A slow node and a quick one, each with a source of its own."""

    def build(self, graph: hfg.Graph) -> None:
        graph.add(script(values=(1, 2)), name="some") >> graph.add(Waiting(pause_s=0.01), name="slow")
        graph.add(ascript(values=(1, 2, 3, 4), pause_s=0.003), name="others") >> graph.add(double(), name="quick")


class Moody(hfg.Node):
    """Takes its time to be set up, and may fail at it."""

    async def setup(self) -> None:
        LOG.append("open")
        try:
            await asyncio.sleep(0.005)
        except asyncio.CancelledError:
            LOG.append("cancelled")
            raise
        if REFUSES:
            raise RuntimeError("no such device")

    def teardown(self) -> None:
        LOG.append("close")

    def process(self, value: int) -> int:
        return value


REFUSES: list[str] = []
LOG: list[str] = []


def pair(*, off_s: float | None = None, on_s: float | None = None) -> hfg.Graph:
    graph = hfg.Graph()
    box = graph.add(Pair(), name="pair")
    if off_s is not None:
        graph.connect(graph.add(ascript(values=(0,), pause_s=off_s), name="off").out, box.disable)
    if on_s is not None:
        graph.connect(graph.add(ascript(values=(0,), pause_s=on_s), name="on").out, box.enable)
    return graph


def drive(
    build: Callable[[], hfg.Graph], body: Callable[[hfg.Run], Awaitable[Any]] | None = None, *, compare: bool = True
) -> Recorder:
    """Run a graph in virtual time, do something to it, and let the oracle judge it."""
    trace = recorder()

    async def main() -> None:
        async with hfg.running(build(), trace=trace) as run:
            if body is not None:
                await body(run)
            await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    if compare:
        replay(build(), trace)
    return trace


def firings(trace: Recorder, node: str) -> list[float]:
    return [round(event.time, 6) for event in trace if isinstance(event, FiringStarted) and event.node == node]


@pytest.mark.rule("F10", "G2")
def test_a_subgraph_enabled_amid_a_firing_inside_gets_that_node_back_when_it_is_over() -> None:
    trace = drive(lambda: pair(off_s=0.002, on_s=0.004))
    assert [event.time for event in trace if isinstance(event, NodeEnabled)] == [0.002, 0.004]
    ends = [(round(e.time, 6), e.outcome) for e in trace if isinstance(e, FiringEnded) and e.node == "pair/slow"]
    assert ends[0] == (0.01, "abandoned")
    assert firings(trace, "pair/others")[1] == 0.004  # at once, and from its beginning


@pytest.mark.rule("R4", "F10", "G2")
def test_an_edit_that_enables_a_subgraph_waits_for_the_firings_inside() -> None:
    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        await run.edit(c.Disable("pair"))
        await asyncio.sleep(0.002)
        await run.undo()

    trace = drive(pair, body)
    assert [event.time for event in trace if isinstance(event, NodeEnabled)] == [0.002, 0.01]
    assert firings(trace, "pair/others")[1] == 0.01


@pytest.mark.rule("R4", "F10", "P7")
def test_initial_tokens_of_an_edge_that_an_edit_leads_to_a_disabled_node_are_discarded() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        graph.add(script(values=(1, 2, 3, 4)), max_rate_hz=250.0) >> graph.add(sink(), name="free")
        graph.add(double(), name="resting", enabled=False)
        return graph

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.001)
        await run.edit(c.Connect("script.out", "resting.value", initial=(5,)))
        await asyncio.sleep(0.004)
        await run.edit(c.Enable("resting"))

    trace = drive(build, body)
    assert trace.dropped("script.out -> resting.value") == [5]
    assert trace.taken("script.out -> resting.value") == [3, 4, hfg.END]


@pytest.mark.rule("R4", "F10")
def test_what_an_edit_enables_is_set_up_before_and_takes_part_from_one_moment_on() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source = graph.add(script(values=(1, 2, 3, 4)), max_rate_hz=250.0)
        source >> graph.add(Moody(), name="moody", enabled=False) >> graph.add(sink())
        source >> graph.add(sink(), name="free")
        return graph

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.001)
        await run.edit(c.Enable("moody"))
        assert run.now() == 0.011  # of those, five for the setup at the beginning

    trace = drive(build, body, compare=False)
    events = list(trace)
    at = next(number for number, event in enumerate(events) if isinstance(event, StructureChanged))
    assert events[at + 1] == NodeEnabled(events[at].time, "moody", True)
    assert firings(trace, "free") == [0.005, 0.009, 0.013, 0.017, 0.021]
    assert trace.values("moody.out -> sink.value")[:-1] == [3, 4]


@pytest.mark.rule("R4", "F10")
def test_a_node_whose_setup_fails_stays_disabled_and_the_run_goes_on() -> None:
    graph = hfg.Graph()
    source = graph.add(script(values=(1, 2, 3)), max_rate_hz=100.0)
    source >> graph.add(Moody(), name="moody") >> graph.add(sink())

    async def body(run: hfg.Run) -> None:
        await run.edit(c.Disable("moody"))
        REFUSES.append("yes")
        try:
            with pytest.raises(NodeError, match='"moody" failed in setup.*no such device'):
                await run.edit(c.Enable("moody"))
        finally:
            REFUSES.clear()
        assert not graph["moody"]._options.enabled
        await run.edit(c.Enable("moody"))

    trace = drive(lambda: graph, body, compare=False)
    assert [event.enabled for event in trace if isinstance(event, NodeEnabled)] == [False, True]


@pytest.mark.rule("R4", "F10")
@pytest.mark.parametrize("there", [True, False])
def test_an_edit_that_is_cancelled_while_it_sets_up_cancels_that_and_can_be_done_again(*, there: bool) -> None:
    graph = hfg.Graph()
    source = graph.add(script(values=(1, 2, 3, 4)), max_rate_hz=100.0)
    source >> graph.add(sink(), name="free")
    edit: list[c.Command] = [c.Add(named(Moody), "moody"), c.Connect("script.out", "moody.value")]
    if there:
        source >> graph.add(Moody(), name="moody", enabled=False)
        edit = [c.Enable("moody")]
    before = drawn(graph)

    async def body(run: hfg.Run) -> None:
        LOG.clear()
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.003):
                await run.edit(*edit)
        assert drawn(graph) == before
        await run.edit(*edit)
        assert [*(["close"] if there else []), "open", "cancelled", "close", "open"] == LOG

    trace = drive(lambda: graph, body, compare=False)
    assert trace.values("script.out -> moody.value")[:-1] == [2, 3, 4]


@pytest.mark.rule("R4", "G1", "F10")
def test_a_disabled_subgraph_that_is_dissolved_leaves_disabled_nodes() -> None:
    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.003)  # its slot has disabled it by now
        await run.edit(c.Disconnect("off.out", "pair.disable"))
        await run.edit(c.Dissolve("pair"))
        await asyncio.sleep(0.009)
        await run.edit(c.Enable("others"), c.Enable("quick"))

    def build() -> hfg.Graph:
        graph = pair(off_s=0.002)
        graph.add(script(values=(1, 2, 3)), name="clock", max_rate_hz=100.0) >> graph.add(sink())
        return graph

    trace = drive(build, body)
    assert firings(trace, "others")[0] == 0.019  # removing waited for the firing of "slow"
    assert firings(trace, "slow") == []


@pytest.mark.rule("R4", "G1", "F10")
def test_enabled_and_dissolved_in_one_edit_and_back_again() -> None:
    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.001)
        await run.edit(c.Disable("pair"))
        await run.edit(c.Enable("pair"), c.Dissolve("pair"))
        await asyncio.sleep(0.004)
        await run.undo()
        await run.redo()

    trace = drive(pair, body)
    assert len(firings(trace, "others")) > 4
    told = [(event.node, event.enabled) for event in trace if isinstance(event, NodeEnabled)]
    assert told[:2] == [("pair", False), ("pair", True)]


@pytest.mark.rule("X1", "F10", "R4")
def test_enabling_a_node_in_its_back_off_does_not_cut_that_short() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source = graph.add(script(values=(1, 2, 3)))
        weak = graph.add(Failing(at=1), name="weak", on_error="restart", restart_backoff_s=0.05)
        graph.connect(source.out, weak.value)
        return graph

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.01)
        await run.edit(c.Disable("weak"))
        await run.edit(c.Enable("weak"))

    assert firings(drive(build, body), "weak")[1] == 0.05


@pytest.mark.rule("R4", "F12")
def test_a_removed_node_that_waits_to_send_its_end_sends_nothing() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        last = graph.add(Last(), name="last")
        graph.add(script(values=())) >> last
        last >> graph.add(sink(), name="free")
        join = graph.add(add(), name="join")
        graph.connect(last.out, join.a)  # lies there: nothing comes to the other input
        graph.connect(graph.add(script(), name="other", enabled=False).out, join.b)
        return graph

    async def body(run: hfg.Run) -> None:
        await run.wait_quiet()
        await run.edit(c.Remove("last"))

    trace = drive(build, body)
    assert trace.values("last.out -> free.value") == [7]
    assert [event.edge for event in trace if isinstance(event, TokenDropped)] == ["last.out -> join.a"]


@pytest.mark.rule("A9", "A12")
def test_what_a_time_out_amid_a_firing_takes_away_is_told_behind_it() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        slow = graph.add(Waiting(pause_s=0.02), name="slow", active_for_s=0.005)
        graph.add(script(values=(1,))) >> slow
        graph.connect(slow.timeout, graph.add(Scaled(), name="next").activate, active=True)
        graph.connect(slow.deactivated, graph.add(Scaled(), name="told").activate)
        graph.start.activates(slow.activate)
        return graph

    trace = drive(build)
    moments = {event.event: round(event.time, 6) for event in trace if isinstance(event, EventTriggered)}
    assert (moments["slow.timeout"], moments["slow.deactivated"]) == (0.005, 0.02)


@pytest.mark.rule("F9", "P8")
def test_signals_into_slots_and_parameters_arrive_in_order_of_connecting() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        wait = graph.add(Waiting(pause_s=0.001), name="wait")
        graph.add(script(values=(3,))) >> wait
        scaled = graph.add(Scaled(), name="scaled")
        graph.connect(wait.before, scaled.ports.parameters["factor"])
        graph.connect(wait.before, scaled.ports.slots["ping"])
        return graph

    calls = [event.slot for event in drive(build) if isinstance(event, CallStarted) and event.node == "scaled"]
    assert calls == ["factor", "ping"]


@pytest.mark.rule("F4", "F5", "F10")
def test_a_node_that_is_disabled_ends_without_waiting_for_what_others_have_taken() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        graph.add(Farewell(), name="source") >> graph.add(Waiting(pause_s=0.01), name="slow")
        return graph

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        await run.edit(c.Disable("source"))

    trace = drive(build, body)
    assert next((event.node, event.time) for event in trace if isinstance(event, NodeEnded)) == ("source", 0.002)


@pytest.mark.rule("F4", "F12", "R4")
def test_a_node_that_starts_afresh_with_nothing_left_but_initial_tokens_ends_again() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        latch = graph.add(Latch(), name="latch")
        graph.connect(graph.add(script(values=()), name="first").out, latch.first)
        late = graph.add(ascript(values=(4, 5), pause_s=0.005), name="late")
        graph.connect(late.out, latch.second, initial=[1])
        latch >> graph.add(sink())
        late >> graph.add(sink(), name="other")  # or the run would be over
        return graph

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        await run.edit(c.Replace("latch", "hfg.testing.nodes:Latch"))

    trace = drive(build, body)
    kinds = [(event.time, event.kind) for event in trace if isinstance(event, FiringStarted) and event.node == "latch"]
    assert kinds == [(0.0, "end"), (0.005, "end")]
