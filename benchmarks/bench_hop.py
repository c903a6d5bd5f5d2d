"""What one hop costs: the wall and CPU time of a token per edge, in chains of several kinds.

Measured: a run of N tokens through a source, K nodes and a sink (K + 1 edges), from the first firing to the end of
  the run, divided by N and by K + 1;
values are small integers, nobody observes, all rules are in force. `queue` is the same work with asyncio.Queue(1)
and a task per node. Not measured: building the graph (see bench_shape) and user code (each node adds 0 or passes on).

Each case runs in a fresh process; the table shows the median of the processes and their spread, (max - min) / median.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import hfg

TOKENS = 200_000  # hops per measurement, divided among the edges


@hfg.node
def numbers(*, count: int = 10) -> Iterator[int]:
    """Count."""
    yield from range(count)


@hfg.node
def through(value: int) -> int:
    """Pass on."""
    return value


@hfg.node
async def through_async(value: int) -> int:
    """Pass on, without waiting."""
    return value


@hfg.node
async def through_waiting(value: int) -> int:
    """Pass on after one pass of the loop."""
    await asyncio.sleep(0)
    return value


@hfg.node
def sink(value: int) -> None:
    """Take."""


class Through(hfg.Node):
    """Pass on, as a class."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> int:
        """Pass on."""
        return value


class Starter(hfg.Node):
    """Turn each value into a signal."""

    value = hfg.Input(int)
    signal = hfg.Event(int)

    def process(self, value: int) -> None:
        """Trigger."""
        self.signal.trigger(value)


class Relay(hfg.Node):
    """Slot to event."""

    signal = hfg.Event(int)

    @hfg.slot
    def take(self, value: int) -> None:
        """Trigger again."""
        self.signal.trigger(value)


class End(hfg.Node):
    """Take signals."""

    @hfg.slot
    def take(self, value: int) -> None:
        """Take."""


def chain(make: Callable[[], Any], length: int, tokens: int) -> hfg.Graph:
    """A source, `length` nodes and a sink."""
    graph = hfg.Graph("chain")
    port: Any = graph.add(numbers(count=tokens)).out
    for _ in range(length):
        node = graph.add(make())
        graph.connect(port, node.ports.inputs["value"])
        port = node.ports.outputs["out"]
    graph.connect(port, graph.add(sink()).ports.inputs["value"])
    return graph


def events(length: int, tokens: int) -> hfg.Graph:
    """A source, a node that triggers, `length` relays from slot to event, and an end."""
    graph = hfg.Graph("events")
    source = graph.add(numbers(count=tokens))
    starter = graph.add(Starter())
    graph.connect(source.out, starter.value)
    event: Any = starter.signal
    for _ in range(length):
        relay = graph.add(Relay())
        graph.connect(event, relay.take)
        event = relay.signal
    graph.connect(event, graph.add(End()).take)
    return graph


def timed(graph: hfg.Graph, hops: int, tokens: int, **options: Any) -> float:
    """Microseconds per hop of a run, without building."""

    async def main() -> float:
        async with hfg.running(graph, **options) as run:
            began = time.perf_counter()
            await run.wait_finished()
            return time.perf_counter() - began

    return asyncio.run(main()) / tokens / hops * 1e6


def queue_chain(length: int, tokens: int) -> float:
    """The same with asyncio.Queue(1) and a task per node: microseconds per hop."""

    async def main() -> float:
        queues: list[asyncio.Queue[int]] = [asyncio.Queue(1) for _ in range(length + 1)]

        async def source() -> None:
            for value in range(tokens):
                await queues[0].put(value)
            await queues[0].put(-1)

        async def node(before: asyncio.Queue[int], after: asyncio.Queue[int]) -> None:
            while (value := await before.get()) >= 0:
                await after.put(value)
            await after.put(-1)

        async def last() -> None:
            while await queues[-1].get() >= 0:
                pass

        began = time.perf_counter()
        async with asyncio.TaskGroup() as group:
            group.create_task(source())
            for before, after in pairwise(queues):
                group.create_task(node(before, after))
            group.create_task(last())
        return time.perf_counter() - began

    return asyncio.run(main()) / tokens / (length + 1) * 1e6


def function(length: int, **options: Any) -> Callable[[], float]:
    """Case: synchronous functions."""
    return lambda: timed(chain(through, length, TOKENS // (length + 1)), length + 1, TOKENS // (length + 1), **options)


def kind(make: Callable[[], Any], length: int = 10, hops: int = TOKENS) -> Callable[[], float]:
    """Case: some other kind of node."""
    return lambda: timed(chain(make, length, hops // (length + 1)), length + 1, hops // (length + 1))


class Activator(hfg.Node):
    """Send every value with +1, as a node that is always active would."""

    value = hfg.Input(int)
    out = hfg.Output(int)

    def process(self, value: int) -> None:
        """Activate the next."""
        self.out.send(value, activity=+1)


def transfer() -> float:
    """Case: every edge is active; each token brings the activity to the next node and takes it along."""
    tokens = TOKENS // 12
    graph = hfg.Graph("transfer")
    source = graph.add(numbers(count=tokens))
    first = graph.add(Activator())
    graph.connect(source.out, first.value)
    port: Any = first.out
    for _ in range(10):
        node = graph.add(through())
        graph.connect(port, node.ports.inputs["value"], active=True)
        port = node.out
    graph.connect(port, graph.add(sink()).ports.inputs["value"], active=True)
    return timed(graph, 12, tokens)


def transfer_baseline() -> float:
    """Case: the same nodes and tokens with edges that are not active."""
    tokens = TOKENS // 12
    graph = hfg.Graph("transfer")
    source = graph.add(numbers(count=tokens))
    first = graph.add(Activator())
    graph.connect(source.out, first.value)
    port: Any = first.out
    for _ in range(10):
        node = graph.add(through())
        graph.connect(port, node.ports.inputs["value"])
        port = node.out
    graph.connect(port, graph.add(sink()).ports.inputs["value"])
    return timed(graph, 12, tokens)


CASES: dict[str, Callable[[], float]] = {
    "function, chain of 1": function(1),
    "function, chain of 10": function(10),
    "function, chain of 50": function(50),
    "class, chain of 10": kind(Through),
    "async without waiting, chain of 10": kind(through_async),
    "async that waits once, chain of 10": kind(through_waiting, hops=TOKENS // 4),
    "event to slot, chain of 10": lambda: timed(events(10, TOKENS // 12), 12, TOKENS // 12),
    "activity on every hop, chain of 10": transfer,
    "the same without activity, chain of 10": transfer_baseline,
    "asyncio.Queue(1), chain of 10": lambda: queue_chain(10, TOKENS // 4 // 11),
}


def ratios(medians: dict[str, float]) -> list[str]:
    """The ratios that hold on any machine."""
    ours = medians["function, chain of 10"]
    added = medians["activity on every hop, chain of 10"] - medians["the same without activity, chain of 10"]
    return [
        f"function chain of 10 / asyncio.Queue(1): {ours / medians['asyncio.Queue(1), chain of 10']:.2f}",
        f"a transfer of activity adds {added:.3f} us to its hop",
    ]
