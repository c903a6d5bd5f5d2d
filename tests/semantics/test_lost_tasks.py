"""Tasks that code of nodes starts by asyncio itself: one that nobody looks after is told of (rule X1)."""

from __future__ import annotations

import asyncio
import gc
import logging
from collections.abc import Callable
from typing import Any

import anyio
import pytest

import hfg
from hfg import commands
from tests.semantics.nodes import Keep, drive, forward, forward_async, named, numbers, run

REMEDY = "await it there, or start it by self.start_soon({}(...)): then its errors are the node's, and it ends with it"
KEPT: list[Any] = []


async def stays() -> None:
    await asyncio.sleep(1e6)


async def fails() -> None:
    await asyncio.sleep(1)
    raise ValueError("no contact")


async def is_over(value: int = 0) -> int:
    await asyncio.sleep(0.5)
    return value


@hfg.node
def starts(value: int) -> int:
    KEPT.append(asyncio.ensure_future(stays()))
    return value


@hfg.node
async def starts_async(value: int) -> int:
    await asyncio.sleep(0)
    KEPT.append(asyncio.create_task(stays()))
    return value


class InSlot(hfg.Node):
    @hfg.slot
    def begin(self) -> None:
        KEPT.append(asyncio.get_running_loop().create_task(stays()))


class InSetup(hfg.Node):
    async def setup(self) -> None:
        KEPT.append(asyncio.create_task(stays()))

    def process(self, value: int) -> None: ...


class InTask(hfg.Node):
    def process(self, value: int) -> None:
        self.start_soon(self.work())

    async def work(self) -> None:
        KEPT.append(asyncio.create_task(stays()))


@pytest.fixture(autouse=True)
def warnings(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    """Give what was warned of so far, in order."""
    KEPT.clear()
    caplog.set_level(logging.WARNING)
    return lambda: [record.getMessage() for record in caplog.records]


def chain(node: hfg.Node) -> hfg.Graph:
    graph = hfg.Graph()
    graph.add(node, name="node")
    graph.connect(graph.add(numbers(count=1)).out, node.ports.inputs["value"])
    if "begin" in node.ports.slots:
        graph.connect(graph.start, node.ports.slots["begin"])
    return graph


@pytest.mark.rule("X1")
@pytest.mark.parametrize("kind", [starts, starts_async, InSlot, InSetup, InTask])
def test_one_that_still_runs_at_the_end_is_told_of_with_node_and_remedy(
    kind: Any, warnings: Callable[[], list[str]], caplog: pytest.LogCaptureFixture, fast: bool
) -> None:
    if kind is InSlot:
        graph = hfg.Graph()
        graph.connect(graph.start, graph.add(InSlot(), name="node").begin)
    else:
        graph = chain(kind())
    run(graph, fast)
    assert warnings() == [
        'node "node": the task "stays" that its code has started still runs at the end of the run, and may be lost; '
        + REMEDY.format("stays")
    ]
    assert caplog.records[0].name == "hfg.node.node"


@pytest.mark.slow
@pytest.mark.rule("X1")
@pytest.mark.parametrize("kept", [True, False])
def test_one_that_has_failed_with_nobody_there_is_told_of_once_with_the_users_frames(
    kept: bool, warnings: Callable[[], list[str]], caplog: pytest.LogCaptureFixture
) -> None:
    @hfg.node
    async def drops(value: int) -> None:
        task = asyncio.create_task(fails())
        if kept:
            KEPT.append(task)
        del task
        await asyncio.sleep(2)

    run(chain(drops()))
    KEPT.clear()
    gc.collect()
    assert warnings() == [
        'node "node": the task "fails" that its code has started has failed, and nobody has looked; '
        + REMEDY.format("fails")
    ]
    assert "ValueError: no contact" in caplog.text
    assert "/hfg/" not in caplog.text


@pytest.mark.rule("X1")
def test_what_is_awaited_where_it_was_started_is_nobodys_affair(warnings: Callable[[], list[str]]) -> None:
    @hfg.node
    async def behaves(value: int) -> int:
        async with asyncio.TaskGroup() as group:
            group.create_task(is_over())
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(is_over)
        await asyncio.gather(is_over(), is_over(), asyncio.sleep(1))
        await asyncio.wait_for(is_over(), 5)
        async with asyncio.timeout(5):
            await is_over()
        with pytest.raises(ValueError, match="no contact"):
            await asyncio.create_task(fails())
        asyncio.create_task(stays()).cancel()
        with anyio.move_on_after(1):
            await asyncio.gather(stays(), stays())
        return value

    run(chain(behaves()))
    assert warnings() == []


@pytest.mark.rule("X3")
def test_one_that_is_cancelled_in_teardown_is_no_lost_one(warnings: Callable[[], list[str]]) -> None:
    class Careful(InSetup):
        def teardown(self) -> None:
            KEPT.pop().cancel()

    run(chain(Careful()))
    assert warnings() == []


@pytest.mark.rule("X1")
def test_tasks_of_the_program_around_a_run_are_its_own(warnings: Callable[[], list[str]]) -> None:
    async def main() -> None:
        loop = asyncio.get_running_loop()
        mine = asyncio.create_task(stays())
        async with hfg.running(chain(forward_async()), clock="virtual") as running:
            other = asyncio.create_task(stays())
            async with hfg.running(chain(forward()), clock="virtual") as inner:
                await inner.wait_finished()
            assert loop.get_task_factory() is not None
            await running.wait_finished()
        assert (loop.get_task_factory(), loop.get_exception_handler()) == (None, None)
        assert not mine.done()
        assert not other.done()

    drive(main)
    assert warnings() == []


@pytest.mark.rule("X1")
def test_a_factory_and_a_handler_of_the_program_are_kept(warnings: Callable[[], list[str]]) -> None:
    made: list[str] = []
    heard: list[str] = []

    def factory(loop: Any, coroutine: Any, **options: Any) -> asyncio.Task[Any]:
        made.append(coroutine.__name__)
        return asyncio.Task(coroutine, loop=loop, **options)

    async def main() -> None:
        loop = asyncio.get_running_loop()
        loop.set_task_factory(factory)
        loop.set_exception_handler(lambda _loop, context: heard.append(context["message"]))
        async with hfg.running(chain(starts_async()), clock="virtual") as running:
            await running.wait_finished()
            loop.call_exception_handler({"message": "something else"})
        assert loop.get_task_factory() is factory

    drive(main)
    assert "stays" in made
    assert heard == ["something else"]
    assert len(warnings()) == 1


@pytest.mark.rule("R4")
def test_an_edit_in_a_task_of_a_nodes_code_is_over_in_time(warnings: Callable[[], list[str]]) -> None:
    runs: list[hfg.Run] = []

    @hfg.node
    async def edits(value: int) -> None:
        asyncio.create_task(runs[0].edit(commands.Add(named(Keep), "kept")))  # noqa: RUF006

    async def main() -> None:
        graph = chain(edits())
        async with hfg.running(graph, clock="virtual") as running:
            runs.append(running)
            await asyncio.sleep(1)
            assert "kept" in graph.nodes

    drive(main)
    assert warnings() == []
