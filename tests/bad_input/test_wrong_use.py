"""Calls at the wrong moment or with the wrong thing: one sentence with the path and the remedy.

And nothing has happened.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

import hfg
from tests.semantics.nodes import Clock, Ear, Keep, Ringing, Send, drive, forward, numbers, run

# --- one run at a time ---


def test_a_second_run_of_a_running_graph_is_refused_and_the_first_goes_on(fast: bool) -> None:
    async def main() -> list[object]:
        graph = hfg.Graph("busy")
        sink = graph.add(Keep())
        graph.connect(graph.input("in", int), sink.value)
        async with hfg.running(graph, fast=fast) as run:
            with pytest.raises(hfg.errors.UsageError, match='graph "busy" runs already: .* build a second graph'):
                await hfg.run_async(graph)
            with pytest.raises(hfg.errors.UsageError, match="runs already"):
                async with hfg.running(graph):
                    pass
            async with run.feed("in") as feed:
                await feed.send(1)
            await run.wait_finished()
        return sink.values

    assert drive(main) == [1]


@pytest.mark.parametrize("inside", [False, True])
def test_a_graph_that_runs_is_not_edited_and_goes_on(inside: bool, fast: bool) -> None:
    class Box(hfg.Subgraph):
        value = hfg.Input(int)
        level = hfg.Parameter(1)

        def build(self, graph: hfg.Graph) -> None:
            graph.connect(self.value.inner, graph.add(Keep()).value)

    async def main() -> None:
        root = hfg.Graph("busy")
        box, ear, outside = root.add(Box()), root.add(Ear()), Ear()
        root.connect(root.input("in", int), box.value)
        graph = box.graph if inside else root
        edits: dict[str, Callable[[], object]] = {
            "adding a node": lambda: graph.add(outside),
            "connecting": lambda: graph.connect(ear.passed, ear.hear),
            "declaring a group": lambda: graph.group("late"),
            "gating": lambda: graph.gate(box, by=ear),
            "promoting a parameter": lambda: graph.promote(box.level, box.level),
            "declaring a port": lambda: graph.input("late", int),
        }
        if not inside:
            edits["connecting "] = lambda: ear.passed >> ear.hear
            edits[" connecting"] = lambda: ear.passed.activates(ear.hear)
            edits["declaring a port "] = lambda: graph.output("late", int)
        async with hfg.running(root, fast=fast) as run:
            title = 'the graph inside "box"' if inside else 'graph "busy"'
            for doing, edit in edits.items():
                with pytest.raises(hfg.errors.UsageError) as refused:
                    edit()
                assert str(refused.value) == (
                    f"{title} runs, so {doing.strip()} by hand is refused: use commands, which the run follows, as in "
                    "await run.edit(hfg.commands.Connect(...)), or stop the run first"
                )
            ear.activated.subscribe(print)  # automatic ports are made when they are asked for, also now
            await run.trigger(ear.disable)
            async with run.feed("in") as feed:
                await feed.send(1)
            await run.wait_finished()
        assert outside not in graph.nodes.values()
        assert graph["keep" if inside else "box/keep"].values == [1]
        graph.add(outside)

    drive(main)


def test_a_graph_that_failed_may_run_again(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=2)), graph.add(FailsFirst())
    graph.connect(source.out, node.value)
    FailsFirst.times = 0
    with pytest.raises(hfg.errors.NodeError):
        run(graph, fast)
    assert run(graph, fast).outcome == "done"
    assert node.values == [1, 2]


class FailsFirst(hfg.Node):
    """Fails the first time of all."""

    times = 0
    value = hfg.Input(int)
    values = hfg.State(factory=list)

    def process(self, value: int) -> None:
        FailsFirst.times += 1
        if FailsFirst.times == 1:
            raise ValueError("first")
        self.values.append(value)


def test_run_inside_a_running_loop_says_what_to_write() -> None:
    async def main() -> None:
        with pytest.raises(hfg.errors.UsageError, match=r"write `report = await hfg.run_async\(graph\)`"):
            hfg.run(hfg.Graph())

    drive(main)


def test_a_virtual_clock_on_a_real_loop_says_what_to_write() -> None:
    async def main() -> None:
        with pytest.raises(hfg.errors.UsageError, match="loop_factory=hfg.VirtualTimeLoop"):
            await hfg.run_async(hfg.Graph(), clock="virtual")

    asyncio.run(main())


def test_what_is_no_graph_cannot_run() -> None:
    with pytest.raises(hfg.errors.UsageError, match="a Graph can run, not list"):
        hfg.run([])  # type: ignore[arg-type]


def test_the_inside_of_a_subgraph_does_not_run_alone() -> None:
    class Box(hfg.Subgraph):
        def build(self, graph: hfg.Graph) -> None:
            graph.add(numbers()) >> graph.add(Keep())

    inside = hfg.Graph("whole").add(Box()).graph
    with pytest.raises(hfg.errors.UsageError, match=r'^the graph inside "box" runs as .*: run graph "whole"$'):
        run(inside)


def test_an_unknown_policy_is_refused_before_anything_is_set_up() -> None:
    graph = hfg.Graph()
    ear = graph.add(SetsUp())
    with pytest.raises(hfg.errors.UsageError, match='policy "lifo": there are .*fifo.*priority.*random'):
        run(graph, policy="lifo")
    assert not hasattr(ear, "was_set_up")
    assert run(graph).outcome == "done"


class SetsUp(hfg.Node):
    def setup(self) -> None:
        self.was_set_up = True


# --- ports outside a run ---


def test_ports_outside_a_run_say_so(fast: bool) -> None:
    graph = hfg.Graph()
    source, send = graph.add(numbers(count=1)), graph.add(Send())
    graph.connect(source.out, send.value)
    for _ in range(2):  # before and after a run
        with pytest.raises(hfg.errors.NotRunning, match='"send.rang" cannot trigger outside a run'):
            send.rang.trigger(1)
        with pytest.raises(hfg.errors.NotRunning, match='"send.out" cannot send outside a run'):
            send.out.send(1)
        run(graph, fast)


def test_awaiting_an_event_names_the_remedy() -> None:
    async def main() -> None:
        ear = hfg.Graph().add(Ear())
        with pytest.raises(TypeError, match=r'"ear.passed" cannot be awaited: write `await run.wait_for\(event\)`'):
            await ear.passed

    drive(main)


# --- feeds, readers, triggers ---


def test_feeding_a_run_that_is_over_or_a_feed_that_is_closed_says_so(fast: bool) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        graph.connect(graph.input("in", int), graph.add(Keep()).value)
        async with hfg.running(graph, fast=fast) as run:
            feed = run.feed("in")
            with pytest.raises(hfg.errors.NotRunning, match='the feed of "in" is closed: use it inside "async with'):
                await feed.send(1)
            async with feed:
                await feed.send(1)
            with pytest.raises(hfg.errors.NotRunning, match="is closed"):
                await feed.send(2)
            with pytest.raises(hfg.errors.UsageError, match='graph input "in" has ended: .* end=False'):
                async with run.feed("in"):
                    pass
            await run.wait_finished()
            with pytest.raises(hfg.errors.NotRunning, match="the run is over"):
                async with run.feed("in"):
                    pass

    drive(main)


def test_a_feed_that_waits_when_the_run_is_stopped_hears_of_it(fast: bool) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        graph.connect(graph.input("in", int), graph.add(Never()).value)
        async with hfg.running(graph, fast=fast) as run, run.feed("in") as feed:
            sending = asyncio.create_task(feed.send(1))
            await asyncio.sleep(1)
            run.stop()
            with pytest.raises(hfg.errors.NotRunning, match="the run is over"):
                await sending

    drive(main)


class Never(hfg.Node):
    """Never ready."""

    value = hfg.Input(int)

    def ready(self) -> bool:
        return False

    def process(self, value: int) -> None:
        pass


def test_a_feed_of_the_wrong_type_is_refused_and_changes_nothing(fast: bool) -> None:
    async def main() -> list[object]:
        graph = hfg.Graph()
        sink = graph.add(Keep())
        graph.connect(graph.input("in", int), sink.value)
        async with hfg.running(graph, fast=fast) as run:
            async with run.feed("in") as feed:
                with pytest.raises(TypeError, match="graph input \"in\" expects int, got str: 'one'"):
                    await feed.send("one")
                await feed.send(2)
            await run.wait_finished()
        return sink.values

    assert drive(main) == [2]


def test_a_modifier_or_stamp_that_is_none_is_refused(fast: bool) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        ear = graph.add(Ear())
        async with hfg.running(graph, fast=fast) as run:
            with pytest.raises(hfg.errors.UsageError, match=r"activity must be -1, 0 or \+1, or None .* got 5"):
                await run.trigger(ear.hear, 1, activity=5)
            with pytest.raises(hfg.errors.UsageError, match="stamp must be seconds on the run's clock, .* got 'now'"):
                await run.trigger(ear.hear, 1, stamp="now")  # type: ignore[call-overload]
        assert ear.heard == []

    drive(main)


def test_unknown_and_unconnected_ports_of_the_graph_are_named() -> None:
    async def main() -> None:
        graph = hfg.Graph("box")
        graph.input("in", int)
        graph.output("out", int)
        async with hfg.running(graph) as run:
            with pytest.raises(hfg.errors.UsageError, match='"inn" .*"in"'):
                run.feed("inn")
            with pytest.raises(hfg.errors.UsageError, match='graph input "in" is not connected'):
                run.feed("in")
            with pytest.raises(hfg.errors.UsageError, match='graph output "out" is not connected'):
                run.read("out")

    drive(main)


def test_a_node_of_another_graph_is_refused(fast: bool) -> None:
    async def main() -> None:
        stranger = hfg.Graph().add(Ear())
        graph = hfg.Graph()
        graph.add(Ear())
        async with hfg.running(graph, fast=fast) as run:
            for call in (run.trigger(stranger.begin), run.wait_for(stranger.passed), run.wait_inputs(stranger)):
                with pytest.raises(hfg.errors.UsageError, match="is no node of this run"):
                    await call
            with pytest.raises(hfg.errors.UsageError, match="is no node of this run"):
                run.wake(stranger)

    drive(main)


def test_waiting_for_start_in_a_run_says_that_it_is_over(fast: bool) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        graph.connect(graph.start, graph.add(Ear()).poke)
        async with hfg.running(graph, fast=fast) as run:
            with pytest.raises(hfg.errors.UsageError, match='^"start" was triggered as the run began, .* leave the'):
                await run.wait_for(graph.start)

    drive(main)


def test_waiting_for_an_event_that_never_comes_ends_with_the_run(fast: bool) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        ear = graph.add(Ear())
        async with hfg.running(graph, fast=fast) as run:
            waiting = asyncio.create_task(run.wait_for(ear.passed))
            await asyncio.sleep(1)
            run.stop()
            with pytest.raises(hfg.errors.NotRunning, match='the run ended before "ear.passed" was triggered'):
                await waiting

    drive(main)


def test_a_parameter_out_of_its_limits_is_refused_from_outside() -> None:
    from tests.semantics.nodes import scale

    async def main() -> None:
        graph = hfg.Graph()
        node = graph.add(scale(factor=3))
        async with hfg.running(graph) as run:
            with pytest.raises(ValueError, match=r'parameter "scale.factor" must be of type int, got 1.5'):
                run.set(node.ports.parameters["factor"], 1.5)
        assert node.factor == 3

    drive(main)


def test_a_parameter_out_of_its_limits_by_a_token_is_an_error_of_the_node(fast: bool) -> None:
    from annotated_types import Le

    class Limited(hfg.Node):
        level = hfg.Parameter(1, Le(2))

        def process(self, value: int) -> None:
            pass

    graph = hfg.Graph()
    source, node = graph.add(numbers(count=3)), graph.add(Limited())
    graph.connect(source.out, node.ports.parameters["level"])
    graph.connect(source.out, node.ports.inputs["value"])
    with pytest.raises(hfg.errors.NodeError, match=r'node "limited" failed in firing 3: .* must be <= 2, got 3'):
        run(graph, fast)


# --- leaving early ---


def test_leaving_running_early_stops_the_run_well(fast: bool) -> None:
    async def main() -> str:
        graph = hfg.Graph()
        source, sink = graph.add(Clock(), max_rate_hz=1), graph.add(Keep())
        graph.connect(source.out, sink.value)
        async with hfg.running(graph, fast=fast) as run:
            await asyncio.sleep(2.5)
        assert sink.values == [1, 2, 3]
        return run.report().outcome

    assert drive(main) == "stopped"


def test_an_exception_in_the_block_comes_out_and_the_run_is_torn_down(fast: bool) -> None:
    story: list[str] = []

    class Life(hfg.Node):
        def teardown(self) -> None:
            story.append("down")

    async def main() -> None:
        graph = hfg.Graph()
        graph.add(Life())
        async with hfg.running(graph, fast=fast):
            raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        drive(main)
    assert story == ["down"]


def test_a_failure_of_the_run_interrupts_what_the_block_waits_for(fast: bool) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        source, node = graph.add(Clock(), max_rate_hz=1), graph.add(FailsOn3())
        graph.connect(source.out, node.value)
        async with hfg.running(graph, fast=fast):
            await asyncio.sleep(1000)
            raise AssertionError("not reached")

    with pytest.raises(hfg.errors.NodeError, match='node "fails_on3" failed in firing 3'):
        drive(main)


class FailsOn3(hfg.Node):
    value = hfg.Input(int)

    def process(self, value: int) -> None:
        if value == 3:
            raise ValueError("3")


def test_a_failure_while_the_block_waits_for_the_end_comes_out_there_and_can_be_caught(fast: bool) -> None:
    async def main() -> str:
        graph = hfg.Graph()
        source, node = graph.add(Clock(), max_rate_hz=1), graph.add(FailsOn3())
        graph.connect(source.out, node.value)
        with pytest.raises(hfg.errors.NodeError):
            async with hfg.running(graph, fast=fast) as run:
                await run.wait_finished()
        await asyncio.sleep(0)  # nobody is left cancelled
        return "on"

    assert drive(main) == "on"


def test_cancelling_run_async_tears_down_and_lets_the_cancellation_out(fast: bool) -> None:
    story: list[Any] = []

    class Life(hfg.Node):
        async def teardown(self) -> None:
            await asyncio.sleep(0.1)
            story.append(hfg.now())

    async def main() -> None:
        graph = hfg.Graph()
        graph.add(Life())
        task = asyncio.create_task(hfg.run_async(graph, allow_idle=True, fast=fast))
        await asyncio.sleep(5)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert (await hfg.run_async(graph, fast=fast)).outcome == "done"

    drive(main)
    assert story == [5.1, pytest.approx(5.2)]


def test_cancelling_in_the_middle_of_the_teardown_comes_to_its_end_first(fast: bool) -> None:
    story: list[str] = []

    class Life(hfg.Node):
        mark = hfg.Parameter("")

        async def teardown(self) -> None:
            await asyncio.sleep(0.3)
            story.append(self.mark)

    async def main() -> None:
        graph = hfg.Graph()
        for mark in "abc":
            graph.add(Life(mark=mark), name=mark)
        task = asyncio.create_task(hfg.run_async(graph, fast=fast))
        await asyncio.sleep(0.1)
        task.cancel()
        await asyncio.sleep(0.1)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    drive(main)
    assert story == ["c", "b", "a"]


def test_a_time_limit_around_a_run_ends_it(fast: bool) -> None:
    async def main() -> str:
        graph = hfg.Graph()
        graph.connect(graph.add(Clock(), max_rate_hz=1).out, graph.add(forward()).value)
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(10):
                await hfg.run_async(graph, fast=fast)
        return "on"

    assert drive(main) == "on"


def test_a_loop_stopped_by_a_signal_into_a_full_queue_does_not_hang_who_waits_outside(fast: bool) -> None:
    async def main() -> None:
        graph = hfg.Graph()
        ear, slow = graph.add(Ear()), graph.add(Never())
        graph.connect(ear.passed, slow.value, capacity=1)
        async with hfg.running(graph, fast=fast) as run:
            waiting = asyncio.create_task(run.trigger(ear.passed, 1))
            await asyncio.sleep(1)
            run.stop()
            await waiting

    drive(main)


_ = Ringing
