"""Virtual time, the trace, and what runs see of one another (rules R5-R7)."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import AsyncIterator
from typing import Any

import pytest

import hfg
from hfg.trace import (
    ActivityChanged,
    CallEnded,
    CallStarted,
    EventTriggered,
    FiringEnded,
    FiringStarted,
    NodeEnded,
    RunEnded,
    RunStarted,
    TokenProcessed,
    TokenSent,
    TokenTaken,
    TraceEvent,
)
from tests.limits import patience
from tests.semantics.nodes import (
    Clock,
    Countdown,
    Ear,
    Keep,
    KeepTokens,
    Where,
    drive,
    forward,
    numbers,
    of_kind,
    run,
    slow_numbers,
    traced,
)

# --- R6 ---


class Looking(hfg.Node):
    """Looks at its own activity, when it may."""

    begun = threading.Event()
    may_look = threading.Event()
    seen = hfg.State[list[bool]](factory=list)

    def process(self, value: int) -> None:
        self.begun.set()
        self.may_look.wait(patience(10.0))
        self.seen.append(self.active)


@pytest.mark.rule("R6", "A14")
@pytest.mark.parametrize(("loop", "seen"), [(hfg.VirtualTimeLoop, [True, False]), (None, [False, False])])
def test_in_virtual_time_code_in_a_thread_sees_the_activity_with_which_it_began(loop: Any, seen: list[bool]) -> None:
    Looking.begun.clear()
    Looking.may_look.clear()
    graph = hfg.Graph()
    graph.group("work", threads=1)
    numbers, node = graph.input("numbers", int), graph.add(Looking(), group="work")
    graph.connect(numbers, node.ports.inputs["value"])

    async def main() -> list[bool]:
        async with hfg.running(graph) as run, run.feed(numbers) as feed:
            await run.trigger(node.activate)
            await run.wait_quiet()
            sending = asyncio.ensure_future(feed.send(1))
            while not Looking.begun.is_set():
                await asyncio.sleep(0)
            run.reset_activity()
            Looking.may_look.set()
            await sending
            await feed.send(2)
            return node.seen

    with asyncio.Runner(loop_factory=loop) as runner:
        assert runner.run(main()) == seen


@pytest.mark.rule("R6")
def test_an_hour_of_virtual_time_passes_at_once_to_the_second(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(slow_numbers(count=60, pause_s=60)), graph.add(KeepTokens())
    graph.connect(source.out, sink.value)
    report = run(graph, fast)
    assert report.duration_s == 3600
    assert [token.stamp for token in sink.tokens] == [60 * number for number in range(60)]


@pytest.mark.rule("R6")
def test_each_run_has_the_same_values_and_stamps() -> None:
    def once() -> list[str]:
        graph = hfg.Graph()
        source, clock = graph.add(slow_numbers(count=5, pause_s=0.7)), graph.add(Clock(), max_rate_hz=3)
        node, sink, ear = graph.add(forward(), max_rate_hz=2), graph.add(Keep()), graph.add(Ear())
        graph.connect(source.out, node.value)
        graph.connect(node.out, sink.value)
        graph.connect(clock.ticked, ear.hear)
        return [str(event) for event in traced(graph, until_s=3)]

    assert once() == once()


class Works(hfg.Node):
    """Takes real time in a thread."""

    value = hfg.Input(int)
    times = hfg.State(factory=list)

    def process(self, value: int) -> None:
        time.sleep(0.02)
        self.times.append(hfg.now())


@pytest.mark.rule("R6")
def test_time_stands_still_while_a_thread_works() -> None:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    source, clock = graph.add(numbers(count=3)), graph.add(Clock(), max_rate_hz=1000)
    node, sink = graph.add(Works(), group="work"), graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(clock.out, sink.value)
    run(graph, until_s=0.01)
    assert node.times == [0, 0, 0]


@pytest.mark.rule("R6")
def test_the_time_of_a_node_is_that_of_the_run(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(slow_numbers(count=2, pause_s=5)), graph.add(Asks())
    graph.connect(source.out, node.value)
    run(graph, fast)
    assert node.times == [5, 10]
    assert hfg.now() > 1e9  # outside a run: the real clock


class Asks(hfg.Node):
    value = hfg.Input(int)
    times = hfg.State(factory=list)

    def process(self, value: int) -> None:
        self.times.append(hfg.now())


@pytest.mark.rule("R6")
def test_the_time_behind_a_thread_is_that_of_the_run() -> None:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    source, thread, node = graph.add(slow_numbers(count=2, pause_s=5)), graph.add(forward(), group="work"), Asks()
    graph.connect(source.out, thread.value)
    graph.connect(thread.out, graph.add(node).value)
    run(graph)
    assert node.times == [5, 10]


@hfg.node
def endless() -> int:
    """A source without rate or end."""
    return 1


class JoinsAndEnds(hfg.Node):
    """Has something to do at its end, in a thread."""

    a = hfg.Input(int)
    b = hfg.Input(int)

    def process(self, a: int, b: int) -> None:
        pass

    def end(self) -> None:
        pass


@hfg.node
async def restless() -> AsyncIterator[int]:
    """A source that never ends, one pass of the loop after the other."""
    while True:
        yield 1
        await asyncio.sleep(0)


@pytest.mark.rule("R6", "R5", "R1", "F12")
@pytest.mark.parametrize("never_ends", [endless, restless])
def test_in_virtual_time_a_thread_comes_back_while_the_loop_never_rests(never_ends: Any) -> None:
    def once() -> int:
        graph = hfg.Graph()
        graph.group("work", threads=1)
        source, node = graph.add(never_ends(), name="source"), graph.add(JoinsAndEnds(), group="work")
        graph.connect(source.out, node.a)
        graph.connect(graph.add(numbers()).out, node.b)
        report = run(graph)
        assert report.outcome == "done"
        return report.nodes["source"].firings

    assert once() == once()  # how much it drained meanwhile is no matter of luck


@pytest.mark.rule("R6", "F2")
def test_until_with_a_source_that_never_lets_time_pass_is_refused() -> None:
    graph = hfg.Graph()
    graph.connect(graph.add(endless()).out, graph.add(Keep()).value)
    with pytest.raises(hfg.errors.GraphError, match=r'source "endless" has no rate, waits for nothing and never ends'):
        run(graph, until_s=5)


@pytest.mark.rule("R6")
def test_on_the_real_clock_stamps_are_unix_time() -> None:
    graph = hfg.Graph()
    source, sink = graph.add(Countdown(count=1)), graph.add(KeepTokens())
    graph.connect(source.out, sink.value)
    before = time.time()
    hfg.run(graph)
    assert before - 1 < sink.tokens[0].stamp < time.time() + 1


# --- R7 ---


@pytest.mark.rule("R7")
def test_the_trace_tells_everything_of_a_small_run_in_order() -> None:
    graph = hfg.Graph()
    source, node = graph.add(Countdown(count=1)), graph.add(Ear())
    graph.connect(source.out, node.hear)
    graph.start.activates(node.begin)
    kinds = [type(event) for event in traced(graph)]
    assert kinds == [
        RunStarted,
        EventTriggered,
        TokenSent,
        CallStarted,
        TokenTaken,
        ActivityChanged,
        CallEnded,
        FiringStarted,
        TokenSent,
        FiringEnded,
        CallStarted,
        TokenTaken,
        EventTriggered,
        CallEnded,
        TokenProcessed,
        FiringStarted,
        *kinds[16:],
    ]
    assert kinds[-1] is RunEnded
    assert NodeEnded in kinds


@pytest.mark.rule("R7")
def test_a_consumer_may_come_and_go_while_the_graph_runs(fast: bool) -> None:
    async def main() -> tuple[list[Any], list[Any]]:
        graph = hfg.Graph()
        node, sink = graph.add(forward()), graph.add(Keep())
        graph.connect(graph.input("in", int), node.value)
        graph.connect(node.out, sink.value)
        trace: list[TraceEvent] = []
        async with hfg.running(graph, fast=fast) as run, run.feed("in") as feed:
            await feed.send(1)
            remove = run.trace(trace.append)
            await feed.send(2)
            remove()
            await feed.send(3)
        taken = [event.token.value for event in of_kind(trace, TokenTaken)]
        return sink.values, taken

    assert drive(main) == ([1, 2, 3], [2, 2])


@pytest.mark.rule("R7")
def test_outcomes_do_not_depend_on_whether_somebody_looks(fast: bool) -> None:
    def once(trace: list[TraceEvent] | None) -> Any:
        graph = hfg.Graph()
        source, node, ear = graph.add(numbers(count=5)), graph.add(forward()), graph.add(Ear())
        sink = graph.add(Keep())
        graph.connect(source.out, node.value)
        graph.connect(node.out, sink.value)
        graph.connect(node.processed, ear.hear)
        report = run(graph, fast, trace=None if trace is None else trace.append)
        return sink.values, ear.heard, report.nodes, report.edges

    assert once(None) == once([])


# --- runs of one graph, and what they leave ---


@pytest.mark.rule("R5")
def test_each_run_starts_fresh(fast: bool) -> None:
    graph = hfg.Graph()
    source, node, sink = graph.add(numbers(count=3)), graph.add(Ear()), graph.add(Keep())
    graph.connect(source.out, node.hear)
    graph.connect(node.passed, sink.value)
    for _ in range(3):
        report = run(graph, fast)
        assert sink.values == [1, 2, 3]
        assert report.nodes["ear"].calls == 3


@pytest.mark.rule("R5", "R1")
def test_two_graphs_run_side_by_side_on_one_loop(fast: bool) -> None:
    async def main() -> list[list[object]]:
        graphs = []
        for count in (3, 5):
            graph = hfg.Graph()
            graph.connect(graph.add(slow_numbers(count=count)).out, graph.add(Keep()).value)
            graphs.append(graph)
        await asyncio.gather(*(hfg.run_async(graph, fast=fast) for graph in graphs))
        return [graph["keep"].values for graph in graphs]

    assert drive(main) == [[1, 2, 3], [1, 2, 3, 4, 5]]


@pytest.mark.rule("R5")
def test_a_run_leaves_no_thread_and_no_task(fast: bool) -> None:
    async def main() -> int:
        graph = hfg.Graph()
        graph.group("work", threads=1)
        source, node = graph.add(slow_numbers(count=3)), graph.add(Where(), group="work")
        graph.connect(source.out, node.value)
        await hfg.run_async(graph, fast=fast)
        await asyncio.sleep(0)
        return len(asyncio.all_tasks())

    assert drive(main) == 1
    assert [thread.name for thread in threading.enumerate() if thread.name.startswith("hfg group")] == []
