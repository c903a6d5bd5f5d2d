"""The transport within one process: what every transport does, and what only this one can."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

import hfg
from hfg.errors import MessageTooLarge, NoAnswer, TransportError
from hfg.testing.transports import Collected, TransportTests
from hfg.transport import Presence, Session, Traffic, Transport
from hfg_transports.memory import Faults, MemorySession, Network, transport
from tests.limits import patience

BAD = Faults(loss=0.2, repetition=0.1, reordering=0.1, delay_s=(0.0, 0.005))


class TestMemory(TransportTests):
    @asynccontextmanager
    async def sessions(self, count: int) -> AsyncIterator[list[MemorySession]]:
        network = Network(largest_message=5_000_000)
        opened = [await network.open() for _ in range(count)]
        yield opened
        for one in opened:
            await one.close()

    def disturb(self, sessions: list[MemorySession]) -> bool:
        sessions[0].network.faults = BAD
        return True

    def calm(self, sessions: list[MemorySession]) -> None:
        sessions[0].network.faults = Faults()

    async def kill(self, session: MemorySession) -> bool:
        session.die()
        return True


class TestMemoryUnderVirtualTime(TestMemory):
    factory = hfg.VirtualTimeLoop


def virtually(main: Any) -> Any:
    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        return runner.run(main)


def test_it_is_a_transport() -> None:
    async def main() -> None:
        assert isinstance(transport, Transport)
        session = await transport.open(network="here")
        assert isinstance(session, Session)
        assert (await transport.open(network="here")).network is session.network
        assert (await transport.open()).network is not session.network

    asyncio.run(main())


def test_faults_are_the_same_each_time_under_virtual_time() -> None:
    async def life(seed: int) -> tuple[list[tuple[float, bytes]], int]:
        network = Network(Faults(loss=0.3, repetition=0.3, reordering=0.2, delay_s=(0.001, 1.0)), seed=seed)
        one, other = await network.open(), await network.open()
        arrived: list[tuple[float, bytes]] = []
        now = asyncio.get_running_loop().time
        other.subscribe("key", lambda burst: arrived.extend((now(), bytes(header)) for header, _ in burst))
        publisher = one.publisher("key", Traffic.TOKENS)
        for number in range(100):
            publisher.put(b"%d" % number)
        await asyncio.sleep(10)
        return arrived, network.lost

    first = virtually(life(1))
    assert first == virtually(life(1))
    assert first != virtually(life(2))
    arrived, lost = first
    headers = [header for _, header in arrived]
    assert lost > 10
    assert len(headers) > len(set(headers)), "some are doubled"
    assert headers != sorted(headers, key=int), "some have overtaken others"


def test_who_is_cut_off_hears_nothing_and_is_gone_after_the_lease() -> None:
    async def main() -> None:
        network = Network(lease_s=2.0)
        one, other = await network.open(), await network.open()
        loop = asyncio.get_running_loop()
        inbox, changes = Collected[Any](10.0), Collected[Any](10.0)
        other.subscribe("key", inbox)
        other.watch("name", changes)
        one.announce("name", b"m")
        one.answer("question", lambda _: asyncio.sleep(0, b"yes"))
        publisher = one.publisher("key", Traffic.TOKENS)
        assert await changes.wait(bool)
        network.cut(one)
        begun = loop.time()
        publisher.put(b"lost")
        with pytest.raises(NoAnswer):
            await other.ask("question")
        assert await changes.wait(lambda got: got[-1] == Presence("name", b"", False))
        assert loop.time() - begun == pytest.approx(2.0)
        network.heal()
        assert await changes.wait(lambda got: got[-1] == Presence("name", b"m", True))
        publisher.put(b"heard")
        assert await inbox.wait(bool)
        assert [bytes(header) for header, _ in inbox.items] == [b"heard"]
        assert await other.ask("question") == b"yes"
        assert network.lost == 1

    virtually(main())


def test_a_cut_that_is_shorter_than_the_lease_is_not_told() -> None:
    async def main() -> None:
        network = Network(lease_s=2.0)
        one, other = await network.open(), await network.open()
        changes = Collected[Any](10.0)
        other.watch("name", changes)
        one.announce("name")
        assert await changes.wait(bool)
        network.cut()
        await asyncio.sleep(1.0)
        network.heal()
        await asyncio.sleep(10.0)
        assert len(changes.items) == 1

    virtually(main())


def test_who_dies_and_returns_is_first_told_as_gone() -> None:
    async def main() -> None:
        network = Network()
        one, other = await network.open(), await network.open()
        changes = Collected[Any](10.0)
        other.watch("name", changes)
        one.announce("name", b"1")
        one.die()
        (await network.open()).announce("name", b"2")
        assert await changes.wait(lambda got: len(got) == 3)
        assert changes.items == [
            Presence("name", b"1", True),
            Presence("name", b"", False),
            Presence("name", b"2", True),
        ]

    virtually(main())


def test_sessions_on_loops_of_several_threads_hear_each_other() -> None:
    network = Network()
    ready, over = threading.Event(), threading.Event()

    async def elsewhere() -> list[bytes]:
        session = await network.open()
        echo = session.publisher("back", Traffic.TOKENS)
        inbox = Collected[Any](10.0)

        def answer(burst: list[Any]) -> None:
            inbox(burst)
            for header, _ in burst:
                echo.put(bytes(header) + b"!")

        session.subscribe("there", answer)
        session.answer("question", lambda question: asyncio.sleep(0, question * 2))
        ready.set()
        assert await inbox.wait(lambda got: len(got) == 1000)
        await asyncio.to_thread(over.wait, 10.0)
        await session.close()
        return [bytes(header) for header, _ in inbox.items]

    async def here() -> list[bytes]:
        session = await network.open()
        inbox = Collected[Any](10.0)
        session.subscribe("back", inbox)
        publisher = session.publisher("there", Traffic.TOKENS)
        for number in range(1000):
            publisher.put(b"%d" % number)
        assert await inbox.wait(lambda got: len(got) == 1000)
        assert await session.ask("question", b"ab") == b"abab"
        over.set()
        await session.close()
        return [bytes(header) for header, _ in inbox.items]

    results: list[list[bytes]] = []
    thread = threading.Thread(target=lambda: results.append(asyncio.run(elsewhere())))
    thread.start()
    assert ready.wait(patience(10.0))
    back = asyncio.run(here())
    thread.join(patience(10.0))
    assert results == [[b"%d" % number for number in range(1000)]]
    assert back == [b"%d!" % number for number in range(1000)]


def test_messages_say_what_is_wrong() -> None:
    async def main() -> None:
        network = Network(largest_message=10)
        session = await network.open()
        with pytest.raises(MessageTooLarge, match="a datagram of 11 bytes: this network carries 10"):
            session.publisher("key", Traffic.TOKENS).put(b"x" * 11)
        with pytest.raises(MessageTooLarge, match="a question of 11 bytes: this network carries 10"):
            await session.ask("key", b"x" * 11)
        with pytest.raises(TransportError, match='"a//b" is no key: it needs chunks that are not empty'):
            session.announce("a//b")
        session.announce("a")
        with pytest.raises(TransportError, match='"a" is announced by this session already: close that first'):
            session.announce("a")
        await session.close()
        with pytest.raises(TransportError, match="the session is closed: open another"):
            session.announce("b")

    asyncio.run(main())
