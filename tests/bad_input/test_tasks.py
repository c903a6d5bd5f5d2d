"""Tasks of nodes started where or when they cannot be: one sentence, and no coroutine is left behind (rule X1)."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

import hfg
from hfg.errors import NodeError, NotRunning, UsageError
from hfg.testing import fire
from tests.semantics.nodes import drive, numbers, run

MADE: list[Coroutine[Any, Any, Any]] = []


@pytest.fixture(autouse=True)
def nothing_is_left() -> Any:
    yield
    assert [inspect.getcoroutinestate(one) for one in MADE] == ["CORO_CLOSED"] * len(MADE)
    MADE.clear()


def work() -> Coroutine[Any, Any, None]:
    """Make a coroutine that must not be forgotten."""

    async def work() -> None: ...

    MADE.append(work())
    return MADE[-1]


class Calls(hfg.Node):
    """Calls what it is given, in one of its functions."""

    what = hfg.Parameter[Any](None)
    where = hfg.Parameter("process")

    def process(self, value: int) -> None:
        if self.where == "process":
            self.what(self)

    def teardown(self) -> None:
        if self.where == "teardown":
            self.what(self)


class Awaits(Calls):
    async def process(self, value: int) -> None:  # type: ignore[override]
        await self.what(self)


class Box(hfg.Subgraph):
    def build(self, graph: hfg.Graph) -> None: ...


def graph_of(node: hfg.Node, **options: Any) -> hfg.Graph:
    graph = hfg.Graph()
    graph.group("work", threads=1)
    graph.add(node, name="node", **options)
    graph.connect(graph.add(numbers(count=1)).out, node.ports.inputs["value"])
    return graph


def test_before_the_run_and_after_it() -> None:
    node = Calls(what=lambda node: None)
    with pytest.raises(
        NotRunning, match=r'^"calls" cannot start_soon\(work\(\.\.\.\)\) because it is not part of a run; call it in'
    ):
        node.start_soon(work())
    graph = graph_of(node)
    for _ in range(2):
        with pytest.raises(
            NotRunning, match=r'^"node" cannot start_soon\(work\(\.\.\.\)\) because it is not part of a run; call it'
        ):
            node.start_soon(work())
        run(graph)


def test_in_teardown() -> None:
    graph = graph_of(Calls(where="teardown", what=lambda node: node.start_soon(work())))
    with pytest.raises(
        hfg.errors.TeardownError, match=r'"node" cannot start_soon\(work\(\.\.\.\)\), for the run is over'
    ):
        run(graph)

    async def main() -> None:
        async with hfg.running(graph, clock="virtual") as running:
            await running.wait_quiet()
            await running.edit(hfg.commands.Remove("node"))
            (sentence,) = running.report().errors
            assert "cannot start_soon(work(...)) while it is torn down; await it in teardown(), or start it" in sentence

    drive(main)


def test_in_the_thread_of_a_group() -> None:
    graph = graph_of(Calls(what=lambda node: node.start_soon(work())), group="work")
    with pytest.raises(
        NodeError,
        match=r'"node" cannot start_soon\(work\(\.\.\.\)\), for its group "work" is a thread and async code runs on '
        r"the loop; leave out group=, or send an event to a node on the loop that starts it$",
    ):
        run(graph)


def test_in_a_thread_of_its_own() -> None:
    async def in_thread(node: hfg.Node) -> None:
        await asyncio.to_thread(lambda: node.start_soon(work()))

    with pytest.raises(
        NodeError, match=r'"node" cannot start_soon\(work\(\.\.\.\)\) from a thread, for async code runs'
    ):
        hfg.run(graph_of(Awaits(what=in_thread)))


NO_COROUTINES: list[Callable[[], Any]] = [lambda: work, lambda: None, lambda: 3, lambda: asyncio.sleep, lambda: [1]]


@pytest.mark.parametrize("what", NO_COROUTINES)
def test_what_is_no_coroutine(what: Callable[[], Any]) -> None:
    graph = graph_of(Calls(what=lambda node: node.start_soon(what())))
    with pytest.raises(
        NodeError, match=r'start_soon of "node" takes a coroutine, got .*; call the function that makes it: self\.st'
    ):
        run(graph)


def test_on_a_subgraph_and_in_a_single_firing() -> None:
    graph = hfg.Graph()
    box = graph.add(Box())
    with pytest.raises(
        UsageError, match=r'^"box" cannot start_soon\(work\(\.\.\.\)\) because a subgraph runs no code of its'
    ):
        box.start_soon(work())
    with pytest.raises(NotRunning, match=r'"calls" cannot start_soon.* because it is not part of a run'):
        fire(Calls(what=lambda node: node.start_soon(work())), value=1)
