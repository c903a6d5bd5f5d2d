"""The life of a connection in a graph, in virtual time: activity, loss, back-off, back-pressure, counts."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any, ClassVar

import pytest

import hfg
from hfg.errors import RunError, UsageError
from hfg.nodes import buses
from hfg.nodes.buses._connection import Sender
from hfg.nodes.buses._failures import Refused
from tests.nodes.buses_outside import Seen, heard, sent, texts


class World:
    """The other side: answers while it is up, and says what it is told to say."""

    def __init__(self, *, up: bool = True) -> None:
        self.up = up
        self.refuses = ""
        self.heard: list[bytes] = []
        self.says: asyncio.Queue[bytes | None] = asyncio.Queue()
        self.broken = asyncio.Event()
        self.attempts: list[float] = []
        self.open = 0

    def break_off(self) -> None:
        self.broken.set()
        self.broken = asyncio.Event()


class Radio(Sender):
    """Speaks with a `World`."""

    received = hfg.Event(Any)
    invalid = hfg.Event(str)
    is_real: ClassVar[bool] = False
    world: ClassVar[World]

    def address(self) -> str:
        return "radio://tower"

    @asynccontextmanager
    async def link(self) -> AsyncIterator[World]:
        self.world.attempts.append(round(hfg.elapsed(), 3))
        if self.world.refuses:
            raise Refused(self.world.refuses)
        if not self.world.up:
            raise ConnectionRefusedError(111, "refused")
        self.world.open += 1
        try:
            yield self.world
        finally:
            self.world.open -= 1

    async def read(self, link: World) -> str:
        broken = asyncio.create_task(link.broken.wait())
        try:
            while True:
                said = asyncio.create_task(link.says.get())
                await asyncio.wait({broken, said}, return_when=asyncio.FIRST_COMPLETED)
                if not said.done():
                    said.cancel()
                    raise ConnectionResetError(104, "reset")
                message = said.result()
                if message is None:
                    return "over"
                await self.hear(message, self.form, self.received)
        finally:
            broken.cancel()

    async def write(self, link: World, message: bytes) -> None:
        await asyncio.sleep(0.01)
        if not link.up:
            raise BrokenPipeError(32, "broken")
        link.heard.append(message)


class Mode(hfg.Node):
    """A state of the graph."""

    @hfg.slot
    def enter(self, value: Any) -> None: ...


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> World:
    made = World()
    monkeypatch.setattr(Radio, "world", made, raising=False)
    return made


def tell(graph: hfg.Graph, at_s: float, what: Any) -> None:
    """Do something to the world at a moment of the run."""

    class Teller(hfg.Node):
        def setup(self) -> None:
            self.start_soon(self.work())

        async def work(self) -> None:
            await asyncio.sleep(at_s)
            what()

    graph.add(Teller())


def test_without_activity_it_is_connected_for_the_whole_run_and_ends_when_all_is_said(world: World) -> None:
    graph = hfg.Graph()
    radio = graph.add(Radio())
    graph.connect(graph.add(texts(to=3)).out, radio.message)
    report = hfg.run(graph, clock="virtual")
    assert report.outcome == "done"
    assert world.heard == [b"0", b"1", b"2"]
    assert world.open == 0
    assert report.nodes["radio"].own == {"connections": 1, "sent": 3}
    assert "radio: 1 connections, 3 sent" in str(report)


@pytest.mark.rule("A15")
def test_with_activity_it_lives_as_long_as_the_node_is_active(world: World) -> None:
    graph = hfg.Graph()
    radio, mode = graph.add(Radio(), active_for_s=5), graph.add(Mode())
    graph.connect(graph.add(texts(to=10), max_rate_hz=1).out, radio.message)
    graph.start.activates(radio.activate)
    graph.connect(radio.timeout, mode.enter, active=True)
    report = hfg.run(graph, clock="virtual")
    assert report.nodes["mode"].active
    assert world.open == 0
    assert world.heard == [b"0", b"1", b"2", b"3", b"4"]
    assert report.nodes["radio"].own == {"connections": 1, "sent": 5, "ignored": 5}


def test_a_lost_connection_is_made_again_with_pauses_and_nothing_is_lost(world: World) -> None:
    graph = hfg.Graph()
    radio = graph.add(Radio())
    graph.connect(graph.add(texts(to=20), max_rate_hz=1).out, radio.message)
    connected, disconnected = heard(graph, radio.connected, radio.disconnected)

    def fall() -> None:
        world.up = False
        world.break_off()

    tell(graph, 5.5, fall)
    tell(graph, 10.5, lambda: setattr(world, "up", True))
    report = hfg.run(graph, clock="virtual")
    assert world.heard == [str(number).encode() for number in range(20)]
    assert len(connected.seen) == 2
    assert disconnected.seen == [
        "radio://tower: the other side has broken the connection off",
        "radio://tower: nothing listens there; start the server, or correct the address",
    ]
    waits = [later - sooner for sooner, later in zip(world.attempts[1:], world.attempts[2:], strict=False)]
    assert waits == sorted(waits)
    assert report.nodes["radio"].own == {"connections": 2, "sent": 20, "lost connections": 1}


def test_what_was_being_said_when_it_broke_is_said_again(world: World) -> None:
    graph = hfg.Graph()
    radio = graph.add(Radio())
    sent(graph, radio.message, ["a", "b"])
    tell(graph, 0.005, world.break_off)
    report = hfg.run(graph, clock="virtual")
    assert world.heard == [b"a", b"b"]
    assert report.nodes["radio"].own["said again"] == 1


def test_values_can_pass_while_there_is_no_connection_and_are_counted(world: World) -> None:
    world.up = False
    graph = hfg.Graph()
    radio = graph.add(Radio(absent="pass"))
    graph.connect(graph.add(texts(to=5), max_rate_hz=1).out, radio.message)
    tell(graph, 2.5, lambda: setattr(world, "up", True))
    report = hfg.run(graph, clock="virtual")
    own = report.nodes["radio"].own
    assert own["sent"] == len(world.heard) > 0
    assert own["sent"] + own["not sent"] == 5


@pytest.mark.rule("F8")
def test_a_slow_graph_slows_the_reader(world: World) -> None:
    graph = hfg.Graph()
    radio = graph.add(Radio())
    slow = graph.add(Seen(pause_s=1.0))
    graph.connect(radio.received, slow.value, capacity=4)
    for number in range(100):
        world.says.put_nowait(str(number).encode())
    report = hfg.run(graph, clock="virtual", until_s=10.5)
    assert slow.seen == [str(number) for number in range(10)]
    assert report.edges["radio.received -> seen.value"].sent <= 15
    assert world.says.qsize() > 80


@pytest.mark.rule("A15")
def test_an_orderly_end_completes_and_leads_the_activity_on(world: World) -> None:
    graph = hfg.Graph()
    radio, mode = graph.add(Radio()), graph.add(Mode())
    seen = graph.add(Seen())
    graph.connect(radio.received, seen.value)
    graph.start.activates(radio.activate)
    graph.connect(radio.completed, mode.enter, active=True)
    for message in (b"hello", None):
        world.says.put_nowait(message)
    report = hfg.run(graph, clock="virtual")
    assert report.nodes["mode"].active
    assert seen.seen == ["hello"]


@pytest.mark.rule("X1")
def test_a_refusal_is_an_error_in_one_sentence(world: World) -> None:
    world.refuses = "the password is wrong"
    graph = hfg.Graph()
    graph.add(Radio())
    with pytest.raises(RunError, match="radio://tower: the password is wrong"):
        hfg.run(graph, clock="virtual")
    assert len(world.attempts) == 1


@pytest.mark.rule("X1")
def test_the_activity_goes_where_the_graph_says_when_a_connection_fails(world: World) -> None:
    world.up = False
    graph = hfg.Graph()
    radio, fallback = graph.add(Radio(attempts=3), on_error="skip"), graph.add(Mode())
    graph.start.activates(radio.activate)
    graph.connect(radio.failed, fallback.enter, active=True)
    report = hfg.run(graph, clock="virtual")
    assert report.nodes["mode"].active
    assert not report.nodes["radio"].active
    assert len(world.attempts) == 3
    assert "nothing listens there; start the server, or correct the address (3 attempts)" in report.errors[0]


def test_a_message_that_cannot_be_read_is_told_and_the_next_one_is_heard(world: World) -> None:
    graph = hfg.Graph()
    radio = graph.add(Radio(form="json"))
    received, invalid = heard(graph, radio.received, radio.invalid)
    for message in (b"[1", b"[1]", None):
        world.says.put_nowait(message)
    report = hfg.run(graph, clock="virtual")
    assert received.seen == [[1]]
    assert len(invalid.seen) == 1
    assert report.nodes["radio"].own["invalid"] == 1


def test_in_virtual_time_a_real_connection_is_refused_with_the_remedy() -> None:
    graph = hfg.Graph()
    graph.add(buses.TcpClient())
    with pytest.raises((UsageError, RunError), match='virtual time does not wait for: run it with clock="real"'):
        hfg.run(graph, clock="virtual")
