"""Programs that meet by a name: two graphs on one loop in virtual time, over a network in memory that can be bad."""

from __future__ import annotations

import asyncio
import itertools
import re
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from contextlib import asynccontextmanager
from typing import Any, NamedTuple

import pytest

import hfg
from hfg.links.offers import introduce
from hfg.nodes.links import Publish, Subscribe
from hfg_transports.memory import Faults, Network, transport

_networks = itertools.count()


class World(NamedTuple):
    """A network of a test's own, by its name."""

    settings: str
    network: Network


@pytest.fixture
def world() -> World:
    name = f"{__name__} {next(_networks)}"
    return World(name, transport.network(name))


@hfg.node
def numbers(*, to: int = 10, begin: int = 0) -> Iterator[int]:
    yield from range(begin, to)


@hfg.node
def anything(*, to: int = 3) -> Iterator[Any]:
    yield from range(to)


class View(hfg.Node):
    """Writes down what comes and when, and takes its time for each."""

    value = hfg.Input(int)
    pause_s = hfg.Parameter(0.0)
    seen = hfg.State(factory=list[int])
    when = hfg.State(factory=list[float])
    stamps = hfg.State(factory=list[float])

    async def process(self, value: hfg.Token[int]) -> None:
        self.seen.append(value.value)
        self.when.append(round(hfg.now(), 6))
        self.stamps.append(round(value.stamp, 6))
        await asyncio.sleep(self.pause_s)


class Program:
    """A graph that publishes or subscribes, run as a task of its own."""

    def __init__(self, graph: hfg.Graph, end: Publish | Subscribe, view: View | None = None) -> None:
        self.graph = graph
        self.end = end
        self.view = view
        self.task: asyncio.Task[hfg.Report] | None = None

    def start(self) -> Program:
        self.task = asyncio.create_task(hfg.run_async(self.graph))
        return self

    async def report(self) -> hfg.Report:
        assert self.task is not None
        return await self.task

    async def stop(self) -> None:
        if self.task is not None and not self.task.done():
            self.task.cancel()
            await asyncio.wait([self.task])

    @property
    def seen(self) -> list[int]:
        assert self.view is not None
        return self.view.seen

    @property
    def counts(self) -> dict[str, int]:
        return self.end.statistics()


def camera(world: World, *, rate: float | None = 10, to: int = 10, begin: int = 0, **how: Any) -> Program:
    graph = hfg.Graph("camera")
    source = graph.add(numbers(to=to, begin=begin), max_rate_hz=rate)
    return Program(graph, hfg.publish("camera/front", source.out, settings=world.settings, **how))


def viewer(world: World, *, pause_s: float = 0, **how: Any) -> Program:
    graph = hfg.Graph("viewer")
    view = graph.add(View(pause_s=pause_s))
    return Program(graph, hfg.subscribe("camera/front", view.value, settings=world.settings, **how), view)


@asynccontextmanager
async def running(*programs: Program) -> AsyncIterator[None]:
    """End whatever of them still runs."""
    try:
        yield
    finally:
        for one in programs:
            await one.stop()


def play(scene: Callable[[], Coroutine[Any, Any, None]]) -> None:
    """Play a test in virtual time, a minute of it at most."""

    async def limited() -> None:
        async with asyncio.timeout(60):
            await scene()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(limited())


# --- coming and going ---


@pytest.mark.rule("L1", "L2", "T4", "T5")
@pytest.mark.parametrize("first", ["camera", "viewer"])
def test_programs_meet_in_any_order_and_every_value_crosses_with_its_stamp_and_the_end(
    world: World, first: str
) -> None:
    async def scene() -> None:
        one, other = camera(world, absent="wait"), viewer(world)
        for program in (one, other) if first == "camera" else (other, one):
            program.start()
            await asyncio.sleep(1.05)
        assert (await other.report()).outcome == (await one.report()).outcome == "done"
        assert other.seen == list(range(10))
        assert other.view is not None
        # A camera that waits stands with its first picture, and the next is due at once: the grid has gone on (F11).
        assert other.view.stamps[:3] == ([0.0, 1.05, 1.1] if first == "camera" else [1.05, 1.15, 1.25])

    play(scene)


@pytest.mark.rule("L3")
def test_values_that_nobody_has_subscribed_to_pass_by_and_are_counted_and_who_comes_late_gets_the_rest(
    world: World,
) -> None:
    async def scene() -> None:
        one, late = camera(world).start(), viewer(world)
        await asyncio.sleep(0.55)
        late.start()
        await late.report()
        await one.report()
        assert late.seen == [6, 7, 8, 9]
        assert (one.counts["passed"], one.counts["sent"]) == (6, 5)  # the end is sent, too

    play(scene)


def test_who_comes_late_may_begin_with_the_latest_value(world: World) -> None:
    async def scene() -> None:
        one, late = camera(world).start(), viewer(world, latest=True)
        await asyncio.sleep(0.55)
        late.start()
        await late.report()
        await one.report()
        assert late.seen == [5, 6, 7, 8, 9]
        assert late.view is not None
        assert late.view.when[0] == 0.55

    play(scene)


@pytest.mark.rule("L1", "P4")
def test_a_slow_subscriber_that_wants_all_holds_the_publisher_up(world: World) -> None:
    async def scene() -> None:
        one, slow = camera(world, rate=None, to=40, absent="wait", window=3), viewer(world, pause_s=1.0, capacity=2)
        async with running(one, slow):
            one.start()
            slow.start()
            await asyncio.sleep(10.5)
            assert slow.seen == list(range(11))
            assert one.counts["sent"] == 13  # three are on their way: one is worked on, two wait
            await slow.report()
            assert slow.seen == list(range(40))

    play(scene)


@pytest.mark.rule("P5")
def test_a_slow_subscriber_that_wants_the_latest_holds_nobody_up_and_counts_what_it_has_missed(world: World) -> None:
    async def scene() -> None:
        one = camera(world, to=30, absent="wait").start()
        slow, fast = viewer(world, pause_s=1.0, overflow="latest").start(), viewer(world).start()
        await asyncio.gather(one.report(), slow.report(), fast.report())
        assert fast.seen == list(range(30))
        assert slow.seen[0] == 0
        assert [later - sooner for sooner, later in itertools.pairwise(slow.seen[:3])] == [9, 10]
        assert slow.counts["dropped"] == 30 - len(slow.seen) + (slow.counts["received"] - len(slow.seen))

    play(scene)


@pytest.mark.rule("L2", "L3")
def test_a_subscriber_that_dies_is_waited_for_as_long_as_the_lease(world: World) -> None:
    async def scene() -> None:
        one, dies, lives = camera(world, to=40, absent="wait"), viewer(world), viewer(world)
        async with running(one, dies, lives):
            for program in (one, dies, lives):
                program.start()
                await asyncio.sleep(0)
            await asyncio.sleep(0.55)
            world.network.cut(world.network.sessions[1])  # that nobody hears of it is known after a second
            await lives.report()
            assert lives.seen == list(range(lives.seen[0], 40))
            assert one.counts["left"] == 2
            assert lives.view is not None
            gaps = [later - sooner for sooner, later in itertools.pairwise(lives.view.when)]
            assert max(gaps) < 1.2

    play(scene)


@pytest.mark.rule("L2", "L3")
def test_with_absent_wait_an_heir_gets_all_that_a_dead_subscriber_had_not_done(world: World) -> None:
    async def scene() -> None:
        one = camera(world, rate=None, to=20, absent="wait").start()
        dies, heir = viewer(world, pause_s=1.0).start(), viewer(world)
        async with running(one, dies, heir):
            await asyncio.sleep(4.5)
            world.network.sessions[1].die()
            await dies.stop()
            assert dies.seen == [0, 1, 2, 3, 4]
            await asyncio.sleep(10)
            assert one.counts["passed"] == one.counts["lost"] == 0
            heir.start()
            await heir.report()
            await one.report()
            assert heir.seen == list(range(4, 20))  # what was worked on when it died comes again

    play(scene)


@pytest.mark.rule("L2", "L3")
def test_a_subscriber_waits_for_a_publisher_that_has_died_and_goes_on_with_the_next(world: World) -> None:
    async def scene() -> None:
        one, other, view = camera(world, to=1000), camera(world, begin=100, to=105, absent="wait"), viewer(world)
        async with running(one, other, view):
            view.start()
            await asyncio.sleep(1)
            one.start()
            await asyncio.sleep(0.45)
            world.network.sessions[1].die()
            await one.stop()
            await asyncio.sleep(5)
            assert view.task is not None
            assert not view.task.done()
            other.start()
            await view.report()
            assert view.seen == [1, 2, 3, 4, 100, 101, 102, 103, 104]  # 0 went by before they had met
            assert (view.counts["joined"], view.counts["left"]) == (2, 2)

    play(scene)


@pytest.mark.rule("F2", "L3")
def test_a_subscriber_may_end_when_its_publisher_has_gone(world: World) -> None:
    async def scene() -> None:
        one, view = camera(world, to=1000), viewer(world, if_gone="end")
        async with running(one, view):
            view.start()
            one.start()
            await asyncio.sleep(2.05)
            world.network.sessions[1].die()
            await one.stop()
            assert (await view.report()).outcome == "done"
            assert view.seen[-1] == 20

    play(scene)


def test_a_subscriber_may_outlive_the_end_of_a_publisher(world: World) -> None:
    async def scene() -> None:
        view = viewer(world, at_end="wait").start()
        async with running(view):
            for begin in (0, 100):
                await camera(world, begin=begin, to=begin + 3, absent="wait").start().report()
            await asyncio.sleep(1)
            assert view.seen == [0, 1, 2, 100, 101, 102]

    play(scene)


@pytest.mark.rule("L2")
def test_a_cut_and_its_healing_hold_up_and_lose_nothing_when_the_publisher_waits(world: World) -> None:
    async def scene() -> None:
        one, view = camera(world, to=60, absent="wait").start(), viewer(world)
        async with running(one, view):
            await asyncio.sleep(0.5)
            view.start()
            for _ in range(3):
                await asyncio.sleep(1.0)
                world.network.cut()
                await asyncio.sleep(0.5)  # less than the lease
                world.network.heal()
            await view.report()
            assert view.seen == list(range(60))

    play(scene)


@pytest.mark.rule("L2")
def test_a_bad_network_changes_nothing_for_who_wants_all(world: World) -> None:
    async def scene() -> None:
        world.network.faults = Faults(loss=0.3, repetition=0.1, delay_s=(0.0, 0.02))
        one, view = camera(world, to=200, rate=None, absent="wait").start(), viewer(world).start()
        await asyncio.gather(one.report(), view.report())
        assert view.seen == list(range(200))
        assert one.counts["resent"] > 0

    play(scene)


def test_an_end_that_is_lost_on_its_way_is_heard_of_when_the_publisher_goes(world: World) -> None:
    async def scene() -> None:
        one, view = camera(world, absent="wait").start(), viewer(world, overflow="drop_oldest").start()
        await asyncio.sleep(0.55)
        world.network.faults = Faults(loss=1.0)
        await asyncio.gather(one.report(), view.report())
        assert view.seen == [0, 1, 2, 3, 4, 5]

    play(scene)


def test_a_run_that_waits_for_the_other_side_stops_at_once(world: World) -> None:
    async def scene() -> None:
        before = asyncio.get_running_loop().time()
        one, view = camera(world, absent="wait").start(), viewer(World("another", world.network)).start()
        await asyncio.sleep(1)
        await one.stop()
        await view.stop()
        assert asyncio.get_running_loop().time() == before + 1
        assert world.network.sessions == ()

    play(scene)


# --- who fits whom ---


@pytest.mark.rule("L4")
def test_types_that_differ_are_told_at_both_ends_and_nothing_crosses(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    async def scene() -> None:
        graph = hfg.Graph("wrong")
        wrong = Program(graph, hfg.subscribe("camera/front", graph.output("out", str), settings=world.settings))
        one = camera(world)
        async with running(one, wrong):
            wrong.start()
            one.start()
            assert (await one.report()).outcome == "done"
            assert (one.counts["refused"], one.counts["passed"], wrong.counts["refused"]) == (1, 10, 1)

    play(scene)
    here, there = sorted(caplog.messages)
    who = r"\(process \d+ on [^)]+\)"
    remedy = "declare the same type at both ends"
    assert re.fullmatch(
        f'"camera/front" is not sent to "wrong" {who}: the types differ: int here, str there; {remedy}', here
    )
    assert re.fullmatch(
        f'"camera/front" of "camera" {who} is not taken: the types differ: str here, int there; {remedy}', there
    )


def test_two_publishers_of_one_name_are_told_and_the_second_stands_by(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    async def scene() -> None:
        view = viewer(world, at_end="wait").start()
        one, other = camera(world, to=20).start(), camera(world, begin=100, to=130)
        async with running(one, other, view):
            await asyncio.sleep(1)
            other.start()
            await one.report()
            await other.report()
            await asyncio.sleep(1)
            assert view.seen == [*range(1, 20), *range(111, 130)]

    play(scene)
    told = [message for message in caplog.messages if "is published twice" in message]
    assert len(told) == 3  # both publishers and the subscriber, each once
    assert all("rename or stop one of them" in message for message in told)


def test_who_wants_every_value_is_refused_by_who_waits_for_nobody(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    async def scene() -> None:
        one, view = camera(world, lossless=False), viewer(world)
        async with running(one, view):
            view.start()
            await one.start().report()
            assert view.seen == []

    play(scene)
    assert any('this end wants every value; subscribe with overflow="latest"' in one for one in caplog.messages)
    assert any(
        'the subscriber wants every value; subscribe there with overflow="latest"' in one for one in caplog.messages
    )


@pytest.mark.rule("L4")
def test_whatever_strangers_announce_below_the_name_harms_nobody(world: World) -> None:
    async def scene() -> None:
        stranger = await world.network.open()
        base = "hfg/named/camera/front"
        nonsense = introduce(int, "x", lossless=True)[:-3]
        for name in ("a/offer", "a/join b", "a/join ", "a/b/offer", "offer", "a/strange", "a/end"):
            stranger.announce(f"{base}/{name}", nonsense)
        stranger.announce("hfg/named/camera/front/left/f/offer", introduce(str, "x", lossless=True))
        one, view = camera(world, absent="wait").start(), viewer(world).start()
        await asyncio.gather(one.report(), view.report())
        assert view.seen == list(range(10))
        assert stranger.failed == 0

    play(scene)


# --- in the graph ---


@pytest.mark.rule("T1", "A7")
def test_activity_does_not_cross_for_an_active_edge_belongs_to_one_graph(world: World) -> None:
    async def scene() -> None:
        sending, receiving = hfg.Graph("camera"), hfg.Graph("viewer")
        source = sending.add(numbers(), max_rate_hz=10)
        end = sending.add(Publish(name="camera/front", settings=world.settings, absent="wait"))
        sending.connect(sending.start, source.activate)
        sending.connect(source.out, end.value, active=True)
        start = receiving.add(Subscribe(name="camera/front", settings=world.settings))
        view = receiving.add(View())
        receiving.connect(start.out, view.value, active=True)
        async with hfg.running(receiving) as received, hfg.running(sending) as sent:
            await asyncio.sleep(0.5)
            assert view.seen
            assert (end.active, start.active, view.active) == (True, False, False)
            await sent.wait_finished()
            await received.wait_finished()

    play(scene)


def test_events_are_published_and_slots_are_told(world: World) -> None:
    class Beacon(hfg.Node):
        beat = hfg.Event(int)

        async def process(self) -> None:
            await asyncio.sleep(1)
            self.beat.trigger(7)
            raise hfg.EndOfStream

    class Hears(hfg.Node):
        heard = hfg.State(factory=list[int])

        @hfg.slot
        def hear(self, value: int) -> None:
            self.heard.append(value)

    async def scene() -> None:
        sending, hearing = hfg.Graph("beacon"), hfg.Graph("ear")
        beacon, ear = sending.add(Beacon()), hearing.add(Hears())
        hfg.publish("beat", beacon.beat, settings=world.settings, absent="wait")
        hfg.subscribe("beat", ear.hear, settings=world.settings)
        await asyncio.gather(hfg.run_async(sending), hfg.run_async(hearing))
        assert ear.heard == [7]

    play(scene)


def test_one_graph_may_publish_and_subscribe(world: World) -> None:
    graph = hfg.Graph()
    source = graph.add(numbers())
    hfg.publish("loop", source.out, settings=world.settings, absent="wait")
    hfg.subscribe("loop", graph.output("out", int), settings=world.settings)
    assert hfg.run(graph, clock="virtual").outputs == {"out": list(range(10))}


def test_a_graph_with_named_links_is_sound_and_can_be_made_again(world: World) -> None:
    for program in (camera(world), viewer(world)):
        assert [problem for problem in program.graph.check() if problem.severity != "hint"] == []
    graph = hfg.Graph()
    graph.edit(hfg.commands.Add("hfg.nodes.links:Subscribe", "subscribe", parameters={"name": "camera/front"}))
    assert isinstance(graph.nodes["subscribe"], Subscribe)


# --- bad input ---


def refused(graph: hfg.Graph) -> str:
    with pytest.raises(hfg.errors.NodeError) as caught:
        hfg.run(graph, clock="virtual")
    return str(caught.value)


@pytest.mark.rule("L4")
def test_a_port_of_any_type_cannot_be_published_and_is_named_before_anything_is_sent() -> None:
    graph = hfg.Graph()
    hfg.publish("things", graph.add(anything()).out)
    assert (
        'UsageError: "things" cannot be published by "publish": a value of "anything.out" cannot be sent: Any'
        in refused(graph)
    )


def test_a_node_that_nobody_is_connected_to_has_no_type() -> None:
    graph = hfg.Graph()
    graph.add(Subscribe(name="things"))
    assert (
        '"things" cannot be subscribed to by "subscribe": it is connected to no port that would say the type; '
        "connect it, or remove it" in refused(graph)
    )


def test_targets_of_several_types_are_named() -> None:
    graph = hfg.Graph()
    hfg.subscribe("things", graph.output("a", int), graph.output("b", str))
    assert '"a" is of type int and "b" of str; take a node for each type' in refused(graph)


@pytest.mark.parametrize("name", ["", "/camera", "camera//front", "x" * 401])
def test_what_is_no_name_is_refused_when_it_is_said(name: str) -> None:
    graph = hfg.Graph()
    source = graph.add(numbers())
    with pytest.raises(
        hfg.errors.UsageError, match='is not a valid name for publishing: write words with "/" between them'
    ):
        hfg.publish(name, source.out)
    assert list(graph.nodes) == ["numbers"]


def test_ports_that_are_none_or_in_no_graph_are_refused() -> None:
    with pytest.raises(hfg.errors.UsageError, match="does not belong to a graph yet; add its node with graph.add"):
        hfg.publish("camera", numbers().out)
    with pytest.raises(hfg.errors.UsageError, match="is not a port; add its node"):
        hfg.publish("camera", 3)  # type: ignore[arg-type]
    with pytest.raises(
        hfg.errors.UsageError, match="subscribed to without a port: pass the ports that receive the values"
    ):
        hfg.subscribe("camera")


def test_a_transport_that_is_not_there_is_named(world: World) -> None:
    graph = hfg.Graph()
    hfg.publish("camera", graph.add(numbers()).out, transport="pigeon")
    assert 'no transport is called "pigeon"; installed are: local, memory, zenoh' in refused(graph)
