"""Firings that take too long, and shutting down (rules X2, X3)."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Iterator
from typing import Any

import anyio
import pytest

import hfg
from hfg import NO_MESSAGE
from hfg.trace import FiringEnded
from tests.semantics.nodes import (
    Keep,
    KeepTokens,
    drive,
    fail_on,
    forward,
    numbers,
    of_kind,
    run,
    sent,
    slow_numbers,
    traced,
)

# --- X2 ---


@hfg.node
async def slow_on(value: int, *, bad: int = 2) -> int:
    """Waits for a hundred seconds for one value."""
    await asyncio.sleep(100 if value == bad else 1)
    return value


@pytest.mark.rule("X2")
def test_an_async_firing_over_its_time_is_cancelled(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(numbers(count=3)), graph.add(Keep())
    node = graph.add(slow_on(), max_duration_s=5, on_error="skip")
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    report = run(graph, fast)
    assert sink.values == [1, 3]
    assert report.duration_s == 7
    assert report.errors == [
        'node "slow_on" failed in firing 2: it took longer than max_duration_s = 5 s and was given up'
    ]


@pytest.mark.rule("X2", "X1")
def test_a_firing_over_its_time_is_a_firing_timeout(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=3)), graph.add(slow_on(), max_duration_s=5)
    graph.connect(source.out, node.value)
    with pytest.raises(hfg.errors.FiringTimeout, match='node "slow_on" failed in firing 2'):
        run(graph, fast)


class Stubborn(hfg.Node):
    """Catches its cancellation and goes on for a while; its late result must not be heard."""

    value = hfg.Input(int)
    out = hfg.Output(int)
    late = hfg.State(factory=list)

    async def process(self, value: int) -> int:
        if value == 2:
            try:
                await asyncio.sleep(100)
            except asyncio.CancelledError:
                await asyncio.sleep(3)
                self.late.append(hfg.now())
                return 99
        return value


@pytest.mark.rule("X2")
def test_the_late_result_of_a_firing_that_resists_is_ignored(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(slow_numbers(count=6)), graph.add(Keep())
    node = graph.add(Stubborn(), max_duration_s=2, on_error="skip")
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    run(graph, fast)
    assert sink.values == [1, 3, 4, 5, 6]


class Held(hfg.Node):
    """Blocks its thread at the second value until the test lets it go."""

    value = hfg.Input(int)
    out = hfg.Output(object)
    gate = threading.Event()

    def process(self, value: int) -> tuple[int, str]:
        if value == 2:
            self.gate.wait(5)
        return value, threading.current_thread().name


@pytest.mark.rule("X2")
def test_a_threaded_firing_over_its_time_is_abandoned_and_the_group_goes_on_in_a_new_thread() -> None:
    Held.gate.clear()
    graph = hfg.Graph()
    graph.group("work", threads=1)
    source, sink = graph.add(numbers(count=3)), graph.add(Keep())
    node = graph.add(Held(), group="work", max_duration_s=0.05, on_error="skip")
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    try:
        report = hfg.run(graph)
    finally:
        Held.gate.set()
    assert [value for value, _ in sink.values] == [1, 3]
    assert report.nodes["held"].failed == 1


@pytest.mark.rule("X2", "R7")
def test_a_firing_that_was_given_up_is_traced_as_abandoned() -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=2)), graph.add(slow_on(), max_duration_s=5, on_error="skip")
    graph.connect(source.out, node.value)
    trace = traced(graph)
    outcomes = [event.outcome for event in of_kind(trace, FiringEnded) if event.node == "slow_on"]
    assert outcomes == ["done", "abandoned", "ended"]


@pytest.mark.rule("X2", "X1")
def test_a_firing_that_was_given_up_answers_silence() -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=2)), graph.add(slow_on(), max_duration_s=5, on_error="skip")
    sink = graph.add(Keep())
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    assert sent(traced(graph), "slow_on.out -> keep.value") == [1, NO_MESSAGE, hfg.END]


# --- X3 ---


class Life(hfg.Node):
    """Writes down when it is set up and torn down."""

    mark = hfg.Parameter("")
    fails = hfg.Parameter("")
    story: list[str] = []  # noqa: RUF012 - of all

    async def setup(self) -> None:
        self.story.append(f"+{self.mark}")
        if self.fails == "setup":
            raise ValueError("setup")

    async def teardown(self) -> None:
        self.story.append(f"-{self.mark}")
        if self.fails == "teardown":
            raise ValueError(self.mark)
        if self.fails == "hang":
            await asyncio.sleep(1000)

    @hfg.slot
    def hear(self) -> None:
        pass


def lives(*fails: str) -> hfg.Graph:
    Life.story.clear()
    graph = hfg.Graph()
    for mark, kind in zip("abcd", fails, strict=False):
        graph.add(Life(mark=mark, fails=kind), name=mark)
    return graph


@pytest.mark.rule("X3")
def test_nodes_are_torn_down_in_reverse_order_of_their_setup(fast: bool) -> None:
    run(lives("", "", ""), fast)
    assert Life.story == ["+a", "+b", "+c", "-c", "-b", "-a"]


@pytest.mark.rule("X3", "X1")
def test_after_a_failing_setup_those_set_up_are_torn_down_and_no_source_has_fired(fast: bool) -> None:
    graph = lives("", "setup", "")
    source, sink = graph.add(numbers()), graph.add(Keep())
    graph.connect(source.out, sink.value)
    with pytest.raises(hfg.errors.NodeError, match=r'node "b" failed in setup\(\): ValueError: setup'):
        run(graph, fast)
    assert Life.story == ["+a", "+b", "-b", "-a"]
    assert getattr(sink, "values", []) == []


@pytest.mark.rule("X3")
def test_errors_of_teardown_are_collected(fast: bool) -> None:
    graph = lives("teardown", "", "teardown")
    with pytest.raises(hfg.errors.TeardownError) as raised:
        run(graph, fast)
    assert [error.path for error in raised.value.errors] == ["c", "a"]
    assert Life.story == ["+a", "+b", "+c", "-c", "-b", "-a"]


@pytest.mark.rule("X3")
def test_errors_of_teardown_do_not_hide_the_first_failure(fast: bool) -> None:
    graph = lives("teardown")
    source, node = graph.add(numbers(count=1)), graph.add(fail_on(bad=1))
    graph.connect(source.out, node.value)
    with pytest.raises(hfg.errors.NodeError, match="fail_on") as raised:
        run(graph, fast)
    assert any('"a" failed in teardown()' in one for one in raised.value.report.errors)  # type: ignore[attr-defined]


@pytest.mark.rule("X3")
def test_a_teardown_that_does_not_return_is_given_up(fast: bool) -> None:
    graph = lives("", "hang", "")
    with pytest.raises(hfg.errors.TeardownError, match=r'node "b" failed in teardown\(\): it took longer than 5 s'):
        run(graph, fast)
    assert Life.story == ["+a", "+b", "+c", "-c", "-b", "-a"]


class Unending(hfg.Node):
    """Waits for ever and says when it is cancelled."""

    story = hfg.State(factory=list)

    async def process(self) -> None:
        try:
            await asyncio.Event().wait()
        finally:
            self.story.append("cancelled")


class Lingers(hfg.Node):
    """Its teardown waits for ever, and when it is cancelled says so, or goes on waiting."""

    resists = hfg.Parameter(False)
    story: list[tuple[str, float]] = []  # noqa: RUF012 - of all

    async def teardown(self) -> None:
        try:
            await asyncio.Event().wait()
        finally:
            self.story.append((self.place.path, hfg.now()))
            if self.resists:
                await asyncio.Event().wait()

    @hfg.slot
    def hear(self) -> None:
        pass


@pytest.mark.rule("X3")
@pytest.mark.parametrize(("resists", "over"), [(False, 10.0), (True, 10.2)])
def test_a_teardown_is_cancelled_at_its_limit_and_not_waited_for_again(resists: bool, over: float) -> None:
    Lingers.story.clear()
    graph = hfg.Graph()
    for name in "ab":
        graph.add(Lingers(resists=resists), name=name)

    async def main() -> float:
        with pytest.raises(hfg.errors.TeardownError) as raised:
            await hfg.run_async(graph)
        assert [error.path for error in raised.value.errors] == ["b", "a"]
        return asyncio.get_running_loop().time()

    assert drive(main) == pytest.approx(over)  # who resists has 0.1 s more, and is cancelled once more at the end
    assert [path for path, _ in Lingers.story] == ["b", "a"]
    assert [when for _, when in Lingers.story] == pytest.approx([5.0, 10.1 if resists else 10.0])


class Slowly(Unending):
    """Takes half a second to be torn down."""

    async def teardown(self) -> None:
        await asyncio.sleep(0.5)
        self.story.append("torn down")


@pytest.mark.rule("X3", "R6")
@pytest.mark.parametrize("block", [anyio.move_on_after, asyncio.timeout])
def test_whoever_is_cancelled_around_a_run_waits_for_its_teardown(block: Any) -> None:
    graph = hfg.Graph()
    node = graph.add(Slowly())

    async def main() -> float:
        with contextlib.suppress(TimeoutError):
            async with contextlib.AsyncExitStack() as stack:
                if block is asyncio.timeout:
                    await stack.enter_async_context(block(1))
                else:
                    stack.enter_context(block(1))
                await hfg.run_async(graph)
        return asyncio.get_running_loop().time()

    assert drive(main) == 1.5
    assert node.story == ["cancelled", "torn down"]


class Driver(hfg.Node):
    """In a thread that does not come back, in its process function or its teardown."""

    hangs = hfg.Parameter("")
    gate = threading.Event()

    def process(self, value: int) -> None:
        if self.hangs == "process":
            self.gate.wait(30)

    def teardown(self) -> None:
        assert self.hangs != "process", "it is not torn down while its code runs"
        self.gate.wait(30)


class Motor(hfg.Node):
    value = hfg.Input(int)
    off: list[str] = []  # noqa: RUF012 - of all

    def process(self, value: int) -> None:
        pass

    def teardown(self) -> None:
        self.off.append(threading.current_thread().name)


@pytest.mark.rule("X3")
@pytest.mark.parametrize("clock", ["real", "virtual"])
@pytest.mark.parametrize("hangs", ["process", "teardown"])
def test_a_driver_that_hangs_in_a_thread_keeps_no_motor_of_its_group_running(hangs: str, clock: Any) -> None:
    Motor.off.clear()
    Driver.gate.clear()
    graph = hfg.Graph()
    graph.group("arm", threads=1)
    values = graph.input("values", int)
    for kind in (Motor(), Driver(hangs=hangs)):
        graph.connect(values, graph.add(kind, group="arm").ports.inputs["value"])

    async def main() -> None:
        async with hfg.running(graph) as run, run.feed(values) as feed:
            run._engine.settings.teardown_limit_s = 0.05
            sending = asyncio.ensure_future(feed.send(1))
            while not run._engine.core.in_flight:
                await asyncio.sleep(0)
            run.stop()
            await asyncio.gather(sending, return_exceptions=True)

    loop = hfg.VirtualTimeLoop if clock == "virtual" else None
    try:
        with (
            pytest.raises(hfg.errors.TeardownError, match='^node "driver" failed in') as raised,
            asyncio.Runner(loop_factory=loop) as runner,
        ):
            runner.run(main())
    finally:
        Driver.gate.set()
    assert len(raised.value.errors) == 1
    assert Motor.off == ["hfg group arm"]


@pytest.mark.rule("X3")
def test_async_code_under_way_is_cancelled_when_the_run_is_left(fast: bool) -> None:
    async def main() -> list[str]:
        graph = hfg.Graph()
        node = graph.add(Unending())
        async with hfg.running(graph, fast=fast):
            await asyncio.sleep(1)
        return node.story

    assert drive(main) == ["cancelled"]


@pytest.mark.rule("X3", "F2")
def test_generators_are_closed(fast: bool) -> None:
    closed: list[str] = []
    Closes.closed = closed
    graph = hfg.Graph()
    source, node, sink = graph.add(Closes()), graph.add(forward()), graph.add(KeepTokens())
    graph.connect(source.ports.outputs["out"], node.value)
    graph.connect(node.out, sink.value)
    other = graph.add(fail_on(bad=2))
    graph.connect(source.ports.outputs["out"], other.value)
    with pytest.raises(hfg.errors.NodeError):
        run(graph, fast)
    assert closed == ["closed"]


class Closes(hfg.Node):
    closed: list[str] = []  # noqa: RUF012 - replaced by the test

    def process(self) -> Iterator[int]:
        try:
            yield 1
            yield 2
            yield 3
        finally:
            self.closed.append("closed")
