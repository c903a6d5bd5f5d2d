"""Consumers of the trace: quick ones are called at once, slow ones have a buffer and lose what is theirs (R7)."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
from collections import deque
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

import pytest

import hfg
from hfg.testing import Recorder
from hfg.testing.nodes import Relay, double, script, sink
from hfg.trace import FiringEnded, FiringStarted, RunEnded, RunStarted, TokenSent, TraceEvent
from tests.limits import patience

T = TypeVar("T")


def drive(main: Callable[[], Coroutine[Any, Any, T]]) -> T:
    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        return runner.run(main())


def chain(count: int = 3) -> hfg.Graph:
    graph = hfg.Graph("chain")
    source = graph.add(script(values=tuple(range(count))))
    node, end = graph.add(double()), graph.add(sink())
    graph.connect(source.out, node.ports.inputs["value"])
    graph.connect(node.out, end.ports.inputs["value"])
    return graph


@hfg.node
def every_third(value: int) -> int | None:
    """Be silent about most."""
    return value if value % 3 == 0 else None


class Asking(hfg.Node):
    """A class with one input and output, which triggers as well."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    odd = hfg.Event(int)

    def process(self, value: int) -> int:
        """Trigger for some."""
        if value % 2:
            self.odd.trigger(value)
        return value


@hfg.node
def faulty(value: int) -> int:
    """Fail for one value."""
    if value == 6:
        raise ValueError("six")
    return value


def mixed(release: Any) -> hfg.Graph:
    """All shapes that have short ways of their own while somebody looks."""
    graph = hfg.Graph("mixed")
    source = graph.add(script(values=(0, 1, None, 3, 4, 5, 6)))
    nodes = [graph.add(make(), release=release, on_error="skip") for make in (double, every_third, Asking, faulty)]
    port = source.out
    for node in nodes:
        graph.connect(port, node.ports.inputs["value"], active=node is nodes[-1])
        port = node.ports.outputs["out"]
    graph.connect(port, graph.add(sink()).ports.inputs["value"])
    relay = graph.add(Relay(), name="relay")
    graph.connect(nodes[2].ports.events["odd"], next(iter(relay.ports.slots.values())))
    graph.connect(graph.start, nodes[-1].ports.slots["activate"])
    return graph


@pytest.mark.rule("R7")
@pytest.mark.parametrize("release", ["auto", "pipelined", "sequential"])
def test_the_short_ways_tell_the_trace_what_the_general_way_tells(release: str) -> None:
    traces = []
    for fast in (True, False):
        seen: list[TraceEvent] = []
        hfg.run(mixed(release), clock="virtual", fast=fast, trace=seen)
        traces.append(seen)
    assert traces[0] == traces[1]
    assert {type(event).__name__ for event in traces[0]} >= {"ErrorRaised", "EventTriggered", "ActivityChanged"}


def test_a_list_is_a_consumer_and_a_function_sees_the_same() -> None:
    seen, kept, recorder = [], deque(maxlen=2), Recorder()
    hfg.run(chain(), clock="virtual", trace=seen)
    hfg.run(chain(), clock="virtual", trace=recorder)
    hfg.run(chain(), clock="virtual", trace=kept)
    called: list[TraceEvent] = []
    hfg.run(chain(), clock="virtual", trace=lambda event: called.append(event))
    assert seen == list(recorder) == called
    assert isinstance(seen[0], RunStarted)
    assert [type(event) for event in kept] == [type(event) for event in seen[-2:]]


def test_several_consumers_see_the_same_and_one_that_raises_does_not_disturb(caplog: pytest.LogCaptureFixture) -> None:
    async def main() -> tuple[list[TraceEvent], int, Any]:
        seen: list[TraceEvent] = []
        calls = 0

        def bad(event: TraceEvent) -> None:
            nonlocal calls
            calls += 1
            raise ValueError("mine")

        async with hfg.running(chain()) as run:
            listener = run.trace(bad)
            run.trace(seen)
            report = await run.wait_finished()
            assert report.outcome == "done"
            assert not listener.is_open
        return seen, calls, listener.error

    with caplog.at_level(logging.ERROR):
        seen, calls, error = drive(main)
    assert calls == 1
    assert isinstance(error, ValueError)
    assert isinstance(seen[-1], RunEnded)
    assert [record.getMessage() for record in caplog.records] == ["a consumer of the trace failed and was removed"]


def test_an_async_consumer_has_a_buffer_and_sees_all_if_it_keeps_up() -> None:
    async def main() -> tuple[list[TraceEvent], list[TraceEvent], int]:
        seen, slow = [], []

        async def consumer(event: TraceEvent) -> None:
            await asyncio.sleep(0)
            slow.append(event)

        async with hfg.running(chain()) as run:
            run.trace(seen)
            listener = run.trace(consumer)
            await run.wait_finished()
        return seen, slow, listener.lost

    seen, slow, lost = drive(main)
    assert slow == seen
    assert lost == 0


def test_a_slow_async_consumer_loses_its_oldest_events_counted_and_the_graph_does_not_wait() -> None:
    async def main() -> tuple[int, list[TraceEvent], int, float]:
        seen, slow = [], []

        async def consumer(event: TraceEvent) -> None:
            slow.append(event)
            await asyncio.sleep(0.3)

        async with hfg.running(chain(100)) as run:
            run.trace(seen)
            listener = run.trace(consumer, size=5)
            report = await run.wait_finished()
        return len(seen), slow, listener.lost, report.duration_s

    count, slow, lost, duration = drive(main)
    assert duration == 0.0  # in the time of the graph
    # one was under way when the others came; the newest five were kept, of which one second gives time for some
    assert isinstance(slow[0], FiringStarted)
    assert lost == count - 1 - 5
    assert 3 <= len(slow) <= 6


def test_a_consumer_that_blocks_has_a_thread_of_its_own() -> None:
    async def main() -> tuple[int, list[str], list[int], int]:
        threads: list[str] = []
        seen: list[TraceEvent] = []
        sent: list[int] = []
        may = threading.Event()

        def consumer(event: TraceEvent) -> None:
            may.wait(patience(10))
            threads.append(threading.current_thread().name)
            if isinstance(event, TokenSent):
                sent.append(event.token.sequence)

        async with hfg.running(chain(50)) as run:
            run.trace(seen)
            listener = run.trace(consumer, size=10)
            await run.wait_quiet()
            may.set()
            await run.wait_finished()
        return len(seen), threads, sent, listener.lost

    count, threads, sent, lost = drive(main)
    assert set(threads) == {"hfg consumer"}
    assert len(threads) + lost == count
    assert len(threads) <= 11
    assert sent == sorted(sent)


@pytest.mark.parametrize("in_thread", [False, True])
def test_a_consumer_behind_a_buffer_that_raises_is_removed_too(
    in_thread: bool, caplog: pytest.LogCaptureFixture
) -> None:
    async def main() -> Any:
        calls = 0

        def bad(event: TraceEvent) -> None:
            nonlocal calls
            calls += 1
            raise ValueError("mine")

        async def bad_too(event: TraceEvent) -> None:
            bad(event)

        async with hfg.running(chain()) as run:
            listener = run.trace(bad if in_thread else bad_too, size=100)
            report = await run.wait_finished()
        assert report.outcome == "done"
        assert calls == 1
        for _ in range(3):
            await asyncio.sleep(0)
        return listener

    with caplog.at_level(logging.ERROR):
        listener = drive(main)
    assert isinstance(listener.error, ValueError)
    assert len(caplog.records) == 1


def test_a_consumer_that_hangs_does_not_hold_the_end_of_the_run_for_long() -> None:
    async def main() -> tuple[str, float, bool]:
        async def consumer(event: TraceEvent) -> None:
            await asyncio.sleep(3600)

        loop = asyncio.get_running_loop()
        async with hfg.running(chain()) as run:
            listener = run.trace(consumer)
            report = await run.wait_finished()
        return report.outcome, loop.time(), listener.is_open

    assert drive(main) == ("done", 1.0, False)


def test_a_consumer_that_does_not_let_itself_be_cancelled_is_left(caplog: pytest.LogCaptureFixture) -> None:
    async def main() -> tuple[str, float]:
        gives_up = asyncio.Event()

        async def consumer(event: TraceEvent) -> None:
            while not gives_up.is_set():
                with contextlib.suppress(asyncio.CancelledError):
                    await asyncio.sleep(3600)

        loop = asyncio.get_running_loop()
        async with hfg.running(chain()) as run:
            run.trace(consumer)
            report = await run.wait_finished()
        gives_up.set()
        return report.outcome, loop.time()

    with caplog.at_level(logging.ERROR):
        assert drive(main) == ("done", 1.3)
    assert "was cancelled at the end of the run and did not end" in caplog.text


@pytest.mark.parametrize("how", ["plain", "async", "thread"])
def test_a_consumer_that_fails_with_no_ordinary_exception_is_removed(
    how: str, caplog: pytest.LogCaptureFixture
) -> None:
    async def main() -> Any:
        async def of_its_own(event: TraceEvent) -> None:
            task = asyncio.create_task(asyncio.sleep(1))
            task.cancel()
            await task

        def plain(event: TraceEvent) -> None:
            raise asyncio.CancelledError

        def leaves(event: TraceEvent) -> None:
            raise SystemExit(3)

        consumer: Any = {"plain": plain, "async": of_its_own, "thread": leaves}[how]
        async with hfg.running(chain()) as run:
            listener = run.trace(consumer, size=100 if how == "thread" else None)
            report = await run.wait_finished()
        assert report.outcome == "done"
        for _ in range(3):
            await asyncio.sleep(0)
        return listener

    with caplog.at_level(logging.ERROR):
        listener = drive(main)
    assert isinstance(listener.error, SystemExit if how == "thread" else asyncio.CancelledError)
    assert not listener.is_open
    assert len(caplog.records) == 1


def test_a_consumer_behind_a_buffer_that_is_removed_sees_nothing_more() -> None:
    async def main() -> list[TraceEvent]:
        seen: list[TraceEvent] = []

        async def consumer(event: TraceEvent) -> None:
            seen.append(event)

        async with hfg.running(chain()) as run:
            remove = run.trace(consumer)
            await asyncio.sleep(0)
            remove()
            before = len(seen)
            await run.wait_finished()
            assert len(seen) == before
        return seen

    assert not any(isinstance(event, FiringEnded) for event in drive(main)[-1:])


@pytest.mark.parametrize("consumer", [3, "print", {}, None])
def test_a_consumer_that_can_take_no_event_is_refused(consumer: Any) -> None:
    async def main() -> None:
        async with hfg.running(chain()) as run:
            run.trace(consumer)

    with pytest.raises(hfg.errors.UsageError, match="trace must be a function that takes each event of the run, or a"):
        drive(main)


@pytest.mark.parametrize("size", [0, -1, 1.5, "10"])
def test_a_buffer_without_a_place_is_refused(size: Any) -> None:
    async def main() -> None:
        async with hfg.running(chain()) as run:
            run.trace(print, size=size)

    with pytest.raises(hfg.errors.UsageError, match="size is how many events the consumer's buffer holds, 1 or more"):
        drive(main)
