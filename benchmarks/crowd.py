"""A graph as large as the studio is made for: 500 nodes, 700 edges, 200 of the nodes at work 30 times a second.

Beside the chains there is something for each moment that is measured: a mission of three states, a picture with a
parameter, a node that fails on demand, and one that refuses numbers.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterator
from itertools import count, cycle
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval

import hfg
from hfg.images import Gray

__all__ = ["EDGES", "LIVE", "NODES", "build"]

NODES, EDGES, LIVE = 500, 700, 200
RATE_HZ = 30.0
LENGTH = 10
INSIDE = 38
GROUPS = ("sensors", "vision", "mapping", "control")


@hfg.node
def ticks() -> Iterator[int]:
    """Count."""
    yield from count()


@hfg.node
def through(value: int) -> int:
    """Pass on."""
    return value


@hfg.node
def mix(value: int, other: int) -> int:
    """Add."""
    return value + other


class Wait(hfg.Node):
    """Send nothing, because nobody asks."""

    out = hfg.Output(int)

    @hfg.slot
    def ask(self) -> None:
        """Send."""
        self.out.send(0)


class Stay(hfg.Node):
    """Be active for a while, then hand on."""

    done = hfg.Event()
    seconds = hfg.Parameter(0.5, Interval(gt=0, le=10), unit="s")

    @hfg.slot
    async def begin(self) -> None:
        """Stay."""
        await asyncio.sleep(self.seconds)
        self.done.trigger()


class Errand(hfg.Subgraph):
    """Go there and come back, with many others around."""

    begin = hfg.slot(type=object)
    done = hfg.Event()

    def build(self, graph: hfg.Graph) -> None:
        """Put one stay before the other."""
        there, back = graph.add(Stay(), name="there"), graph.add(Stay(), name="back")
        self.begin.inner.activates(there.begin)
        there.done.activates(back.begin)
        back.done.activates(self.done.inner)
        last: Any = graph.add(Wait())
        for _ in range(INSIDE - 1):
            node = graph.add(through())
            graph.connect(last.out, node.value)
            last = node


class Stamp(hfg.Node):
    """Take words, never numbers."""

    @hfg.slot
    def write(self, words: str) -> None:
        """Write them."""


@hfg.node
def shade(value: int, *, level: Annotated[int, Interval(ge=0, le=255)] = 100) -> Gray:
    """Draw a ground as bright as one wants it."""
    return np.full((48, 64), level, np.uint8)


@hfg.node
def look(image: Gray) -> None:
    """Take a picture."""


@hfg.node
def check(value: int, *, fails: bool = False) -> None:
    """Fail when one wants it, and say when that was."""
    if fails:
        raise ValueError(f"it failed at {time.time():.4f}")


def build(rate_hz: float | None = RATE_HZ) -> hfg.Graph:
    """Make the graph; None: all at full speed."""
    graph = hfg.Graph("crowd")
    for name in GROUPS:
        graph.group(name, threads=0)
    _mission(graph)
    at_work = _for_moments(graph, rate_hz)
    groups = cycle(GROUPS)
    while left := NODES - len(graph.nodes):
        length = min(LENGTH, left, LIVE - at_work if at_work < LIVE else LENGTH)
        head = ticks() if at_work < LIVE else Wait()
        _chain(graph, head, length, next(groups), rate_hz)
        at_work += length
    return graph


def _mission(graph: hfg.Graph) -> None:
    """Activity goes round."""
    errand, rest, think = (
        graph.add(node, name=name) for name, node in (("errand", Errand()), ("rest", Stay()), ("think", Stay()))
    )
    graph.start.activates(errand.begin)
    errand.done.activates(rest.begin)
    rest.done.activates(think.begin)
    think.done.activates(errand.begin)


def _for_moments(graph: hfg.Graph, rate_hz: float | None) -> int:
    """What people do something with; gives how many nodes of it are at work."""
    first = graph.add(ticks(), name="ticks", max_rate_hz=rate_hz)
    graph.connect(first.out, graph.add(check(), name="check").value)
    drawn = graph.add(shade(), name="shade")
    graph.connect(first.out, drawn.value)
    graph.connect(drawn.out, graph.add(look(), name="look").image)
    graph.add(through(), name="spare")
    graph.add(Stamp(), name="stamp")
    for name, x in (("spare", 800), ("stamp", 1040)):  # where one sees them at once
        graph.edit(hfg.commands.Note(name, "position", [x, 100]))
    return 4


def _chain(graph: hfg.Graph, head: Any, length: int, group: str, rate_hz: float | None) -> None:
    """Nodes in a row; most take the sum of the two before them."""
    options: dict[str, Any] = {} if isinstance(head, Wait) else {"max_rate_hz": rate_hz}
    ports = [graph.add(head, group=group, **options).out]
    for number in range(1, length):
        is_sum = number in (2, 3, 5, 7, 9, 8 if group == GROUPS[0] else 9)
        node = graph.add(mix() if is_sum else through(), group=group)
        graph.connect(ports[-1], node.value)
        if is_sum:
            graph.connect(ports[-2], node.other)
        ports.append(node.out)
