"""From other threads to the loop, with one wake-up per burst."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Any

import pytest

from hfg_transports.zenoh import inbox as module
from hfg_transports.zenoh.inbox import Inbox, Mailbox
from tests.limits import patience


class CountingLoop:
    """Stands in for a loop: counts wake-ups, and makes them when the test says so."""

    def __init__(self) -> None:
        self.woken: list[Callable[[], None]] = []
        self.closed = False

    def call_soon_threadsafe(self, callback: Callable[[], None]) -> None:
        if self.closed:
            raise RuntimeError("Event loop is closed")
        self.woken.append(callback)

    def turn(self) -> None:
        woken, self.woken = self.woken, []
        for callback in woken:
            callback()


@pytest.fixture
def loop() -> CountingLoop:
    return CountingLoop()


def inbox_of(loop: Any) -> Inbox:
    return Inbox(loop)


def test_a_burst_costs_one_wake_up_and_arrives_as_one(loop: CountingLoop) -> None:
    inbox = inbox_of(loop)
    bursts: list[list[int]] = []
    first = Mailbox(inbox, "first", bursts.append)
    second = Mailbox(inbox, "second", bursts.append)
    for number in range(5):
        first.leave(number)
        second.leave(10 + number)
    assert len(loop.woken) == 1
    loop.turn()
    assert bursts == [[0, 1, 2, 3, 4], [10, 11, 12, 13, 14]]
    first.leave(5)
    assert len(loop.woken) == 1
    loop.turn()
    assert bursts[2:] == [[5]]


def test_what_comes_while_the_loop_delivers_gets_a_wake_up_of_its_own(loop: CountingLoop) -> None:
    inbox = inbox_of(loop)
    got: list[int] = []

    def receive(items: list[int]) -> None:
        got.extend(items)
        if len(got) < 3:
            mailbox.leave(len(got))

    mailbox = Mailbox(inbox, "one", receive)
    mailbox.leave(0)
    for turn in range(1, 4):
        loop.turn()
        assert len(got) == turn
    assert got == [0, 1, 2]


def test_after_the_loop_has_closed_nothing_happens(loop: CountingLoop) -> None:
    inbox = inbox_of(loop)
    got: list[list[int]] = []
    mailbox = Mailbox(inbox, "one", got.append)
    loop.closed = True
    mailbox.leave(1)
    mailbox.leave(2)
    assert got == []


def test_a_receiver_that_raises_is_counted_and_the_others_get_theirs(
    loop: CountingLoop, caplog: pytest.LogCaptureFixture
) -> None:
    inbox = inbox_of(loop)
    got: list[list[int]] = []

    def broken(items: list[int]) -> None:
        raise ValueError(items)

    first, second = Mailbox(inbox, 'the subscriber of "a"', broken), Mailbox(inbox, "second", got.append)
    first.leave(1)
    second.leave(2)
    loop.turn()
    assert (inbox.failed, got) == (1, [[2]])
    assert 'the subscriber of "a" raised and goes on' in caplog.text


def test_what_a_loop_does_not_fetch_is_bounded_in_number_and_bytes(
    loop: CountingLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST", 3)
    inbox = inbox_of(loop)
    got: list[list[int]] = []
    many, long = Mailbox(inbox, "many", got.append), Mailbox(inbox, "long", got.append, largest=100)
    for number in range(5):
        many.leave(number)
    long.leave(1, 60)
    long.leave(2, 60)
    assert (many.lost, long.lost) == (2, 1)
    loop.turn()
    assert got == [[0, 1, 2], [1]]
    long.leave(3, 60)  # there is room again
    loop.turn()
    assert got[2:] == [[3]]


def test_closed_mailboxes_and_inboxes_deliver_nothing(loop: CountingLoop) -> None:
    inbox = inbox_of(loop)
    got: list[list[int]] = []
    first, second = Mailbox(inbox, "first", got.append), Mailbox(inbox, "second", got.append)
    first.leave(1)
    first.close()
    first.leave(2)
    second.leave(3)
    inbox.close()
    loop.turn()
    assert got == []


def test_threads_that_hurry_lose_nothing_and_keep_their_order() -> None:
    """The flags are set and cleared by different threads, so a wrong order would lose one in thousands."""
    threads, each = 4, 5000

    async def main() -> list[list[int]]:
        inbox = Inbox(asyncio.get_running_loop())
        got: list[list[int]] = [[] for _ in range(threads)]
        complete = asyncio.Event()

        def receiver(own: list[int]) -> Callable[[list[int]], None]:
            def receive(items: list[int]) -> None:
                own.extend(items)
                if all(len(one) == each for one in got):
                    complete.set()

            return receive

        def work(mailbox: Mailbox[int]) -> None:
            for number in range(each):
                mailbox.leave(number)

        mailboxes = [Mailbox(inbox, "one", receiver(own)) for own in got]
        workers = [threading.Thread(target=work, args=(mailbox,)) for mailbox in mailboxes]
        for worker in workers:
            worker.start()
        async with asyncio.timeout(patience(30)):
            await complete.wait()
        for worker in workers:
            worker.join()
        return got

    assert asyncio.run(main()) == [list(range(each))] * threads
