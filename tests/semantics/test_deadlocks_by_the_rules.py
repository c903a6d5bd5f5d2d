"""Artificial deadlocks (rule F8), read by engine and oracle.

The expected results were counted out on paper from the text of the rule, before either was run.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import pytest

import hfg
from hfg.testing import Recorder
from hfg.trace import QueueGrown
from tests.semantics.readings import sent


class Asks(hfg.Node):
    """Asks many questions in one call, and counts the answers."""

    request = hfg.Event(int)
    answered = hfg.Event(int)
    count = hfg.Parameter(5)
    got = hfg.State(0)

    @hfg.slot
    def begin(self) -> None:
        for number in range(self.count):
            self.request.trigger(number)

    @hfg.slot
    def answer(self, number: int) -> None:
        self.got += 1
        self.answered.trigger(number)


@hfg.node
def plain(number: int) -> int:
    return number


@hfg.node
async def slow(number: int) -> int:
    await asyncio.sleep(0.5)
    return number


class Echo(hfg.Node):
    """Answers a signal by a signal, twice if asked to."""

    back = hfg.Event(int)
    times = hfg.Parameter(1)

    @hfg.slot
    def hear(self, number: int) -> None:
        for _ in range(self.times):
            self.back.trigger(number)


class Ear(hfg.Node):
    @hfg.slot
    def hear(self, value: Any) -> None: ...


@hfg.node
async def ticker(*, every_s: float = 1.0) -> AsyncIterator[int]:
    number = 0
    while True:
        await asyncio.sleep(every_s)
        number += 1
        yield number


@hfg.node
async def forever() -> AsyncIterator[int]:
    await asyncio.sleep(1e6)
    yield 1


class Lives(hfg.Node):
    """A task that lives on beside."""

    async def _wait(self) -> None:
        await asyncio.Event().wait()

    def setup(self) -> None:
        self.start_soon(self._wait())

    @hfg.slot
    def hear(self, value: int) -> None: ...


def beside(graph: hfg.Graph, what: str) -> None:
    """Something that lives on and has nothing to do with the ring."""
    if what == "a source with a rate":
        graph.add(ticker(every_s=2.0)) >> graph.add(plain(), name="other")  # slow: the oracle pays for each number
    elif what == "a source that waits":
        graph.add(forever()) >> graph.add(plain(), name="other")
    elif what == "a task":
        graph.add(Lives())
    else:
        assert what == "nothing"


BESIDE = pytest.mark.parametrize("what", ["nothing", "a source with a rate", "a source that waits", "a task"])


def gateway(what: str, *, capacity: int = 2, count: int = 8, asker: Any = None, **options: Any) -> hfg.Graph:
    """Questions go by a queue to a node whose output answers into a slot of the one who asks."""
    graph = hfg.Graph()
    asks, node = graph.add(Asks(count=count), name="asks"), graph.add(asker or plain(), name="node", **options)
    graph.connect(asks.request, node.number, capacity=capacity)
    graph.connect(node.out, asks.answer)
    graph.connect(asks.answered, graph.add(Ear(), name="ear").hear, capacity=100)
    graph.start.activates(asks.begin)
    beside(graph, what)
    return graph


ANSWERS = "asks.answered -> ear.hear"


class Stops(hfg.Node):
    """Stops the run at the given second."""

    now = hfg.Event(int)
    at_s = hfg.Parameter(60.0)

    async def process(self) -> None:
        await asyncio.sleep(self.at_s)
        self.now.trigger(1)
        raise hfg.EndOfStream


def ended(graph: hfg.Graph, at_s: float = 60.0) -> hfg.Graph:
    graph.connect(graph.add(Stops(at_s=at_s), name="halt").now, graph.stop)
    return graph


@pytest.mark.rule("F8")
@BESIDE
@pytest.mark.parametrize("asker", [plain, slow], ids=["plain", "slow"])
def test_a_gateway_answers_all_whatever_else_runs(perform: Any, what: str, asker: Any) -> None:
    """8 questions in one call, room for 2: `node` waits for its output (F6), `asks` for its queue.

    Only growing opens the ring.
    """
    found = perform(
        lambda: ended(gateway(what, asker=asker())), lambda seen: sorted(value for _, value in sent(seen, ANSWERS))
    )
    assert found == list(range(8))


@pytest.mark.rule("F8")
@BESIDE
def test_it_grows_no_further_than_it_must(perform: Any, what: str) -> None:
    """`node` takes 0 and its answer waits at `asks`, whose queue still holds 1 to 7: no call starts below 8 places."""
    found = perform(lambda: ended(gateway(what)), lambda seen: [event.capacity for event in seen.of(QueueGrown)])
    assert found == [3, 4, 5, 6, 7, 8]


@pytest.mark.rule("F8")
@BESIDE
def test_a_firing_under_way_that_waits_for_none_of_them_opens_the_ring(perform: Any, what: str) -> None:
    """With five at once the queue empties by itself: 8 questions, 5 under way, 3 in a queue with room for 4."""
    found = perform(
        lambda: ended(gateway(what, capacity=4, asker=slow(), concurrency=5, ordered=False)),
        lambda seen: (len(sent(seen, ANSWERS)), [event.capacity for event in seen.of(QueueGrown)]),
    )
    assert found == (8, [])


@pytest.mark.rule("F8")
def test_a_slow_consumer_is_no_deadlock(perform: Any) -> None:
    """A full queue before a consumer that is at work holds its producer back, and that is all."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        asks, node = graph.add(Asks(count=6), name="asks"), graph.add(slow(), name="node")
        graph.connect(asks.request, node.number, capacity=1)
        graph.connect(node.out, graph.add(Ear(), name="ear").hear)
        graph.start.activates(asks.begin)
        return graph

    found = perform(build, lambda seen: (len(sent(seen, "node.out -> ear.hear")), seen.of(QueueGrown), seen.outcome))
    assert found == (7, [], "done")  # six answers and END (F13)


class Gives(hfg.Node):
    """Answers each signal by several."""

    back = hfg.Event(int)

    @hfg.slot
    def hear(self, number: int) -> None:
        for _ in range(3):
            self.back.trigger(number)


@pytest.mark.rule("F8")
@pytest.mark.parametrize(
    ("there", "back", "order", "grown"),
    [
        pytest.param(2, 3, "tb", ("asks.request -> gives.hear", 3), id="the smallest"),
        pytest.param(3, 2, "tb", ("gives.back -> asks.answer", 3), id="the smallest, the other way round"),
        pytest.param(3, 3, "tb", ("asks.request -> gives.hear", 4), id="of equals the one created first"),
        pytest.param(
            3, 3, "bt", ("gives.back -> asks.answer", 4), id="of equals the one created first, the other way round"
        ),
    ],
)
@BESIDE
def test_the_smallest_full_queue_of_the_ring_grows(
    perform: Any, there: int, back: int, order: str, grown: tuple[str, int], what: str
) -> None:
    """`asks` asks 5 times, `gives` answers the first 3 times: the queues hold 4 and 3, and both nodes are held."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        asks, gives = graph.add(Asks(count=5), name="asks"), graph.add(Gives(), name="gives")
        for letter in order:
            if letter == "t":
                graph.connect(asks.request, gives.hear, capacity=there)
            else:
                graph.connect(gives.back, asks.answer, capacity=back)
        graph.connect(asks.answered, graph.add(Ear(), name="ear").hear, capacity=100)
        graph.start.activates(asks.begin)
        beside(graph, what)
        return ended(graph)

    def read(seen: Recorder) -> Any:
        first = seen.of(QueueGrown)[0]
        return (first.edge, first.capacity), len(sent(seen, ANSWERS))

    assert perform(build, read) == (grown, 15)


@pytest.mark.rule("F8")
@BESIDE
def test_two_rings_are_two_deadlocks(perform: Any, what: str) -> None:
    """Each ring is resolved by itself, by its own queue."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        for letter in "ab":
            asks, node = graph.add(Asks(count=4), name=f"asks_{letter}"), graph.add(plain(), name=f"node_{letter}")
            graph.connect(asks.request, node.number, capacity=2 if letter == "a" else 3)
            graph.connect(node.out, asks.answer)
            graph.connect(asks.answered, graph.add(Ear(), name=f"ear_{letter}").hear, capacity=100)
            graph.start.activates(asks.begin)
        beside(graph, what)
        return ended(graph)

    def read(seen: Recorder) -> Any:
        grown = sorted((event.edge, event.capacity) for event in seen.of(QueueGrown))
        return grown, *(len(sent(seen, f"asks_{letter}.answered -> ear_{letter}.hear")) for letter in "ab")

    a, b = "asks_a.request -> node_a.number", "asks_b.request -> node_b.number"
    assert perform(build, read) == ([(a, 3), (a, 4), (b, 4)], 4, 4)


@pytest.mark.rule("F8")
@BESIDE
def test_a_capacity_limit_makes_it_a_failure(perform: Any, what: str) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        asks, node = graph.add(Asks(count=8), name="asks"), graph.add(plain(), name="node")
        graph.connect(asks.request, node.number, capacity=2, capacity_limit=4)
        graph.connect(node.out, asks.answer)
        graph.start.activates(asks.begin)
        beside(graph, what)
        return ended(graph)

    found = perform(build, lambda seen: ([event.capacity for event in seen.of(QueueGrown)], seen.outcome))
    assert found == ([3, 4], "failed")


class Pumps(hfg.Node):
    """A task that triggers without end, as rule F8 asks it to: it awaits."""

    request = hfg.Event(int)
    answered = hfg.Event(int)

    def setup(self) -> None:
        self.start_soon(self._pump())

    async def _pump(self) -> None:
        for number in range(12):
            await self.request.trigger_wait(number)

    @hfg.slot
    def answer(self, number: int) -> None:
        self.answered.trigger(number)


@pytest.mark.rule("F8")
@BESIDE
@pytest.mark.parametrize("concurrency", [1, 3])
def test_a_task_that_awaits_its_triggers_gets_all_its_answers(perform: Any, what: str, concurrency: int) -> None:
    def build() -> hfg.Graph:
        graph = hfg.Graph()
        asks = graph.add(Pumps(), name="asks")
        node = graph.add(slow(), name="node", concurrency=concurrency)
        graph.connect(asks.request, node.number, capacity=2)
        graph.connect(node.out, asks.answer)
        graph.connect(asks.answered, graph.add(Ear(), name="ear").hear, capacity=100)
        beside(graph, what)
        return ended(graph)

    found = perform(build, lambda seen: [value for _, value in sent(seen, ANSWERS)])
    assert found == list(range(12))


@pytest.mark.rule("F8", "F1")
@BESIDE
def test_a_ring_that_a_source_outside_of_it_can_still_move_is_none(perform: Any, what: str) -> None:
    """`node` waits for a second input that a slow source fills: it does not wait for the ring alone, nothing grows."""

    def build() -> hfg.Graph:
        graph = hfg.Graph()
        asks, node = graph.add(Asks(count=3), name="asks"), graph.add(joined(), name="node")
        graph.connect(asks.request, node.number, capacity=2)
        graph.connect(graph.add(ticker(every_s=1.0), name="pace").out, node.pace)
        graph.connect(node.out, graph.add(Ear(), name="ear").hear)
        graph.start.activates(asks.begin)
        beside(graph, what)
        return ended(graph, 10.5)

    found = perform(
        build, lambda seen: ([time for time, _ in sent(seen, "node.out -> ear.hear")][:3], seen.of(QueueGrown))
    )
    assert found == ([1, 2, 3], [])


@hfg.node
def joined(number: int, pace: int) -> int:
    return number
