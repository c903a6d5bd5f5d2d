"""Nodes that block or never come back are warned about, given up and named."""

from __future__ import annotations

import asyncio
import logging
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest

import hfg
from hfg.errors import NodeError
from tests.bad_input.graphs import one, sentence
from tests.semantics.nodes import drive, run

# --- nodes that block ---


class Blocks(hfg.Node):
    """Holds the loop."""

    value = hfg.Input(int)

    def process(self, value: int) -> None:
        time.sleep(0.15)


def test_a_node_that_blocks_the_loop_is_warned_about_once_with_path_and_remedy(
    caplog: pytest.LogCaptureFixture, fast: bool
) -> None:
    caplog.set_level(logging.WARNING)
    hfg.run(one(Blocks()), block_warning_s=0.04, fast=fast)
    warnings = [record for record in caplog.records if record.name.startswith("hfg")]
    assert len(warnings) == 1
    message = warnings[0].getMessage()
    assert message.startswith('node "node" has blocked the loop for more than 0.04 s')
    assert 'group="' in message
    assert warnings[0].path == "node"  # type: ignore[attr-defined]


def test_no_warning_when_none_is_wanted_or_the_node_is_quick_or_in_a_thread(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    hfg.run(one(Blocks(), count=1), block_warning_s=0)
    hfg.run(one(Blocks(), count=1), block_warning_s=1)
    graph = one(Blocks(), count=1, group="work")
    graph.group("work", threads=1)
    hfg.run(graph, block_warning_s=0.04)
    assert [record for record in caplog.records if record.name.startswith("hfg")] == []


class Dawdles(hfg.Node):
    """Takes a few milliseconds: far too short for a warning."""

    value = hfg.Input(int)
    count = hfg.State(0)

    def process(self, value: int) -> None:
        time.sleep(0.005)
        self.count += 1


@hfg.node
def without_end() -> Iterator[int]:
    while True:
        yield 1


def test_nodes_of_some_milliseconds_let_the_loop_turn(fast: bool) -> None:
    """None of them blocks the loop; dozens in a row would, and timers and Ctrl-C would be as late."""
    graph, node, turns = hfg.Graph(), Dawdles(), []
    graph.add(without_end()) >> graph.add(node).value

    async def main() -> None:
        async with hfg.running(graph, fast=fast) as run:
            for _ in range(8):
                before = node.count
                await asyncio.sleep(0)
                turns.append(node.count - before)
            run.stop()

    asyncio.run(main())
    assert sum(turns) > 0
    assert max(turns) < 32


# --- nodes that never come back ---


class Stuck(hfg.Node):
    """Its thread waits until the test lets it go."""

    value = hfg.Input(int)
    gate = threading.Event()

    def process(self, value: int) -> None:
        self.gate.wait(10)

    def teardown(self) -> None:
        raise AssertionError("it is not torn down while its code runs")


def test_a_thread_that_does_not_come_back_is_given_up_and_named() -> None:
    Stuck.gate.clear()
    graph = one(Stuck(), group="work", max_duration_s=0.05)
    graph.group("work", threads=1)
    try:
        with pytest.raises(
            hfg.errors.FiringTimeout, match='node "node" failed in firing 1: it took longer than max_dur'
        ):
            hfg.run(graph)
    finally:
        Stuck.gate.set()


def test_a_thread_that_does_not_come_back_at_the_end_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    Stuck.gate.clear()
    graph = one(Stuck(), group="work")
    graph.group("work", threads=1)

    async def main() -> None:
        async with hfg.running(graph) as running:
            running._engine.settings.teardown_limit_s = 0.1
            await asyncio.sleep(0.05)

    try:
        with pytest.raises(
            hfg.errors.TeardownError, match=r'node "node" failed in firing 1: its thread did not come back'
        ):
            asyncio.run(main())
    finally:
        Stuck.gate.set()


class SlowThread(hfg.Node):
    """Comes back a little later."""

    value = hfg.Input(int)
    story = hfg.State(factory=list)

    def process(self, value: int) -> None:
        self.story.append("in")
        time.sleep(0.1)
        self.story.append("out")

    def teardown(self) -> None:
        self.story.append("down")


def test_a_thread_has_its_time_to_come_back_before_its_node_is_torn_down() -> None:
    node = SlowThread()
    graph = one(node, count=1, group="work")
    graph.group("work", threads=1)

    async def main() -> None:
        async with hfg.running(graph):
            while not node.story:
                await asyncio.sleep(0.001)

    asyncio.run(main())
    assert node.story == ["in", "out", "down"]


@hfg.node
async def waits_for_ever(value: int) -> int:
    """Never comes back."""
    await asyncio.Event().wait()
    return value


def test_async_code_that_never_comes_back_is_given_up_at_its_limit(fast: bool) -> None:
    said = sentence(one(waits_for_ever(), max_duration_s=5), fast)
    assert said == 'node "node" failed in firing 1: it took longer than max_duration_s = 5 s and was given up'


@hfg.node
async def ignores_cancellation(value: int) -> int:
    """Cannot be cancelled."""
    while True:
        try:
            await asyncio.sleep(1000)
        except asyncio.CancelledError:
            continue


def test_async_code_that_cannot_be_cancelled_is_named_and_dropped_at_the_end(fast: bool) -> None:
    async def main() -> None:
        async with hfg.running(one(ignores_cancellation()), fast=fast):
            await asyncio.sleep(1)

    with pytest.raises(
        hfg.errors.TeardownError, match='node "node" failed in firing 1: it was cancelled and did not end'
    ):
        drive(main)


def test_async_code_that_ignores_its_time_limit_is_dropped_at_the_end(fast: bool) -> None:
    graph = one(ignores_cancellation(), max_duration_s=2, on_error="skip")
    report = run(graph, fast)
    assert report.nodes["node"].failed == 3


# --- code that raises what ends tasks ---


class Stranger(BaseException):
    """No error, and nothing that Python knows."""


@pytest.mark.parametrize("problem", [asyncio.CancelledError, GeneratorExit, SystemExit, Stranger])
@pytest.mark.parametrize("where", ["process", "setup", "teardown", "hear", "on_activated"])
@pytest.mark.parametrize("is_async", [False, True])
def test_code_that_raises_what_is_no_error_fails_the_run_with_its_path(
    problem: type[BaseException], where: str, is_async: bool, fast: bool
) -> None:
    def fail(self: Any, *value: Any) -> None:
        if self.where == where:
            raise problem

    async def fail_async(self: Any, *value: Any) -> None:
        fail(self)

    class Raises(hfg.Node):
        where = hfg.Parameter("")
        value = hfg.Input(int)
        setup = teardown = on_activated = fail_async if is_async else fail
        hear = hfg.slot(type=object)(fail_async if is_async else fail)

        def process(self, value: int) -> None:
            fail(self)

    graph = one(Raises(where=where))
    graph.start.activates(graph["node"].hear)
    with pytest.raises((NodeError, hfg.errors.TeardownError), match='node "node" failed in ') as raised:
        run(graph, fast)
    if problem is SystemExit and where in ("process", "setup", "hear"):
        assert "it called sys.exit: to end the run, connect an event to graph.stop" in str(raised.value)


def test_async_code_that_cancels_itself_does_not_hang_the_run(fast: bool) -> None:
    class Cancels(hfg.Node):
        async def process(self, value: int) -> None:
            task = asyncio.current_task()
            assert task is not None
            task.cancel()
            await asyncio.sleep(1)

    with pytest.raises(NodeError, match='node "node" failed in firing 1: CancelledError'):
        run(one(Cancels()), fast)
