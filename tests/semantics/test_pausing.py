"""Holding a run still: pause, steps, waves, breakpoints (rule R3), and the activity reset (A14)."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import random
from collections.abc import Awaitable, Callable, Iterator
from typing import Any

import pytest

import hfg
from hfg import commands
from hfg.testing import recorder, replay
from hfg.trace import FiringStarted, RunPaused, RunResumed
from tests.semantics.nodes import Both, Ear, Keep, Ringing, forward, forward_async, numbers
from tests.support.making import Allowed, random_plan


def live(graph: hfg.Graph, act: Callable[[Any], Awaitable[None]], **options: Any) -> hfg.Report:
    """Run a graph in virtual time while `act` handles the run, paused from the beginning; then let it end."""

    async def main() -> hfg.Report:
        async with hfg.running(graph, **options) as run:
            run.pause()
            await act(run)
            run.resume()
            return await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        return runner.run(main())


def chain(count: int = 3, middle: Any = forward) -> tuple[hfg.Graph, Any, Any, Any]:
    graph = hfg.Graph()
    source, node, sink = graph.add(numbers(count=count)), graph.add(middle()), graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    return graph, source, node, sink


@pytest.mark.rule("R3")
def test_nothing_starts_while_the_run_is_paused_and_all_of_it_goes_on_afterwards() -> None:
    graph, _, _, sink = chain()

    async def act(run: Any) -> None:
        assert run.paused
        await asyncio.sleep(10)
        await run.wait_quiet()  # nothing can start, so it is quiet; but it does not end by that
        assert run.statistics().firings == 0

    live(graph, act)
    assert sink.values == [1, 2, 3]


@pytest.mark.rule("R3")
def test_what_is_under_way_goes_on_to_its_end_in_a_pause() -> None:
    graph, _, node, sink = chain(middle=forward_async)

    async def act(run: Any) -> None:
        run.resume()
        await run.wait_inputs(node)
        run.pause()
        assert await run.wait_paused() == "pause"
        assert sink.values == []

    live(graph, act)
    assert sink.values == [1, 2, 3]


@pytest.mark.rule("R3")
@pytest.mark.parametrize("middle", [forward, forward_async])
def test_a_step_lets_one_node_fire_once_or_says_what_it_waits_for(middle: Any) -> None:
    graph, source, node, sink = chain(middle=middle)

    async def act(run: Any) -> None:
        assert (await run.step(node)).why_not == '"forward" waits for "value"'.replace("forward", node.place.path)
        assert (await run.step(source)).moved == (source.place.path,)
        assert (await run.step(source)).moved == ()  # its token is not processed
        assert (await run.step(node)).moved == (node.place.path,)
        assert sink.values == []
        assert (await run.step(sink.place.path)).moved == (sink.place.path,)
        assert sink.values == [1]

    live(graph, act)
    assert sink.values == [1, 2, 3]


@pytest.mark.rule("R3")
def test_a_step_is_one_slot_call_too() -> None:
    graph = hfg.Graph()
    ear = graph.add(Ear())
    graph.connect(graph.start, ear.hear)

    async def act(run: Any) -> None:
        assert (await run.step(ear)).moved == (ear.place.path,)
        assert not (await run.step(ear)).moved

    live(graph, act)


@pytest.mark.rule("R3")
@pytest.mark.parametrize("middle", [forward, forward_async])
def test_a_wave_lets_each_node_fire_at_most_once_with_those_that_become_enabled(middle: Any) -> None:
    graph, source, node, sink = chain(middle=middle)

    async def act(run: Any) -> None:
        for n in (1, 2, 3):
            step = await run.step()
            assert step.moved == (source.place.path, node.place.path, sink.place.path)
            assert sink.values == list(range(1, n + 1))

    live(graph, act)
    assert sink.values == [1, 2, 3]


@pytest.mark.rule("R3")
def test_a_wave_in_which_nothing_can_move_says_so() -> None:
    graph = hfg.Graph()
    graph.add(Keep())

    async def act(run: Any) -> None:
        step = await run.step()
        assert (step.moved, step.why_not) == ((), "no node can move")

    live(graph, act)


@pytest.mark.rule("R3", "F10")
def test_a_wave_takes_those_along_whose_tokens_were_dropped_before_it() -> None:
    graph, _, _, sink = chain()

    async def act(run: Any) -> None:
        await run.step("numbers")
        await run.step("forward")  # a token lies before the sink
        await run.edit(commands.Disable("forward"))  # and is dropped
        await run.edit(commands.Enable("forward"))
        assert (await run.step()).moved == ("numbers", "forward", "keep")

    live(graph, act)
    assert sink.values == [2, 3]


@pytest.mark.rule("R3", "F9")
def test_a_wave_calls_a_node_too_that_has_fired_and_could_fire_again() -> None:
    graph = hfg.Graph()
    source, node, calls = graph.add(numbers(count=9)), graph.add(Both(), release="pipelined"), graph.add(Ringing())
    graph.connect(source.out, node.value)
    graph.connect(calls.rang, node.call)

    async def act(run: Any) -> None:
        moved = (await run.step()).moved
        assert sorted(moved) == ["both", "both", "numbers", "ringing"]

    live(graph, act)


class Doubles(hfg.Subgraph):
    """Doubles each."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    iterate_over = ("value",)

    def build(self, graph: hfg.Graph) -> None:
        node = graph.add(forward())
        graph.connect(self.value.inner, node.value)
        graph.connect(node.out, self.out.inner)


class DoublesAll(hfg.Subgraph):
    """Doubles each of each."""

    value = hfg.Input(list[int])
    out = hfg.Output(list[int])
    iterate_over = ("value",)

    def build(self, graph: hfg.Graph) -> None:
        node = graph.add(Doubles())
        graph.connect(self.value.inner, node.ports.inputs["value"])
        graph.connect(node.ports.outputs["out"], self.out.inner)


@hfg.node
def threes() -> Iterator[list[int]]:
    """Lists of three."""
    while True:
        yield [1, 2, 3]


@hfg.node
def twos_in_ones() -> Iterator[list[list[int]]]:
    """Lists of lists."""
    while True:
        yield [[1, 2], [], [3]]


@pytest.mark.rule("R3", "G4")
def test_waves_go_through_what_iterates_element_by_element() -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(threes()).out, graph.add(Doubles()).ports.inputs["value"])

    async def act(run: Any) -> None:
        waves = [(await run.step()).moved for _ in range(4)]
        each = "doubles/forward"
        assert waves == [
            ("threes", "doubles", each),
            (each,),
            (each, "threes", "doubles"),
            (each,),
        ]
        run.stop()

    live(graph, act)


@pytest.mark.rule("R3", "G3", "G4")
def test_waves_and_steps_go_through_what_iterates_inside_of_what_iterates() -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(twos_in_ones()).out, graph.add(DoublesAll()).ports.inputs["value"])

    async def act(run: Any) -> None:
        inner, each = "doubles_all/doubles", "doubles_all/doubles/forward"
        waves = [(await run.step()).moved for _ in range(4)]
        assert waves == [
            ("twos_in_ones", "doubles_all", inner, each),
            (each, inner),  # the second list is empty
            (inner, each, "twos_in_ones", "doubles_all"),
            (inner, each),
        ]
        assert (await run.step(each)).moved == (each,)
        assert (await run.step(inner)).moved == (inner,)
        run.stop()

    live(graph, act)


@pytest.mark.rule("R3")
@pytest.mark.parametrize("seed", range(30))
def test_a_wave_leaves_nobody_out_who_could_move(seed: int) -> None:
    plan = random_plan(700_000 + seed, Allowed(rates=False))
    graph = plan.build()

    async def act(run: Any) -> None:
        for _ in range(12):
            moved = (await run.step()).moved
            for name, node in graph.nodes.items():
                if run.report().outcome != "running":
                    return
                if name not in moved and not isinstance(node, hfg.Subgraph):
                    assert not (await run.step(node)).moved, f"{name} was left out\n{plan}"

    with contextlib.suppress(hfg.errors.RunError):
        live(graph, act)


@pytest.mark.rule("R3", "R1")
def test_nodes_of_a_thread_group_step_and_rest_like_others() -> None:
    graph = hfg.Graph()
    graph.group("side", threads=1)
    source, node = graph.add(numbers(count=3)), graph.add(forward(), group="side")
    sink = graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)

    async def act(run: Any) -> None:
        await run.step(source)
        assert (await run.step(node)).moved == (node.place.path,)
        await run.step(sink)
        assert sink.values == [1]
        await run.step()
        assert sink.values == [1, 2]

    live(graph, act)
    assert sink.values == [1, 2, 3]


@pytest.mark.rule("R3")
@pytest.mark.parametrize("side", ["loop", "thread", "other"])
def test_a_breakpoint_at_a_node_pauses_before_each_of_its_firings(side: str) -> None:
    graph = hfg.Graph()
    if side != "loop":
        graph.group(side, threads=1 if side == "thread" else 0)
    source, node, sink = graph.add(numbers(count=3)), graph.add(forward(), group=side), graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    seen: list[list[int]] = []

    async def act(run: Any) -> None:
        point = run.break_at(node)
        assert run.break_at(node.place.path) is point
        for _ in range(2):
            run.resume()
            assert await run.wait_paused() == node.place.path
            seen.append(list(sink.values))
        await run.step(node)  # the breakpoint does not hold a step
        point.remove()
        point.remove()
        assert run.breakpoints == []
        assert point.hits == 2

    live(graph, act)
    assert seen == [[], [1]]
    assert sink.values == [1, 2, 3]


@pytest.mark.rule("R3")
@pytest.mark.parametrize("place", ["edge", "port", "path"])
def test_a_breakpoint_at_an_edge_pauses_where_its_condition_holds(place: str) -> None:
    graph, _, node, sink = chain(count=5)
    edge = graph.edges[1]
    where = {"edge": edge, "port": node.out, "path": f"{node.place.path}.out"}[place]

    async def act(run: Any) -> None:
        point = run.break_at(where, when=lambda token: token.value == 3)
        run.resume()
        await run.wait_paused()
        assert sink.values == [1, 2]
        assert point.token is not None
        assert (point.token.value, point.hits) == (3, 1)

    live(graph, act)
    assert sink.values == [1, 2, 3, 4, 5]


@pytest.mark.rule("R3")
def test_a_breakpoint_whose_condition_fails_is_logged_and_removed(caplog: pytest.LogCaptureFixture) -> None:
    graph, _, node, sink = chain()

    async def act(run: Any) -> None:
        run.break_at(node.out, when=lambda token: token.value.nothing)
        run.resume()
        await run.wait_quiet()
        assert run.breakpoints == []

    with caplog.at_level(logging.ERROR, logger="hfg.engine"):
        live(graph, act)
    assert "condition of the breakpoint" in caplog.text
    assert sink.values == [1, 2, 3]


@pytest.mark.rule("R3")
def test_what_cannot_be_done_is_one_sentence_and_the_run_goes_on() -> None:
    graph, source, node, sink = chain()

    async def act(run: Any) -> None:
        with pytest.raises(hfg.errors.UsageError, match="is no node of this run"):
            await run.step(Keep())
        with pytest.raises(hfg.errors.UsageError, match="when= takes a function of the token"):
            run.break_at(node.out, when=3)
        with pytest.raises(hfg.errors.UsageError, match="look at a token|looks at a token"):
            run.break_at(node, when=bool)
        run.resume()
        with pytest.raises(hfg.errors.UsageError, match=r"while the run is not paused: run\.pause\(\) first"):
            await run.step(source)
        run.pause()

    live(graph, act)
    assert sink.values == [1, 2, 3]


@pytest.mark.rule("R3")
def test_a_run_that_is_over_steps_no_more_and_nobody_waits_for_its_pause() -> None:
    graph, source, _, _ = chain()

    async def main() -> None:
        async with hfg.running(graph) as run:
            waiting = asyncio.ensure_future(run.wait_paused())
            await run.wait_finished()
            with pytest.raises(hfg.errors.UsageError, match="has ended"):
                await waiting
            with pytest.raises(hfg.errors.NotRunning, match="the run is over: there is nothing left to pause"):
                run.pause()
            with pytest.raises(hfg.errors.UsageError, match="has ended"):
                await run.step(source)

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())


@pytest.mark.rule("R3", "R5")
def test_a_paused_run_can_be_stopped() -> None:
    graph, _, _, sink = chain()

    async def main() -> hfg.Report:
        async with hfg.running(graph) as run:
            run.pause()
            run.stop()
            return await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        assert runner.run(main()).outcome == "stopped"
    assert sink.values == []


@pytest.mark.rule("R3")
def test_a_subgraph_makes_no_step_of_its_own() -> None:
    class Box(hfg.Subgraph):
        value = hfg.Input(int)

        def build(self, graph: hfg.Graph) -> None:
            graph.connect(self.value.inner, graph.add(Keep()).value)

    graph = hfg.Graph()
    box = graph.add(Box())
    graph.connect(graph.add(numbers(count=1)).out, box.value)

    async def act(run: Any) -> None:
        with pytest.raises(hfg.errors.UsageError, match="is a subgraph: step a node inside"):
            await run.step(box)

    live(graph, act)


@pytest.mark.rule("R3", "R7")
def test_pauses_are_in_the_trace() -> None:
    graph, _, _, _ = chain()
    trace = recorder()

    async def act(run: Any) -> None:
        await run.step()

    live(graph, act, trace=trace)
    moved = [type(event) for event in trace if isinstance(event, RunPaused | RunResumed | FiringStarted)]
    assert moved[:5] == [RunPaused, FiringStarted, FiringStarted, FiringStarted, RunResumed]


async def _handle(run: Any, graph: hfg.Graph, rng: random.Random) -> None:
    """Pause, step and resume as chance has it."""
    places = [*graph.nodes, None]
    for _ in range(30):
        if run.report().outcome != "running":
            return
        if rng.random() < 0.8:
            name = rng.choice(places)
            node = None if name is None else graph[name]
            if isinstance(node, hfg.Subgraph):
                continue
            await run.step(node)
        else:
            run.resume()
            await asyncio.sleep(0)
            run.pause()


@pytest.mark.slow
@pytest.mark.rule("R3", "F7")
@pytest.mark.parametrize("seed", range(40))
def test_steps_and_pauses_are_one_more_schedule_that_the_rules_permit(seed: int) -> None:
    plan = random_plan(900_000 + seed, Allowed(threads=seed % 8 == 0))
    graph, trace = plan.build(), recorder()

    async def main() -> None:
        async with hfg.running(graph, trace=trace) as run:
            run.pause()
            await _handle(run, graph, random.Random(seed))
            run.resume()
            await asyncio.wait_for(run.wait_finished(), timeout=10_000)

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner, contextlib.suppress(hfg.errors.RunError):
        runner.run(main())
    replay(plan, trace)
