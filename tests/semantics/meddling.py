"""Fused waves that stop amid a call of their second member, so that a test can meddle with them meanwhile.

Two kinds: one in a thread, whose call blocks, and one on the loop, whose async call gives way again and again.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Coroutine
from typing import Any

import hfg
from tests.limits import patience
from tests.semantics.nodes import Keep, forward, numbers, scale

__all__ = ["MEMBERS", "PATIENCE_S", "Gate", "Turns", "chain"]

PATIENCE_S = patience(20.0)
MEMBERS = ("forward", "stops", "scale", "last")


def chain(graph: hfg.Graph, port: Any, *nodes: Any, **options: Any) -> Any:
    """Connect nodes one behind the other, with options for all and of their own; gives back the last output."""
    for one in nodes:
        node, own = one if isinstance(one, tuple) else (one, {})
        graph.add(node, **options, **own)
        graph.connect(port, node.value)
        port = getattr(node, "out", None)
    return port


def _stopping(graph: hfg.Graph, count: int, member: Any, **options: Any) -> tuple[hfg.Graph, Keep]:
    sink = Keep()
    source = graph.add(numbers(count=count))
    out = chain(graph, source.out, forward(), member, scale(factor=10), (forward(), {"name": "last"}), **options)
    graph.connect(out, graph.add(sink).value)
    return graph, sink


class Gate:
    """The second member blocks its thread at one value; on the real clock."""

    def __init__(self, at: int = 3) -> None:
        self.at = at
        self.inside = threading.Event()
        self.open = threading.Event()

    def node(self) -> Any:
        @hfg.node
        def stops(value: int) -> int:
            if value == self.at:
                self.inside.set()
                assert self.open.wait(PATIENCE_S)
            return value

        return stops()

    def graph(self, count: int = 6) -> tuple[hfg.Graph, Keep]:
        graph = hfg.Graph()
        graph.group("work", threads=1)
        return _stopping(graph, count, self.node(), group="work")

    async def until_inside(self) -> None:
        assert await asyncio.to_thread(self.inside.wait, PATIENCE_S)

    def go_on(self) -> None:
        self.open.set()

    @staticmethod
    def run(main: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run(main)


class Turns:
    """The second member gives way at one value until it may go on, and then does something else; in virtual time."""

    def __init__(self, at: int = 3, then: Callable[[], Any] | None = None) -> None:
        self.at = at
        self.inside = asyncio.Event()
        self.over = False
        self.then = then

    def node(self) -> Any:
        @hfg.node
        async def stops(value: int) -> int:
            if value == self.at:
                self.inside.set()
                while not self.over:
                    await asyncio.sleep(0)
                if self.then is not None:
                    await self.then()
            return value

        return stops()

    def graph(self, count: int = 6, **options: Any) -> tuple[hfg.Graph, Keep]:
        return _stopping(hfg.Graph(), count, (self.node(), options))

    async def until_inside(self) -> None:
        await self.inside.wait()

    def go_on(self) -> None:
        self.over = True

    @staticmethod
    def run(main: Coroutine[Any, Any, Any]) -> Any:
        with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
            return runner.run(main)
