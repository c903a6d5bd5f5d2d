"""Long chains need no stack (rules F5, F8), and async code that asks for its task works inside graphs (rule R1)."""

from __future__ import annotations

import asyncio
import contextvars
import sys
from typing import Any

import anyio
import pytest

import hfg
from tests.semantics.nodes import Ear, Keep, forward, forward_async, numbers, run

LENGTH = 5_000

variable: contextvars.ContextVar[str] = contextvars.ContextVar("variable", default="unset")


@pytest.mark.slow
@pytest.mark.rule("F5")
@pytest.mark.parametrize("release", ["sequential", "pipelined"])
def test_a_chain_of_5000_nodes_needs_no_deep_stack(release: Any, fast: bool) -> None:
    graph = hfg.Graph()
    last: Any = graph.add(numbers(count=2))
    for _ in range(LENGTH):
        node = graph.add(forward(), release=release)
        graph.connect(last.out, node.value)
        last = node
    sink = graph.add(Keep())
    graph.connect(last.out, sink.value)
    run(graph, fast)
    assert sink.values == [1, 2]


@pytest.mark.slow
@pytest.mark.rule("F8")
def test_a_chain_of_5000_events_into_slots_needs_no_deep_stack(fast: bool) -> None:
    graph = hfg.Graph()
    first: Any = graph.add(Ear())
    graph.connect(graph.add(numbers(count=2)).out, first.hear)
    last = first
    for _ in range(LENGTH):
        node = graph.add(Ear())
        graph.connect(last.passed, node.hear)
        last = node
    run(graph, fast)
    assert last.heard == [1, 2]


@pytest.mark.rule("F5", "F10")
def test_a_long_chain_ends_is_disabled_and_silent_without_a_deep_stack(fast: bool) -> None:
    graph = hfg.Graph()
    last: Any = graph.add(numbers(count=3))
    for _ in range(1_000):
        node = graph.add(forward())
        graph.connect(last.out, node.value)
        last = node
    graph.connect(last.out, graph.add(Keep()).value)
    before = sys.getrecursionlimit()
    sys.setrecursionlimit(400)
    try:
        report = run(graph, fast)
    finally:
        sys.setrecursionlimit(before)
    assert report.nodes["keep"].ended


@pytest.mark.slow
@pytest.mark.rule("F5", "R1")
def test_a_chain_of_async_nodes_that_do_not_wait_needs_no_deep_stack(fast: bool) -> None:
    graph = hfg.Graph()
    last: Any = graph.add(numbers(count=2))
    for _ in range(1_000):
        node = graph.add(at_once())
        graph.connect(last.out, node.value)
        last = node
    sink = graph.add(Keep())
    graph.connect(last.out, sink.value)
    run(graph, fast)
    assert sink.values == [1, 2]


@hfg.node
async def at_once(value: int) -> int:
    """Async, but never waits."""
    return value


@pytest.mark.rule("R1")
def test_a_chain_of_async_nodes_that_wait(fast: bool) -> None:
    graph = hfg.Graph()
    last: Any = graph.add(numbers(count=3))
    for _ in range(50):
        node = graph.add(forward_async())
        graph.connect(last.out, node.value)
        last = node
    sink = graph.add(Keep())
    graph.connect(last.out, sink.value)
    run(graph, fast)
    assert sink.values == [1, 2, 3]


# --- async code that asks for its task before it first suspends ---


@hfg.node
async def with_timeout(value: int) -> str:
    """A time limit of its own."""
    try:
        async with asyncio.timeout(1):
            await asyncio.sleep(10 if value % 2 else 0.5)
    except TimeoutError:
        return f"{value} timeout"
    return f"{value} slept"


@hfg.node
async def with_move_on(value: int) -> str:
    """The same with anyio."""
    with anyio.move_on_after(1) as scope:
        await anyio.sleep(10 if value % 2 else 0.5)
    return f"{value} {'timeout' if scope.cancelled_caught else 'slept'}"


@hfg.node
async def with_tasks(value: int) -> str:
    """Tasks of its own."""
    async with asyncio.TaskGroup() as group:
        tasks = [group.create_task(asyncio.sleep(number, number)) for number in range(3)]
    async with anyio.create_task_group() as other:
        other.start_soon(anyio.sleep, 1)
    return f"{value} {sum(task.result() for task in tasks)}"


@hfg.node
async def with_variable(value: int) -> str:
    """A context variable set before and read after a suspension."""
    before = variable.get()
    token = variable.set(f"set {value}")
    await asyncio.sleep(0.1)
    found = variable.get()
    variable.reset(token)
    return f"{value} {before} {found}"


@hfg.node
async def with_gather(value: int) -> str:
    """Waits for several things at once, one of which fails."""
    results = await asyncio.gather(asyncio.sleep(1, "a"), _fail(), return_exceptions=True)
    return f"{value} {results[0]} {type(results[1]).__name__}"


async def _fail() -> None:
    await asyncio.sleep(0.5)
    raise KeyError("x")


@pytest.mark.rule("R1", "X2")
@pytest.mark.parametrize("limit", [None, 60.0])
@pytest.mark.parametrize(
    ("node", "expected"),
    [
        (with_timeout, ["1 timeout", "2 slept", "3 timeout"]),
        (with_move_on, ["1 timeout", "2 slept", "3 timeout"]),
        (with_tasks, ["1 3", "2 3", "3 3"]),
        (with_variable, ["1 unset set 1", "2 unset set 2", "3 unset set 3"]),
        (with_gather, ["1 a KeyError", "2 a KeyError", "3 a KeyError"]),
    ],
)
def test_async_code_may_use_what_asks_for_the_current_task(
    node: Any, expected: list[str], limit: float | None, fast: bool
) -> None:
    graph = hfg.Graph()
    source, middle, sink = graph.add(numbers(count=3)), graph.add(node(), max_duration_s=limit), graph.add(Keep())
    graph.connect(source.out, middle.value)
    graph.connect(middle.out, sink.value)
    run(graph, fast)
    assert sink.values == expected


class Slots(hfg.Node):
    """The same in slots and hooks."""

    story = hfg.State(factory=list)

    async def setup(self) -> None:
        with anyio.move_on_after(1) as scope:
            await anyio.sleep(10)
        self.story.append(("setup", scope.cancelled_caught))

    @hfg.slot
    async def hear(self, value: int) -> None:
        async with asyncio.TaskGroup() as group:
            group.create_task(asyncio.sleep(1))
        self.story.append(("hear", value))

    async def on_activated(self) -> None:
        async with asyncio.timeout(1):
            await asyncio.sleep(0.5)
        self.story.append(("activated", True))

    async def teardown(self) -> None:
        try:
            async with asyncio.timeout(1):
                await asyncio.sleep(10)
        except TimeoutError:
            self.story.append(("teardown", True))


@pytest.mark.rule("R1", "X3")
def test_slots_and_hooks_may_use_it_too(fast: bool) -> None:
    graph = hfg.Graph()
    source, node = graph.add(numbers(count=1)), graph.add(Slots())
    graph.connect(source.out, node.hear)
    graph.connect(graph.start, node.activate)
    run(graph, fast)
    assert sorted(node.story) == [("activated", True), ("hear", 1), ("setup", True), ("teardown", True)]


@pytest.mark.rule("X2", "R1")
def test_the_time_limit_of_a_firing_goes_before_limits_inside_it(fast: bool) -> None:
    graph = hfg.Graph()
    source, sink = graph.add(numbers(count=3)), graph.add(Keep())
    node = graph.add(with_timeout(), max_duration_s=0.75, on_error="skip")
    graph.connect(source.out, node.value)
    graph.connect(node.out, sink.value)
    report = run(graph, fast)
    assert sink.values == ["2 slept"]
    assert report.nodes["with_timeout"].failed == 2


class Delegates(hfg.Node):
    """A plain handler that gives back the coroutine of an async one."""

    heard = hfg.State(factory=list[int])

    @hfg.slot
    def hear(self, value: int) -> Any:
        return self._hear(value)

    async def _hear(self, value: int) -> None:
        await asyncio.sleep(0.1)
        self.heard.append(value)


class Speaks(hfg.Node):
    """Tells at once."""

    said = hfg.Event(int)

    def process(self, value: int) -> None:
        self.said.trigger(value)


@pytest.mark.rule("F9", "R1")
def test_a_handler_that_gives_back_a_coroutine_is_awaited_before_the_next_call(fast: bool) -> None:
    graph = hfg.Graph()
    speaks, node = graph.add(Speaks()), graph.add(Delegates())
    graph.connect(graph.add(numbers(count=3)).out, speaks.ports.inputs["value"])
    graph.connect(speaks.said, node.hear)
    report = run(graph, fast)
    assert node.heard == [1, 2, 3]
    assert report.duration_s == pytest.approx(0.3)
