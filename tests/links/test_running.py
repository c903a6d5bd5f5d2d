"""The ends of links at work on an event loop, over the transport within one process, in virtual time."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

import hfg
from hfg.errors import TransportError, UsageError
from hfg.links.running import BoundedReceiver, BoundedSender, LinkReceiver, LinkSender
from hfg.transport import IncomingLink, OutgoingLink, Position
from hfg_transports.memory import Faults, MemorySession, Network


def virtually(scenario: Callable[[MemorySession, MemorySession], Awaitable[None]]) -> None:
    async def main() -> None:
        network = Network()
        one, other = await network.open(), await network.open()
        await scenario(one, other)
        await one.close()
        await other.close()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())


def ends(one: MemorySession, other: MemorySession, **options: Any) -> tuple[LinkSender, LinkReceiver]:
    sender = LinkSender(one, "link", epoch=1, **options)
    sender.admit("a")
    return sender, LinkReceiver(other, "link", consumer="a", incarnation=1, capacity=64)


def test_they_are_links() -> None:
    async def scenario(one: MemorySession, other: MemorySession) -> None:
        sender, receiver = ends(one, other)
        assert isinstance(sender, OutgoingLink)
        assert isinstance(receiver, IncomingLink)

    virtually(scenario)


@pytest.mark.rule("L1")
def test_senders_that_wait_go_on_in_the_order_of_their_calls() -> None:
    async def scenario(one: MemorySession, other: MemorySession) -> None:
        sender, receiver = ends(one, other, window=1)
        tasks = [asyncio.create_task(sender.send((b"", b"%d" % number))) for number in range(10)]
        await asyncio.sleep(1)
        tasks[4].cancel()
        got = []
        for _ in range(9):
            got.append(int(bytes((await receiver.take()).value)))
            receiver.done()
        assert got == [0, 1, 2, 3, 5, 6, 7, 8, 9]
        assert [task.result() for task in tasks if not task.cancelled()] == list(range(1, 10))

    virtually(scenario)


@pytest.mark.rule("L1")
def test_a_sender_that_is_cancelled_in_its_turn_gives_it_to_the_next() -> None:
    async def scenario(one: MemorySession, other: MemorySession) -> None:
        sender, receiver = ends(one, other, window=1)
        await sender.send((b"", b"first"))
        turns = [asyncio.create_task(sender.send((b"", b"%d" % number))) for number in range(2)]
        await receiver.take()
        sender._turns.wake = lambda wake=sender._turns.wake: (wake(), turns[0].cancel())  # type: ignore[method-assign, misc, assignment]
        receiver.done()
        await asyncio.sleep(1)
        assert turns[0].cancelled()
        assert await turns[1] == 2

    virtually(scenario)


def test_what_is_sent_behind_the_first_in_one_turn_is_one_datagram_and_so_is_the_word_on_it() -> None:
    async def scenario(one: MemorySession, other: MemorySession) -> None:
        sender, receiver = ends(one, other, window=64)
        await asyncio.sleep(1)
        before = sender.machine.counts.datagrams, receiver.machine.counts.statuses
        for number in range(15):
            sender.send_nowait((b"", b"%d" % number))
        for _ in range(15):
            await receiver.take()
            receiver.done()
        await sender.wait_finished()
        after = sender.machine.counts.datagrams, receiver.machine.counts.statuses
        assert after[0] - before[0] == 2
        assert after[1] - before[1] <= 2

    virtually(scenario)


def test_a_quarter_of_a_window_leaves_at_once_so_that_both_ends_have_work() -> None:
    async def scenario(one: MemorySession, other: MemorySession) -> None:
        sender, receiver = ends(one, other, window=64)
        await asyncio.sleep(1)
        sent = sender.machine.counts
        before, datagrams = sent.datagrams, []
        for number in range(34):
            sender.send_nowait((b"", b"%d" % number))
            datagrams.append(sent.datagrams - before)
        assert datagrams == [1] * 16 + [2] * 16 + [3] * 2
        told, statuses = receiver.machine.counts, []
        await asyncio.sleep(1)
        before = told.statuses
        for _ in range(34):
            receiver.take_nowait()
            receiver.done()
            statuses.append(told.statuses - before)
        assert statuses == [0] * 15 + [1] * 16 + [2] * 2 + [3]  # the last, for nothing is behind it
        await sender.wait_finished()

    virtually(scenario)


@pytest.mark.rule("L3")
def test_an_idle_link_wakes_nobody() -> None:
    async def scenario(one: MemorySession, other: MemorySession) -> None:
        sender, receiver = ends(one, other)
        await sender.send((b"", b"x"))
        await receiver.take()
        receiver.done()
        await sender.wait_finished()
        await asyncio.sleep(10)
        before = sender.statistics()["datagrams"], receiver.statistics()["statuses"]
        await asyncio.sleep(100_000)
        assert (sender.statistics()["datagrams"], receiver.statistics()["statuses"]) == before

    virtually(scenario)


@pytest.mark.rule("L3")
def test_a_cut_holds_the_producer_up_and_loses_nothing() -> None:
    async def scenario(one: MemorySession, other: MemorySession) -> None:
        sender, receiver = ends(one, other, window=4)
        await sender.send((b"", b"1"))
        assert (await receiver.take()).sequence == 1
        one.network.cut()
        receiver.done()
        sending = asyncio.create_task(sender.send((b"", b"2")))
        await asyncio.sleep(60)
        assert sending.done(), "there is room in the window"
        for number in (3, 4):
            await sender.send((b"", b"%d" % number))
        assert not sender.free
        one.network.heal()
        healed = asyncio.get_running_loop().time()
        for number in (2, 3, 4):
            assert (await receiver.take()).sequence == number
            receiver.done()
        assert asyncio.get_running_loop().time() - healed < 1.0
        await sender.wait_finished()

    virtually(scenario)


@pytest.mark.rule("L2")
def test_bad_networks_do_no_harm() -> None:
    async def scenario(one: MemorySession, other: MemorySession) -> None:
        one.network.faults = Faults(loss=0.3, repetition=0.2, reordering=0.2, delay_s=(0.0, 0.02))
        sender, receiver = ends(one, other, window=8)

        async def send() -> None:
            for number in range(1, 501):
                await sender.send((b"", b"%d" % number))

        sending = asyncio.create_task(send())
        for number in range(1, 501):
            token = await receiver.take()
            assert (token.sequence, bytes(token.value)) == (number, b"%d" % number)
            receiver.done()
        await sending
        await sender.wait_finished()

    virtually(scenario)


def test_callbacks_take_the_place_of_waiting() -> None:
    """As the engine does: it never waits for a link."""

    async def scenario(one: MemorySession, other: MemorySession) -> None:
        got: list[int] = []
        freed: list[int] = []

        def arrived() -> None:
            while (token := receiver.take_nowait()) is not None:
                got.append(token.sequence)
                receiver.done()

        sender = LinkSender(one, "link", epoch=1, window=2, released=lambda: freed.append(sender.released))
        sender.admit("a")
        receiver = LinkReceiver(other, "link", consumer="a", incarnation=1, arrived=arrived)
        sender.send_nowait((b"", b"1"))
        sender.send_nowait((b"", b"2"))
        assert not sender.free
        with pytest.raises(UsageError, match="the window of 2 tokens is full: look at `free` first, or await send"):
            sender.send_nowait((b"", b"3"))
        await asyncio.sleep(1)
        assert got == [1, 2]
        assert freed == [2]

    virtually(scenario)


@pytest.mark.rule("L2")
def test_a_relay_without_memory_between_two_links() -> None:
    async def scenario(one: MemorySession, other: MemorySession) -> None:
        sender = LinkSender(one, "in", epoch=1, window=3)
        sender.admit("relay")
        sink = LinkReceiver(one, "out", consumer="sink", incarnation=1)

        async def relay(life: int) -> None:
            receiver = LinkReceiver(other, "in", consumer="relay", incarnation=life)
            onward = LinkSender(other, "out", epoch=life, inherits=True)
            onward.admit("sink")
            try:
                async for token in receiver:
                    await onward.send(token.token, token.position)
                    await onward.wait_finished()
                    receiver.done()
            finally:
                await receiver.close()
                await onward.close()

        async def send() -> None:
            for number in range(1, 101):
                await sender.send((b"", b"%d" % number))

        sending, life = asyncio.create_task(send()), 1
        relaying = asyncio.create_task(relay(life))
        for number in range(1, 101):
            token = await sink.take()
            assert token.position == Position(1, number)
            if number % 7 == 0:
                relaying.cancel()
                life += 1
                relaying = asyncio.create_task(relay(life))
            sink.done()
        await sending
        await sender.wait_finished()
        assert life > 10
        relaying.cancel()

    virtually(scenario)


def test_a_link_that_is_closed_lets_nobody_wait() -> None:
    async def scenario(one: MemorySession, other: MemorySession) -> None:
        sender, receiver = ends(one, other, window=1)
        await sender.send((b"", b"x"))
        waiting = asyncio.create_task(sender.send((b"", b"y")))
        finishing = asyncio.create_task(sender.wait_finished())
        await asyncio.sleep(1)
        await sender.close(over=True)
        await sender.close()
        for task in (waiting, finishing):
            with pytest.raises(TransportError, match='link "link" is closed'):
                await task
        assert [bytes(token.value) async for token in receiver] == [b"x"], "the other side is told"
        receiver.done()
        await receiver.close()
        with pytest.raises(TransportError, match='link "link" is closed'):
            await receiver.take()

    virtually(scenario)


def test_a_session_that_ends_under_its_links_ends_them(caplog: pytest.LogCaptureFixture) -> None:
    async def scenario(one: MemorySession, other: MemorySession) -> None:
        sender, receiver = ends(one, other, window=1)
        bounded = BoundedSender(one, "bounded", epoch=1)
        bounded.send_nowait((b"", b"x"))
        await sender.send((b"", b"x"))
        waiting = asyncio.create_task(sender.send((b"", b"y")))
        await asyncio.sleep(0.01)
        one.die()
        other.die()
        with pytest.raises(TransportError, match='link "link" is closed'):
            await waiting
        with pytest.raises(TransportError, match='link "link" is closed'):
            sender.send_nowait((b"", b"z"))
        await receiver.take()
        receiver.done()
        await sender.close()
        await receiver.close()
        await bounded.close()

    virtually(scenario)
    assert not caplog.records


def test_a_receiver_that_waits_is_awakened_by_its_end() -> None:
    async def scenario(one: MemorySession, other: MemorySession) -> None:
        _, receiver = ends(one, other)
        taking = [asyncio.create_task(receiver.take()) for _ in range(2)]
        await asyncio.sleep(1)
        await receiver.close()
        for task in taking:
            with pytest.raises(TransportError, match='link "link" is closed'):
                await task

    virtually(scenario)


def test_who_is_dismissed_sets_the_sender_free() -> None:
    async def scenario(one: MemorySession, other: MemorySession) -> None:
        del other
        sender = LinkSender(one, "link", epoch=1, window=1)
        sender.admit("nobody")
        await sender.send((b"", b"x"))
        waiting = asyncio.create_task(sender.send((b"", b"y")))
        await asyncio.sleep(1)
        sender.dismiss("nobody")
        assert await waiting == 2
        assert sender.statistics()["given_up"] == 1

    virtually(scenario)


def test_a_bounded_link_never_waits() -> None:
    async def scenario(one: MemorySession, other: MemorySession) -> None:
        receiver = BoundedReceiver(other, "link", capacity=4, overflow="drop_oldest")
        sender = BoundedSender(one, "link", epoch=1)
        for number in range(1, 101):
            assert sender.send_nowait((b"", b"x")) == number
        first = await receiver.take()
        assert first.sequence == 97
        assert receiver.statistics() == {
            "received": 100,
            "lost": 0,
            "dropped": 96,
            "late": 0,
            "streams": 0,
            "refused": 0,
            "other_versions": 0,
            "stale": 0,
            "waiting": 3,
        }
        await sender.close()
        with pytest.raises(TransportError, match='link "link" is closed'):
            sender.send_nowait((b"", b"x"))

    virtually(scenario)


@pytest.mark.rule("L3")
def test_a_consumer_that_does_not_answer_and_then_does_is_said_at_level_info(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO", "hfg.links")

    async def main() -> None:
        network = Network()
        one, other = await network.open(), await network.open()
        sender, receiver = ends(one, other)
        await sender.send((b"", b"0"))
        await receiver.take()
        receiver.done()
        await sender.wait_finished()
        network.faults = Faults(loss=1.0)
        await sender.send((b"", b"1"))
        await asyncio.sleep(5)
        network.faults = Faults()
        await receiver.take()
        receiver.done()
        await sender.wait_finished()
        await one.close()
        await other.close()

    with asyncio.Runner(loop_factory=hfg.VirtualTimeLoop) as runner:
        runner.run(main())
    said = [record.getMessage() for record in caplog.records]
    assert len(said) == 2
    assert said[0] == 'link "link": "a" does not answer, and 1 tokens wait for it; they will reach it when it is back'
    assert said[1].startswith('link "link": "a" answers again after 4.')
