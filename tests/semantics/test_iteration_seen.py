"""What happens inside of subgraphs that iterate is seen and edited like all else (rules G4, R4, R7)."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from reactivex import operators as ops

import hfg
from hfg import commands as c
from hfg.errors import CheckFailed, GraphError, NodeError, RunError
from hfg.testing import Divergence
from hfg.testing.conformance import Replay
from hfg.trace import FiringStarted, TraceEvent
from tests.semantics.nodes import Keep, Send, fail_on, forward, forward_async
from tests.support.edited import EditedRun
from tests.support.iterated import random_iterated
from tests.support.making import Allowed

_MOST_EVENTS = 2000


@hfg.node
def lists(*, given: tuple[Any, ...] = ([1, 2, 3],)) -> Iterator[Any]:
    """Give collections."""
    yield from given


class Each(hfg.Subgraph):
    """Two nodes in a row, for each element."""

    items = hfg.Input(int)
    out = hfg.Output(int)
    iterate_over = ("items",)

    def build(self, graph: hfg.Graph) -> None:
        first, second = graph.add(forward(), name="first"), graph.add(forward_async(), name="second")
        graph.connect(self.items.inner, first.value)
        graph.connect(first.out, second.value)
        graph.connect(second.out, self.out.inner)


def graph_of(box: hfg.Node, *given: Any, **options: Any) -> tuple[hfg.Graph, Keep]:
    graph = hfg.Graph()
    source, sink = graph.add(lists(given=given or ([1, 2, 3],)), name="source"), graph.add(Keep(), name="sink")
    graph.add(box, name="each", **options)
    graph.connect(source.out, box.ports.inputs["items"])
    graph.connect(box.ports.outputs["out"], sink.value)
    return graph, sink


def edited(graph: hfg.Graph, body: Any) -> list[TraceEvent]:
    trace: list[TraceEvent] = []

    async def main() -> None:
        async with hfg.running(graph, trace=trace.append) as run:
            await body(run)

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    return trace


def run_at_random(plan: Any, seed: int) -> list[TraceEvent]:
    """All that is seen of a random run, cut off if it goes round for ever."""
    trace: list[TraceEvent] = []
    running: list[hfg.Run] = []

    def see(event: TraceEvent) -> None:
        trace.append(event)
        if len(trace) == _MOST_EVENTS:
            running[0].stop()

    async def main() -> None:
        async with hfg.running(plan.build(), policy="random", seed=seed, trace=see) as run:
            running.append(run)
            await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        try:
            runner.run(main())
        except CheckFailed:
            raise
        except RunError:
            pass  # the oracle knows whether it may
    return trace


@pytest.mark.slow
@pytest.mark.rule("G3", "G4", "R7", "F8", "P9")
@pytest.mark.parametrize("decade", range(3))
def test_random_graphs_inside_of_what_iterates_do_what_the_rules_say(decade: int) -> None:
    for seed in range(10 * decade, 10 * decade + 10):
        plan = random_iterated(seed, Allowed())
        trace = run_at_random(plan, seed)
        replaying = Replay(plan.build())
        try:
            for event in trace[: _MOST_EVENTS - 1]:
                replaying.see(event)
            if len(trace) < _MOST_EVENTS:
                replaying.check_over()
        except Divergence as divergence:
            pytest.fail(f"seed {seed}\n{divergence}")
        finally:
            replaying.machine.close()


@pytest.mark.slow
@pytest.mark.rule("G4", "R4")
@pytest.mark.parametrize("quiet", [False, True])
def test_random_edits_inside_of_what_iterates_do_what_the_rules_say(quiet: bool) -> None:
    carried_out = 0
    for seed in range(8):
        run = EditedRun(seed, replace(Allowed(), max_nodes=5), quiet=quiet, iterated=True)
        run.run()
        assert run.problems == []
        assert run.difference() is None, f"seed {seed}\n{run.difference()}"
        carried_out += run.carried_out
    assert carried_out > 10


@pytest.mark.rule("G4", "R7")
def test_trace_and_report_show_what_happens_inside_by_its_path() -> None:
    graph, sink = graph_of(Each())
    trace: list[TraceEvent] = []
    report = hfg.run(graph, clock="virtual", trace=trace.append)
    assert sink.values == [[1, 2, 3]]
    fired = [event.node for event in trace if isinstance(event, FiringStarted) and event.kind == "process"]
    assert fired == ["source", "each", *["each/first", "each/second"] * 3, "sink", "source"]
    assert report.nodes["each/second"].firings == 3
    assert report.edges["each.items -> each/first.value"].sent == 3
    assert report.edges["each/second.out -> each.out"].sent == 3


class Settling(hfg.Subgraph):
    """What is rung comes out when it has been quiet for a while."""

    items = hfg.Input(int)
    out = hfg.Output(int)
    iterate_over = ("items",)

    def build(self, graph: hfg.Graph) -> None:
        send, last = graph.add(Send(), name="send"), graph.add(forward(), name="last")
        graph.connect(self.items.inner, send.value)
        graph.connect(send.rang, last.value, through=[ops.debounce(0.5)])
        graph.connect(last.out, self.out.inner)


@pytest.mark.rule("G4", "P9")
def test_an_element_waits_for_the_operators_of_the_one_before() -> None:
    graph, sink = graph_of(Settling())
    report = hfg.run(graph, clock="virtual")
    assert sink.values == [[1, 2, 3]]
    assert report.duration_s == pytest.approx(1.5)


class Joins(hfg.Subgraph):
    """A node that waits for a signal that never comes."""

    items = hfg.Input(int)
    out = hfg.Output(int)
    iterate_over = ("items",)

    def build(self, graph: hfg.Graph) -> None:
        send, join = graph.add(Send(), name="send"), graph.add(Both(), name="join")
        graph.connect(self.items.inner, join.one)
        graph.connect(send.rang, join.two)
        graph.connect(join.out, self.out.inner)


@hfg.node
def Both(one: int, two: int) -> int:  # noqa: N802 - it stands beside subgraphs
    """Wait for both."""
    return one + two


@pytest.mark.rule("G4", "X1", "P4")
def test_an_element_behind_one_that_is_never_taken_is_an_error_of_the_firing() -> None:
    graph, _ = graph_of(Joins())
    with pytest.raises(NodeError) as failed:
        hfg.run(graph, clock="virtual")
    assert str(failed.value) == (
        'node "each" failed in firing 1: ValueError: element 2 of 3 cannot go in, for the one before lies untaken on '
        '"each.items -> each/join.one" and nothing moves inside any more: "each/join" waits for "two"; let each '
        "element be taken"
    )


class Fails(hfg.Subgraph):
    """Fails at a two."""

    items = hfg.Input(int)
    out = hfg.Output(int)
    iterate_over = ("items",)

    def build(self, graph: hfg.Graph) -> None:
        node = graph.add(fail_on(bad=2), name="inner")
        graph.connect(self.items.inner, node.value)
        graph.connect(node.out, self.out.inner)


class FailsAll(hfg.Subgraph):
    """The same for each of each."""

    items = hfg.Input(list[int])
    out = hfg.Output(list[int])
    iterate_over = ("items",)

    def build(self, graph: hfg.Graph) -> None:
        box = graph.add(Fails(), name="box")
        graph.connect(self.items.inner, box.ports.inputs["items"])
        graph.connect(box.ports.outputs["out"], self.out.inner)


@pytest.mark.rule("G3", "G4", "X1")
def test_an_error_inside_names_the_element_and_those_around_it() -> None:
    graph, _ = graph_of(FailsAll(), [[1], [3, 1, 2]])
    with pytest.raises(
        NodeError,
        match='node "each/box/inner" failed in firing 4, on element 3 of "each/box", in element 2 of "each"',
    ):
        hfg.run(graph, clock="virtual")


@pytest.mark.rule("G4", "X1")
def test_what_is_no_collection_is_an_error_of_the_firing() -> None:
    graph, _ = graph_of(Each(), 5)
    with pytest.raises(NodeError, match=r'node "each" failed in firing 1: TypeError: .*int.* is not iterable'):
        hfg.run(graph, clock="virtual")


@pytest.mark.rule("G4", "R4")
def test_a_node_that_comes_inside_takes_part_from_the_next_firing_on() -> None:
    graph, sink = graph_of(Each())

    async def body(run: hfg.Run) -> None:
        point = run.break_at("each/second")
        assert await run.wait_paused() == "each/second"
        point.remove()
        editing = asyncio.create_task(
            run.edit(
                c.Add("hfg.testing.nodes:double", "each/third"),
                c.Disconnect("each/second.out", "each.out.inner"),
                c.Connect("each/second.out", "each/third.value"),
                c.Connect("each/third.out", "each.out.inner"),
            )
        )
        await asyncio.sleep(0.01)
        run.resume()
        await editing
        await run.wait_finished()

    edited(graph, body)
    assert sink.values == [[2, 4, 6]]
    graph.undo()
    assert [edge.label for edge in graph["each"].graph.edges] == [
        "each.items.inner -> each/first.value",
        "each/first.out -> each/second.value",
        "each/second.out -> each.out.inner",
    ]


@pytest.mark.rule("G4", "R4")
def test_what_iterates_may_come_go_and_be_renamed_while_the_graph_runs() -> None:
    graph, sink = graph_of(Each(), [1, 2], [3])
    name = f"{Each.__module__}:Each"

    async def body(run: hfg.Run) -> None:
        point = run.break_at("each/first")
        await run.wait_paused()
        editing = asyncio.create_task(run.edit(c.Rename("each", "every"), c.Rename("every/first", "begin")))
        await asyncio.sleep(0.01)
        assert not editing.done()  # its firing is not over
        point.remove()
        run.resume()
        await editing
        await run.edit(c.Add(name, "more"), c.Connect("source.out", "more.items"))
        await run.edit(c.Remove("more"))
        await run.wait_finished()

    trace = edited(graph, body)
    assert sink.values == [[1, 2], [3]]
    fired = [event.node for event in trace if isinstance(event, FiringStarted) and event.kind == "process"]
    assert "each/first" in fired
    assert "each/begin" not in fired


def test_a_gate_does_not_reach_over_the_border_by_a_command() -> None:
    graph, _ = graph_of(Each())
    with pytest.raises(
        GraphError, match='"each/first" and "source" are on different sides of the boundary of a subgraph'
    ):
        graph.edit(c.Gate("each/first", "source"))
    graph.edit(c.Gate("each/first", "each/second"))
    assert graph.check() == [] or all(problem.check != "gate-border" for problem in graph.check())
