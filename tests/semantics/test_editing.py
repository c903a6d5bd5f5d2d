"""What an edit means to the nodes of a running graph, sentence by sentence (rule R4)."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

import hfg
from hfg import commands as c
from hfg.errors import GraphError, NodeError, NotRunning, UsageError
from hfg.testing import Recorder, recorder, replay
from hfg.testing.nodes import Waiting, add, double, script, sink
from hfg.trace import (
    ActivityLost,
    EditWaits,
    EventTriggered,
    FiringStarted,
    NodeEnded,
    StructureChanged,
    TokenDropped,
)
from tests.semantics.nodes import Last
from tests.support.edits import drawn

LOG: list[str] = []


class Ear(hfg.Node):
    """Takes signals, and keeps what it heard."""

    heard = hfg.State[list[int]](factory=list)

    @hfg.slot
    def hear(self, value: int) -> None:
        self.heard.append(value)


class Mouth(hfg.Node):
    """Says what it is told to."""

    said = hfg.Event(int)

    @hfg.slot
    def say(self, value: int) -> None:
        self.said.trigger(value)


class Careful(hfg.Node):
    """Opens and closes something."""

    def setup(self) -> None:
        LOG.append("open")

    async def process(self, value: int) -> int:
        await asyncio.sleep(0.01)
        return value

    def teardown(self) -> None:
        LOG.append("close")


class Slow(hfg.Node):
    """Takes its time."""

    @hfg.slot
    async def take(self, value: int) -> None:
        await asyncio.sleep(0.01)


class Broken(hfg.Node):
    """Cannot be set up."""

    def setup(self) -> None:
        raise RuntimeError("no such device")

    def process(self, value: int) -> int:
        return value


class Each(hfg.Subgraph):
    """Iterates."""

    items = hfg.Input(int)
    results = hfg.Output(int)
    iterate_over = ("items",)

    def build(self, graph: hfg.Graph) -> None:
        node = graph.add(double())
        graph.connect(self.items.inner, node.value)
        graph.connect(node.out, self.results.inner)


def drive(graph: hfg.Graph, body: Callable[[hfg.Run], Awaitable[Any]], *, compare: hfg.Graph | None = None) -> Recorder:
    """Run a graph in virtual time and do something to it; `compare`: the same graph again, for the oracle."""
    trace = recorder()

    async def main() -> None:
        async with hfg.running(graph, trace=trace) as run:
            await body(run)

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    if compare is not None:
        replay(compare, trace)
    return trace


def pipeline(*values: int, pause_s: float = 0.0, rate: float = 100.0) -> hfg.Graph:
    graph = hfg.Graph("line")
    source = graph.add(script(values=values), max_rate_hz=rate)
    middle = graph.add(Waiting(pause_s=pause_s), name="middle") if pause_s else graph.add(double(), name="middle")
    source >> graph["middle.value"]
    graph.connect(middle.ports.outputs["out"], graph.add(sink()).value)
    return graph


# --- edges ---


@pytest.mark.rule("R4")
def test_a_removed_edge_counts_as_processed() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        source, join = graph.add(script(values=(1, 2, 3))), graph.add(add())
        graph.connect(source.out, join.a)
        graph.add(script(values=(0,)), name="other", enabled=False)
        graph.connect(graph["other.out"], join.b)  # never comes: the source stands still after one token
        source >> graph.add(sink(), name="free")
        return graph

    async def body(run: hfg.Run) -> None:
        await run.wait_quiet()
        assert run.statistics().nodes["script"].firings == 1
        await run.edit(c.Disconnect("script.out", "add.a"))
        await run.wait_finished()

    trace = drive(build(), body)
    assert trace.values("script.out -> free.value")[:-1] == [1, 2, 3]
    assert [event.token.value for event in trace if isinstance(event, TokenDropped)] == [1]


@pytest.mark.rule("R4")
def test_a_new_edge_starts_empty_and_is_waited_for_from_the_next_firing_on() -> None:
    graph = hfg.Graph()
    ones, join = graph.add(script(values=(1,) * 8), name="ones", max_rate_hz=100.0), graph.add(add())
    graph.connect(ones.out, join.a)
    graph.connect(graph.add(script(values=(10,) * 9), name="tens", max_rate_hz=100.0).out, join.b)
    graph.add(
        script(
            values=(5,),
        ),
        name="late",
        enabled=False,
    )
    join >> graph.add(sink())

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.015)
        await run.edit(c.Disconnect("ones.out", "add.a"), c.Connect("late.out", "add.a"))
        before = run.statistics().nodes["add"].firings
        await asyncio.sleep(0.03)
        assert run.statistics().nodes["add"].firings == before  # it waits for what has never sent
        await run.undo()
        await run.wait_finished()

    trace = drive(graph, body)
    assert trace.values("add.out -> sink.value")[:-1] == [11, 11, 11, 11, 11]


@pytest.mark.rule("R4", "F2")
def test_a_node_that_loses_its_last_input_does_not_become_a_source() -> None:
    graph = hfg.Graph()

    @hfg.node
    def either(value: int = 7) -> int:
        return value

    source = graph.add(script(values=(1, 2)), max_rate_hz=100.0)
    graph.connect(source.out, graph.add(either()).ports.inputs["value"])

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.005)
        await run.edit(c.Disconnect("script.out", "either.value"))
        await run.wait_quiet()
        assert run.statistics().nodes["either"].firings == 1

    drive(graph, body)


@pytest.mark.rule("R4", "A8")
@pytest.mark.parametrize("sender_too", [False, True])
def test_activity_on_a_removed_edge_goes_back_or_is_counted_as_lost(sender_too: bool) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        mouth, join = graph.add(Mouth()), graph.add(add())
        graph.connect(mouth.said, join.a, active=True)  # its other input is not connected: the signal stays there
        return graph

    graph = build()

    async def body(run: hfg.Run) -> None:
        await run.trigger(graph["mouth"].say, 1, activity=1)
        await run.wait_quiet()
        assert run.active() == []
        await run.edit(c.Remove("mouth") if sender_too else c.Disconnect("mouth.said", "add.a"))
        assert run.active() == ([] if sender_too else ["mouth"])
        assert run.report().lost_activity == int(sender_too)

    trace = drive(graph, body)
    assert [event.edge for event in trace if isinstance(event, ActivityLost)] == ["mouth.said -> add.a"] * sender_too


# --- nodes ---


@pytest.mark.rule("R4")
def test_a_node_is_removed_behind_its_firing_and_others_go_on() -> None:
    LOG.clear()
    graph = hfg.Graph()
    source = graph.add(script(values=(1, 2, 3, 4)), max_rate_hz=200.0)
    graph.connect(source.out, graph.add(Careful()).ports.inputs["value"])
    graph.add(script(values=(7, 8, 9)), name="other", max_rate_hz=500.0) >> graph.add(sink(), name="elsewhere")

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.001)
        begun = run.now()
        await run.edit(c.Remove("careful"))
        assert run.now() == pytest.approx(begun + 0.009)  # its firing took 0.01 s
        assert LOG == ["open", "close"]
        await run.wait_finished()

    trace = drive(graph, body)
    assert [event.nodes for event in trace if isinstance(event, EditWaits)] == [("script", "careful")]
    assert [event.time for event in trace if isinstance(event, FiringStarted) and event.node == "other"][:3] == (
        pytest.approx([0.0, 0.002, 0.004])
    )


@pytest.mark.rule("R4", "G1")
def test_grouping_dissolving_renaming_and_replacing_leave_tokens_where_they_are() -> None:
    graph = hfg.Graph()
    mouth, join, ear = graph.add(Mouth()), graph.add(add()), graph.add(Ear())
    graph.connect(mouth.said, join.a)  # three signals will wait here
    graph.connect(join.out, ear.hear)
    graph.connect(graph.add(Mouth(), name="late").said, join.b)

    async def body(run: hfg.Run) -> None:
        for value in (1, 2, 3):
            await run.trigger(mouth.say, value)
        await run.wait_quiet()
        await run.edit(c.Enclose(("mouth", "add"), "box"))
        await run.edit(c.Rename("box", "shell"), c.Rename("shell/add", "plus"))
        assert run.report().edges["shell/mouth.said -> shell/plus.a"].untaken == 3
        await run.edit(c.Dissolve("shell"), c.Replace("plus", "hfg.testing.nodes:add"))
        for value in (10, 20, 30):
            await run.trigger(graph["late"].say, value)
        await run.wait_quiet()
        assert ear.heard == [11, 22, 33]

    drive(graph, body)


@pytest.mark.rule("R4")
def test_a_parameter_that_the_old_node_did_not_have_is_set_with_the_new_node() -> None:
    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.015)
        await run.edit(c.Replace("middle", "hfg.testing.nodes:Scaled"), c.SetParameter("middle.factor", 5))
        await run.wait_finished()

    def build() -> hfg.Graph:
        return pipeline(1, 2, 3, 4)

    trace = drive(build(), body, compare=build())
    assert trace.values("middle.out -> sink.value") == [2, 4, 15, 20, hfg.END]
    assert dict(double()._parameters) == {}  # nor has any other node without parameters one now


@pytest.mark.rule("R4")
def test_edited_then_run_equals_built_so_then_run() -> None:
    edited, built = pipeline(1, 2, 3), hfg.Graph("line")
    edited.edit(
        c.Add("hfg.testing.nodes:double", "more"),
        c.Disconnect("middle.out", "sink.value"),
        c.Connect("middle.out", "more.value"),
        c.Connect("more.out", "sink.value"),
    )
    source = built.add(script(values=(1, 2, 3)), max_rate_hz=100.0)
    middle, end = built.add(double(), name="middle"), built.add(sink())
    more = built.add(double(), name="more")
    source >> middle >> more >> end
    traces = []
    for graph in (edited, built):
        traces.append(recorder())
        hfg.run(graph, clock="virtual", trace=traces[-1])
    assert list(traces[0]) == list(traces[1])


@pytest.mark.rule("R4", "P8")
def test_a_parameter_changes_between_firings() -> None:
    graph = hfg.Graph()
    seen = []

    class Slow(hfg.Node):
        factor = hfg.Parameter(1)

        async def process(self, value: int) -> None:
            before = self.factor
            await asyncio.sleep(0.01)
            seen.append((before, self.factor))

    graph.connect(graph.add(script(values=(1, 1)), max_rate_hz=50.0).out, graph.add(Slow()).ports.inputs["value"])

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.005)
        await run.edit(c.SetParameter("slow.factor", 2))
        await run.undo()
        await run.redo()
        await run.wait_finished()

    drive(graph, body)
    assert seen == [(1, 1), (2, 2)]


@pytest.mark.rule("R4", "T5")
def test_signals_of_a_node_that_was_moved_into_a_thread_keep_their_stamps() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        graph.group("work", threads=1)
        graph.connect(graph.add(Mouth()).said, graph.add(Ear()).hear)
        return graph

    graph = build()

    async def body(run: hfg.Run) -> None:
        await run.edit(c.Move("mouth", "work"))
        await asyncio.sleep(0.5)
        await run.trigger(graph["mouth"].say, 1, stamp=0.25)
        await run.wait_quiet()

    trace = drive(graph, body)
    assert [event.token.stamp for event in trace if isinstance(event, EventTriggered)] == [0.25]


@pytest.mark.rule("R4", "F4")
def test_an_edit_that_waits_does_not_hold_back_the_end_of_a_stream() -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(script(values=(1,))).out, graph.add(Last()).value)
    graph.connect(graph["last"].out, graph.add(Slow()).ports.slots["take"])

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.001)  # it has ended, and its END waits for the slot call
        await run.edit(c.Disconnect("last.out", "slow.take"))
        await run.wait_finished()

    trace = drive(graph, body)
    order = [type(event).__name__ for event in trace if isinstance(event, EditWaits | NodeEnded | StructureChanged)]
    assert order[1:] == ["EditWaits", "NodeEnded", "StructureChanged"]  # the first is the script's


# --- what goes wrong ---


REFUSED = [
    (c.Connect("middle.out", "middle.value"), GraphError, "takes one edge"),
    (c.Connect("middle.processed", "script.poke"), GraphError, 'has no port "poke"'),
    (c.Add("no.such:type", "x"), GraphError, "no module named"),
    (c.Add("tests.semantics.test_editing:Broken", "x"), NodeError, 'node "x" failed in setup()'),
    (c.Remove("nobody"), GraphError, 'there is no "nobody"'),
]


@pytest.mark.parametrize(("command", "error", "sentence"), REFUSED)
def test_what_is_refused_leaves_graph_and_run_as_they_were(
    command: c.Command, error: type[Exception], sentence: str
) -> None:
    graph = pipeline(1, 2, 3)
    before = drawn(graph)

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.005)
        with pytest.raises(error) as refused:
            await run.edit(c.Rename("sink", "drain"), command)
        assert sentence in str(refused.value)
        assert drawn(graph) == before
        with pytest.raises(UsageError, match="nothing to undo"):
            await run.undo()
        await run.wait_finished()

    trace = drive(graph, body, compare=pipeline(1, 2, 3))
    assert trace.values("middle.out -> sink.value")[:-1] == [2, 4, 6]
    assert not [event for event in trace if isinstance(event, StructureChanged)]


@pytest.mark.rule("P2", "R4")
def test_a_second_edge_by_way_of_a_subgraph_is_refused_also_while_what_it_joins_is_moved() -> None:
    """The edge that is there goes the same way as before, so nothing says that it changes."""
    graph = hfg.Graph()
    outer = graph.add(Outer(), name="outer")
    graph.connect(outer.out, graph.add(sink(), name="last").value)
    second, move = c.Connect("outer/second.out", "outer.out.inner"), c.Enclose(("last", "outer"), "box")

    async def body(run: hfg.Run) -> None:
        for commands in ((second,), (second, move)):
            with pytest.raises(GraphError, match="takes one edge"):
                await run.edit(*commands)
        await run.edit(move)

    drive(graph, body)


class Inner(hfg.Subgraph):
    """A source within a source."""

    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        graph.connect(graph.add(script(values=(1,))).out, self.out.inner)


class Outer(hfg.Subgraph):
    """Another source beside it."""

    out = hfg.Output(int)

    def build(self, graph: hfg.Graph) -> None:
        graph.add(script(values=(2,)), name="second")
        graph.connect(graph.add(Inner()).out, self.out.inner)


def test_a_ring_without_delay_is_refused_also_while_it_runs() -> None:
    graph = pipeline(1, 2, 3)
    join = graph.add(add())
    join >> graph.add(double(), name="last")

    async def body(run: hfg.Run) -> None:
        with pytest.raises(GraphError, match="it would break the graph.*a ring of synchronous edges"):
            await run.edit(c.Connect("last.out", "add.a"))
        await run.edit(c.Connect("last.out", "add.a", initial=(0,)))

    drive(graph, body)


def test_an_edit_that_is_given_up_while_it_waits_changes_nothing() -> None:
    graph = pipeline(1, 2, 3, pause_s=0.008)
    before = drawn(graph)

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.001):
                await run.edit(c.Remove("middle"))
        assert drawn(graph) == before
        await run.wait_finished()

    trace = drive(graph, body)
    undisturbed = recorder()
    hfg.run(pipeline(1, 2, 3, pause_s=0.008), clock="virtual", trace=undisturbed)
    assert trace.values("middle.out -> sink.value") == undisturbed.values("middle.out -> sink.value")


def test_a_node_that_would_wait_for_itself_is_told() -> None:
    graph = hfg.Graph()
    runs: list[hfg.Run] = []
    later: list[asyncio.Task[None]] = []

    @hfg.node
    async def vain(value: int) -> None:
        with pytest.raises(UsageError, match='"vain" edits the graph in the middle of its code.*asyncio.create_task'):
            await runs[0].edit(c.Rename("vain", "modest"))
        later.append(asyncio.create_task(runs[0].edit(c.Rename("vain", "modest"))))

    graph.connect(graph.add(script(values=(1,)), max_rate_hz=1.0).out, graph.add(vain()).ports.inputs["value"])

    async def body(run: hfg.Run) -> None:
        runs.append(run)
        await run.wait_finished()

    drive(graph, body)
    assert list(graph.nodes) == ["script", "modest"]


def test_edits_come_one_after_the_other() -> None:
    graph = pipeline(1, 2, 3, pause_s=0.008)

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.002)
        first = asyncio.create_task(run.edit(c.Rename("middle", "one")))
        second = asyncio.create_task(run.edit(c.Rename("one", "two")))
        await asyncio.gather(first, second)
        assert list(graph.nodes) == ["script", "two", "sink"]
        await run.undo()
        await run.undo()
        await run.wait_finished()
        with pytest.raises(NotRunning, match="the run is over"):
            await run.edit(c.Rename("middle", "one"))

    drive(graph, body)
    graph.redo()
    assert list(graph.nodes) == ["script", "one", "sink"]


# --- gates ---


@pytest.mark.rule("A11", "R4")
def test_a_gate_that_is_set_while_it_runs_holds_from_the_next_firing_on() -> None:
    def build() -> hfg.Graph:
        graph = pipeline(*range(12))
        graph.add(Ear(), name="state")
        return graph

    async def body(run: hfg.Run) -> None:
        await asyncio.sleep(0.025)
        await run.edit(c.Gate("middle", "state"))
        await asyncio.sleep(0.03)
        await run.undo()
        await asyncio.sleep(0.03)
        await run.edit(c.Gate("middle", "state", 50.0))
        await run.wait_finished()

    trace = drive(build(), body, compare=build())
    kinds = "".join(e.kind[0] for e in trace if isinstance(e, FiringStarted) and e.node == "middle")
    assert kinds == "ppp" + "sss" + "ppp" + "psp" + "e"  # 100 firings a second, of which 50 may be


# --- what stays as it is from beginning to end ---


@pytest.mark.rule("R4")
def test_groups_and_ports_of_a_run_stay_as_they_are_also_by_undo_and_it_goes_on() -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph("line")
        graph.add(script(values=(1, 2, 3)), max_rate_hz=1) >> graph.add(sink())
        graph.edit(c.AddGroup("late", threads=0))
        return graph

    graph = build()
    before = drawn(graph)
    refused: dict[c.Command, str] = {
        c.AddGroup("more"): 'the groups of a graph that runs stay as they are, and "more" would be another; declare',
        c.ChangeGroup("late", policy="priority"): '"late" would be another',
        c.RemoveGroup("late"): '"late" would be another',
        c.SetEdge("script.out", "sink.value", buffer=2): '"script.out -> sink.value" keeps its buffer while the graph',
        c.AddInput("in", "int"): 'the ports of a graph that runs stay as they are, and "in" is one; edit it when',
    }

    async def body(run: hfg.Run) -> None:
        for command, sentence in refused.items():
            with pytest.raises(GraphError, match=sentence):
                await run.edit(c.Disable("script"), command)
            assert drawn(graph) == before
        with pytest.raises(GraphError, match='"late" would be another'):
            await run.undo()
        assert drawn(graph) == before
        await run.edit(c.Move("script", "late"), c.SetEdge("script.out", "sink.value", active=True, buffer=0))
        assert graph.edges[0].active
        await run.wait_finished()

    trace = drive(graph, body, compare=build())
    assert trace.values("script.out -> sink.value")[:-1] == [1, 2, 3]
    graph.undo()
    graph.undo()
    assert "late" not in graph.groups
