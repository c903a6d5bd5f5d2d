"""Rows of calls: nodes that live by slots which events feed have their turns one after the other, with no look between.

Whatever they do, it is what single turns would do, in the same order; and what is to come between two turns comes.
Rules F8, F9, R2, R3, R6.
"""

from __future__ import annotations

import asyncio
import contextlib
from random import Random
from typing import Any

import pytest

import hfg
from hfg import commands
from hfg.engine.model.groups import Group
from hfg.engine.runtime import settings
from tests.semantics.nodes import forward


@pytest.fixture(autouse=True)
def nobody_looks_at_each_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings, "CHECK_ALL", False)  # which sees each turn by itself


class Seen(list[tuple[str, str, int]]):
    """Calls in their order: which node, which slot, which value."""


class Relay(hfg.Node):
    """Answer each signal by as many as its turn allows, and note it."""

    signal, other = hfg.Event(int), hfg.Event(int)
    ways = hfg.Parameter(1)
    seen: Seen

    def note(self, slot: str, value: int) -> None:
        """Somebody is told of it."""
        self.seen.append((self.place.name, slot, value))

    @hfg.slot
    def take(self, value: int) -> None:
        """Pass on, by one event or by both, or not at all where it is the last."""
        self.note("take", value)
        if value % 7 == 3 and self.ways == 3:
            raise ValueError(value)
        if value:
            self.signal.trigger(value - 1)
            if self.ways > 1 and value % 3 == 0:
                self.other.trigger(value // 2)

    @hfg.slot
    def also(self, value: int) -> None:
        """Pass on by the other event alone."""
        self.note("also", value)
        if value:
            self.other.trigger(value - 1, activity=1 if value % 5 == 0 else None)


class Waiting(Relay):
    """One of whose slots may take its time."""

    @hfg.slot
    async def later(self, value: int) -> None:
        """Pass on when others have had their turn, now and then."""
        self.note("later", value)
        if value % 2:
            await asyncio.sleep(0)
        if value:
            self.signal.trigger(value - 1)


KINDS: tuple[type[Relay], ...] = (Relay, Relay, Relay, Waiting)
CAPACITIES = (1, 2, 3, 16, 16)


class Begin(hfg.Node):
    """Trigger several signals at once, as the first thing in a run."""

    signal = hfg.Event(int)

    @hfg.slot
    def begin(self) -> None:
        """Now."""
        for value in (4, 7, 5, 6):
            self.signal.trigger(value)


class Pulses(hfg.Node):
    """A source whose turns are amid those of the slots: it sends numbers by its output, by its event, or by both."""

    out, signal = hfg.Output(int), hfg.Event(int)
    count = hfg.Parameter(5)
    ways = hfg.Parameter(1)
    seen: Seen

    def process(self) -> None:
        """Count down."""
        if not self.count:
            raise hfg.EndOfStream
        self.count -= 1
        self.seen.append((self.place.name, "process", self.count))
        if self.ways & 1:
            self.signal.trigger(self.count % 5)
        if self.ways & 2 and self.count % 4:
            self.out.send(self.count % 6)


def begun_at(graph: hfg.Graph, *slots: Any) -> None:
    """Let a graph of slots have something to do."""
    begin = graph.add(Begin())
    graph.start.activates(begin.begin)
    for slot in slots:
        graph.connect(begin.signal, slot, active=slot is slots[0])


def drawn(seed: int) -> tuple[hfg.Graph, Seen]:
    """A graph of nodes that live by their slots, of which one at most may wait, and what they will note."""
    random, seen, kinds = Random(seed), Seen(), list(KINDS)
    graph = hfg.Graph()
    nodes: list[Any] = []
    for _ in range(random.randint(2, 6)):
        kind = random.choice(kinds)
        if kind is Waiting:  # of several that wait at a moment any may be first (R2)
            kinds.remove(Waiting)
        node = kind(ways=random.randint(1, 3))
        node.seen = seen
        nodes.append(graph.add(node, on_error="skip"))
    for node in nodes:
        for event in (node.signal, node.other):
            for target in random.sample(nodes, random.choice((0, 1, 1, 1, 2))):
                slot = random.choice([target.take, target.later if isinstance(target, Waiting) else target.also])
                graph.connect(event, slot, active=random.random() < 0.3, capacity=random.choice(CAPACITIES))
    begun_at(graph, *(node.take for node in random.sample(nodes, random.randint(1, 2))))
    for _ in range(random.choice((0, 0, 1, 2))):
        source: Any = graph.add(Pulses(count=random.randint(1, 20), ways=random.randint(1, 3)))
        source.seen = seen
        for port in (source.signal, source.out):
            graph.connect(port, random.choice(nodes).take, active=random.random() < 0.2)
    return graph, seen


@pytest.fixture
def rows(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many turns each row of calls has had beyond its first."""
    found: list[int] = []
    spend = Group.spend

    def noted(group: Group[Any], more: int) -> None:
        found.append(more)
        spend(group, more)

    monkeypatch.setattr(Group, "spend", noted)
    return found


@pytest.mark.slow
@pytest.mark.rule("R2", "F8", "F9")
@pytest.mark.parametrize("block", range(8))
def test_rows_of_calls_do_what_single_turns_do_in_the_same_order(
    block: int, rows: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where full queues hold nodes back: who goes on takes its place when it may."""
    for seed in range(25 * block, 25 * block + 25):
        monkeypatch.setattr(settings, "FUSE_AFTER", seed % 3)
        done = []
        for fast in (True, False):
            graph, seen = drawn(seed)
            done.append((hfg.run(graph, clock="virtual", fast=fast), seen))
        assert done[0] == done[1], f"seed {seed}"
    assert sum(rows) > 100


def ring(length: int) -> tuple[hfg.Graph, Seen, list[Any]]:
    """Relays in a ring, of which the first gets four signals that go round until they are used up."""
    graph, seen = hfg.Graph(), Seen()
    nodes = [graph.add(Relay(), name=f"relay{number}") for number in range(length)]
    for node, after in zip(nodes, (*nodes[1:], nodes[0]), strict=True):
        node.seen = seen
        graph.connect(node.signal, after.take)
    begun_at(graph, nodes[0].take)
    return graph, seen, nodes


@pytest.mark.rule("R3")
def test_a_step_is_one_call_however_many_wait_for_theirs() -> None:
    graph, seen, nodes = ring(3)

    async def main() -> None:
        async with hfg.running(graph) as run:
            run.pause()
            await run.step(graph["begin"])
            for calls in (1, 2):
                await run.step(nodes[0])
                assert len(seen) == calls
            await run.step(nodes[1])
            assert seen[2:] == [("relay1", "take", 3)]
            run.resume()
            await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())


@pytest.mark.rule("R3", "R5")
@pytest.mark.parametrize("does", ["pause", "stop"])
def test_who_ends_the_turns_amid_a_row_ends_them_behind_the_call_under_way(does: str) -> None:
    graph, _, nodes = ring(4)
    running: list[Any] = []

    class Ending(Seen):
        def append(self, one: tuple[str, str, int]) -> None:
            super().append(one)
            if len(self) == 5:
                getattr(running[0], does)()

    seen = Ending()
    for node in nodes:
        node.seen = seen

    async def main() -> int:
        async with hfg.running(graph) as run:
            running.append(run)
            if does == "pause":
                await run.wait_paused()
                calls = len(seen)
                run.resume()
                await run.wait_finished()
                return calls
            await run.wait_finished()
            return len(seen)

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        assert runner.run(main()) == 5


@pytest.mark.rule("R2", "R6")
def test_the_loop_has_its_turn_amid_rows_as_often_as_amid_single_turns() -> None:
    """A ring that goes round for ever ends when what was to be called by the loop is; at the same call each time."""

    class Endless(hfg.Node):
        signal = hfg.Event(int)
        calls: list[int]

        @hfg.slot
        def take(self, value: int) -> None:
            if not self.calls:
                asyncio.get_running_loop().call_soon(lambda: self.calls.append(-1))
            if self.calls[-1:] != [-1]:
                self.calls.append(value)
                self.signal.trigger(value)

    def calls(*, fast: bool) -> int:
        graph, found = hfg.Graph(), list[int]()
        nodes = [graph.add(Endless()) for _ in range(5)]
        for node, after in zip(nodes, (*nodes[1:], nodes[0]), strict=True):
            node.calls = found
            graph.connect(node.signal, after.take)
        begun_at(graph, nodes[0].take)
        hfg.run(graph, clock="virtual", fast=fast)
        return len(found)

    assert calls(fast=True) == calls(fast=False)


@pytest.mark.rule("R2")
def test_rows_are_not_nested_however_long_they_are() -> None:
    """Nodes whose slots are fed by outputs, too, have steps of their own, which know of no rows."""

    class Counted(hfg.Node):
        signal = hfg.Event(int)

        @hfg.slot
        def take(self, value: int) -> None:
            if value:
                self.signal.trigger(value - 1)
            else:
                seen.append(value)

        @hfg.slot
        def also(self, value: int) -> None:
            self.signal.trigger(5_000 + value)

    graph, seen = hfg.Graph(), list[int]()
    nodes = [graph.add(Counted()) for _ in range(3)]
    source = graph.add(Pulses(count=2, ways=2))
    source.seen = Seen()
    for node, after in zip(nodes, (*nodes[1:], nodes[0]), strict=True):
        graph.connect(node.signal, after.take)
        if node is not nodes[2]:
            graph.connect(source.out, node.also)
    hfg.run(graph, clock="virtual")
    assert seen == [0, 0]


class Two(hfg.Node):
    """Two slots; what is done in a call of one of them is another's to say."""

    signal = hfg.Event(int)
    seen: Seen
    amid: Any = None

    @hfg.slot
    def take(self, value: int) -> None:
        self.seen.append((self.place.name, "take", value))
        if self.amid is not None and value == 6:
            self.amid()

    @hfg.slot
    def also(self, value: int) -> None:
        self.seen.append((self.place.name, "also", value))


@pytest.mark.rule("F9", "P10")
def test_a_call_from_outside_that_is_the_first_of_its_kind_and_comes_amid_a_call_is_made_behind_it() -> None:
    """As of a task that begins at once: it makes an edge, and so the order of calls another one (F9)."""
    graph, two = hfg.Graph(), Two()
    graph.add(two)
    two.seen = Seen()
    begun_at(graph, two.take)

    async def main() -> None:
        async with hfg.running(graph) as run:

            def amid() -> None:
                with contextlib.suppress(StopIteration):
                    run.trigger(two.also, 5).send(None)

            two.amid = amid
            await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    assert [slot for _, slot, _ in two.seen] == ["take", "take", "take", "take", "also"]


@pytest.mark.rule("R2", "R4")
def test_who_stood_in_the_queue_for_a_signal_that_an_edit_took_goes_first_for_one_token_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(settings, "CHECK_ALL", True)

    class First(hfg.Node):
        early, late = hfg.Event(int), hfg.Event(int)

        @hfg.slot
        def begin(self) -> None:
            self.early.trigger(1)
            self.late.trigger(2)
            running[0].pause()

    running: list[Any] = []
    graph, two = hfg.Graph(), Two()
    two.seen = Seen()
    first, relay = graph.add(First()), graph.add(forward())
    graph.add(two)
    graph.start.activates(first.begin)
    graph.connect(first.early, relay.value)
    graph.connect(first.late, two.take)
    graph.connect(relay.out, two.also)

    async def main() -> None:
        async with hfg.running(graph) as run:
            running.append(run)
            await run.wait_paused()
            await run.edit(commands.Disconnect("first.late", "two.take"))
            run.resume()
            await run.wait_finished()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    assert two.seen == [("two", "also", 1)]
