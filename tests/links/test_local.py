"""Straight from one process to another of the same host, beside a session (docs/links.md)."""

from __future__ import annotations

import asyncio
import itertools
import os
import random
import socket
import sys
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from typing import Any

import pytest

from hfg.errors import MessageTooLarge, TransportError
from hfg.links import local
from hfg.links.local import LocalEndpoint, LocalRoute
from hfg.links.running import LinkReceiver, LinkSender
from hfg.transport import Buffer, Closing, Message, Publisher, Receive, Traffic

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the sockets are Linux's")

LARGEST = 8 * 2**20
_numbers = itertools.count()


class Beside:
    """What carries what cannot go straight: it keeps that, and brings it nowhere."""

    largest_message = LARGEST

    def __init__(self) -> None:
        self.put: list[bytes] = []
        self.closed = 0

    def publisher(self, key: str, traffic: Traffic) -> Publisher:
        """See `Datagrams`."""
        return BesidePublisher(self)

    def subscribe(self, key: str, receive: Receive) -> Closing:
        """See `Datagrams`."""
        return BesidePublisher(self)


class BesidePublisher:
    """One that is told when it is closed."""

    def __init__(self, beside: Beside) -> None:
        self._beside = beside

    def put(self, header: bytes, payload: Buffer = b"") -> None:
        """See `Publisher`."""
        if self._beside.closed:
            raise TransportError("it is closed")
        if len(header) + len(payload) > LARGEST:
            raise MessageTooLarge("it is too long")
        self._beside.put.append(header)

    def close(self) -> None:
        """See `Publisher`."""
        self._beside.closed += 1


class Heard:
    """What has come, to be waited for."""

    def __init__(self) -> None:
        self.messages: list[tuple[bytes, Buffer]] = []
        self._more = asyncio.Event()

    def __call__(self, burst: list[Message]) -> None:
        assert burst
        self.messages += [(bytes(header), payload) for header, payload in burst]
        self._more.set()

    @property
    def headers(self) -> list[bytes]:
        return [header for header, _ in self.messages]

    async def wait(self, count: int) -> None:
        async with asyncio.timeout(10):
            while len(self.messages) < count:
                self._more.clear()
                await self._more.wait()


def name() -> str:
    return f"test/{os.getpid()}/{next(_numbers)}"


class Two:
    """An endpoint, and the way to it from another."""

    def __init__(self) -> None:
        self.there_is = name()
        self.there = LocalEndpoint(self.there_is, LARGEST)
        self.here = LocalEndpoint(name(), LARGEST)
        self.beside = Beside()
        self.route = LocalRoute(self.here, self.beside, self.there_is)
        self.heard = Heard()
        self.there.subscribe("a key", self.heard)
        self.publisher = self.route.publisher("a key", Traffic.TOKENS)


@asynccontextmanager
async def two() -> AsyncIterator[Two]:
    both = Two()
    try:
        yield both
    finally:
        await both.route.close()
        both.there.close()
        both.here.close()


def run(scenario: Callable[[Two], Coroutine[Any, Any, None]]) -> None:
    async def main() -> None:
        async with two() as both:
            await scenario(both)

    asyncio.run(main())


def test_datagrams_go_straight_whole_and_in_order_whatever_their_size() -> None:
    async def scenario(both: Two) -> None:
        source = random.Random(7)
        sizes = [source.choice((0, 1, 100, 60_000, 2**18, 2**18 + 1, 3 * 2**20)) for _ in range(60)]
        values = [source.randbytes(size) for size in sizes]
        for number, value in enumerate(values):
            both.publisher.put(b"%d" % number, value)
        await both.heard.wait(60)
        assert both.heard.headers == [b"%d" % number for number in range(60)]
        assert [bytes(payload) for _, payload in both.heard.messages] == values
        assert not both.beside.put

    run(scenario)


def test_what_has_come_cannot_be_written_to() -> None:
    async def scenario(both: Two) -> None:
        both.publisher.put(b"", bytes(100))
        both.publisher.put(b"", memoryview(bytearray(2**20)))
        await both.heard.wait(2)
        assert all(memoryview(payload).readonly for _, payload in both.heard.messages)

    run(scenario)


def test_keys_are_kept_apart_and_who_does_not_subscribe_any_more_hears_nothing() -> None:
    async def scenario(both: Two) -> None:
        other = Heard()
        subscription = both.there.subscribe("another", other)
        both.route.publisher("another", Traffic.TOKENS).put(b"1")
        await other.wait(1)
        subscription.close()
        subscription.close()
        both.route.publisher("another", Traffic.TOKENS).put(b"2")
        both.publisher.put(b"3")
        await both.heard.wait(1)
        assert other.headers == [b"1"]
        assert both.heard.headers == [b"3"]

    run(scenario)


def test_until_the_neighbour_is_there_datagrams_go_over_the_session(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local, "_AGAIN_S", 0.0)

    async def scenario(both: Two) -> None:
        later = name()
        both.route.lead_to(later)
        both.publisher.put(b"1")
        assert both.beside.put == [b"1"]
        endpoint = LocalEndpoint(later, LARGEST)
        heard = Heard()
        endpoint.subscribe("a key", heard)
        both.publisher.put(b"2")
        await heard.wait(1)
        assert heard.headers == [b"2"]
        endpoint.close()

    run(scenario)


def test_what_is_put_for_one_that_has_gone_goes_over_the_session() -> None:
    async def scenario(both: Two) -> None:
        both.publisher.put(b"1")
        await both.heard.wait(1)
        both.there.close()
        both.publisher.put(b"2")
        both.publisher.put(b"3")
        assert both.heard.headers == [b"1"]
        assert both.beside.put == [b"2", b"3"]

    run(scenario)


def test_what_is_too_many_for_one_that_does_not_read_is_lost_and_never_half(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local, "_MOST_UNSENT", 2**20)

    async def scenario(both: Two) -> None:
        value = bytes(range(250)) * 400
        for number in range(100):  # 10 MB, and nobody reads before this is over
            both.publisher.put(b"%d" % number, value)
        both.publisher.put(b"small")
        await both.heard.wait(10)
        while b"last" not in both.heard.headers:
            both.publisher.put(b"last")
            await asyncio.sleep(0)
        came = [int(header) for header in both.heard.headers if header not in (b"last", b"small")]
        assert came == list(range(len(came)))
        assert 10 <= len(came) < 100
        assert all(bytes(payload) == value for header, payload in both.heard.messages if header.isdigit())

    run(scenario)


def test_what_was_put_before_the_end_is_still_sent() -> None:
    async def scenario(both: Two) -> None:
        for number in range(5):
            both.publisher.put(b"%d" % number, bytes(2**20))  # more than the system takes at once
        await both.route.close()
        await both.heard.wait(5)

    run(scenario)


def test_the_end_does_not_wait_for_ever_for_one_that_does_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    async def scenario(both: Two) -> None:
        monkeypatch.setattr(local._Incoming, "_read", lambda _: None)
        for number in range(5):
            both.publisher.put(b"%d" % number, bytes(2**20))
        await both.route.close(within_s=0.01)
        assert not both.heard.messages

    run(scenario)


def test_what_may_be_lost_does_not_wait_behind_what_has_not_left() -> None:
    async def scenario(both: Two) -> None:
        leaky = both.route.publisher("a key", Traffic.BULK)
        for number in range(20):  # nobody reads before this is over
            leaky.put(b"%d" % number, bytes(2**17))
        leaky.put(b"long", bytes(2**20))
        both.publisher.put(b"exact")
        async with asyncio.timeout(10):
            while b"exact" not in both.heard.headers:
                await asyncio.sleep(0)
        assert b"0" in both.heard.headers
        assert b"19" not in both.heard.headers
        assert both.beside.put == [b"long"]

    run(scenario)


def test_who_sends_what_is_no_datagram_is_turned_away_and_others_go_on() -> None:
    async def scenario(both: Two) -> None:
        source = random.Random(3)
        junk = [source.randbytes(50) for _ in range(5)]
        junk += [local._HEAD.pack(1, 0, LARGEST + 1), local._HEAD.pack(1, 2**31, 0), local._HEAD.pack(0, 0, 0)]
        for piece in junk:
            with socket.socket(socket.AF_UNIX) as stranger:
                stranger.connect(local._address(both.there_is))
                stranger.sendall(piece)
                await asyncio.get_running_loop().run_in_executor(None, stranger.recv, 1)  # until it is closed
        assert both.there.refused == len(junk)
        both.publisher.put(b"1")
        await both.heard.wait(1)

    run(scenario)


def test_other_users_are_turned_away_and_nothing_is_sent_to_them(monkeypatch: pytest.MonkeyPatch) -> None:
    async def scenario(both: Two) -> None:
        monkeypatch.setattr(os, "geteuid", lambda: 12345)
        both.publisher.put(b"1")
        assert both.beside.put == [b"1"]
        with socket.socket(socket.AF_UNIX) as stranger:
            stranger.connect(local._address(both.there_is))
            await asyncio.get_running_loop().run_in_executor(None, stranger.recv, 1)
        assert both.there.refused >= 1
        assert not both.heard.messages

    run(scenario)


def test_a_subscriber_that_raises_stops_nothing() -> None:
    async def scenario(both: Two) -> None:
        def raises(burst: list[Message]) -> None:
            raise ValueError("on purpose")

        both.there.subscribe("raises", raises)
        both.route.publisher("raises", Traffic.TOKENS).put(b"1")
        both.publisher.put(b"2")
        await both.heard.wait(1)
        assert both.there.failed == 1

    run(scenario)


def test_what_a_session_refuses_is_refused_in_its_words() -> None:
    async def scenario(both: Two) -> None:
        with pytest.raises(MessageTooLarge, match="too long"):
            both.publisher.put(b"1", bytes(LARGEST))
        both.publisher.close()
        with pytest.raises(TransportError, match="closed"):
            both.publisher.put(b"2")

    run(scenario)


def test_two_endpoints_of_one_name_are_refused() -> None:
    async def scenario(both: Two) -> None:
        with pytest.raises(TransportError, match=both.there_is):
            LocalEndpoint(both.there_is, LARGEST)

    run(scenario)


def test_where_there_are_no_such_sockets_that_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    async def main() -> None:
        monkeypatch.setattr(sys, "platform", "darwin")
        with pytest.raises(TransportError, match="Linux"):
            LocalEndpoint(name(), LARGEST)

    asyncio.run(main())


@pytest.mark.rule("L2")
def test_a_link_goes_straight_both_ways_and_on_when_its_consumer_begins_anew() -> None:
    async def main() -> None:
        here_is, beside = name(), Beside()
        here = LocalEndpoint(here_is, LARGEST)
        names = [name(), name()]
        route = LocalRoute(here, beside, names[0])
        sender = LinkSender(route, "link", epoch=1, window=4)
        got: list[bytes] = []
        for life, there_is in enumerate(names, 1):
            there = LocalEndpoint(there_is, LARGEST)
            way_back = LocalRoute(there, Beside(), here_is)
            route.lead_to(there_is)
            sender.admit("sink", life)
            receiver = LinkReceiver(way_back, "link", consumer="sink", incarnation=life, producer=1)
            sending = asyncio.create_task(_send(sender, 20 * life))
            async with asyncio.timeout(10):
                while len(got) < 20 * life:
                    delivery = await receiver.take()
                    if delivery.sequence > len(got):  # what was done and not told comes again
                        got.append(bytes(delivery.value))
                    receiver.done()
                await sending
                if life == len(names):
                    await sender.wait_finished()
            there.close()  # at once and without a word
            await way_back.close()
        assert got == [b"%d" % number for number in range(40)]
        await sender.close()
        await route.close()
        here.close()

    asyncio.run(main())


async def _send(sender: LinkSender, until: int) -> None:
    for number in range(until - 20, until):
        await sender.send((b"", b"%d" % number))
