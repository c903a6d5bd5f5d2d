"""What Zenoh needs beyond the conformance of any transport: meeting, long payloads, versions, who stands still."""

from __future__ import annotations

import asyncio
import itertools
import sys
import threading
import time
from collections.abc import Callable, Coroutine
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from hfg.errors import MessageTooLarge, NoAnswer, TransportError
from hfg.transport import Message, Presence, Session, Traffic, Transport
from hfg_transports.zenoh import ZenohSession, ZenohTransport, names, versions
from hfg_transports.zenoh.config import LONG
from hfg_transports.zenoh.sending import Sender
from hfg_transports.zenoh.transport import CLOSE_S
from tests.transports.chaos import Program
from tests.transports.zenoh.conftest import Open, free_port, into, put_until, soon, until

pytestmark = pytest.mark.asyncio

Two = tuple[ZenohSession, ZenohSession]


def connected(session: ZenohSession, others: set[str]) -> bool:
    return {one.peer for one in session.connections()} == others


def present(session: ZenohSession) -> set[str]:
    """Return who is there according to a session, from now on."""
    there: set[str] = set()

    def changed(presences: list[Presence]) -> None:
        for one in presences:
            (there.add if one.present else there.discard)(one.name)

    session.watch("", changed)
    return there


async def test_it_is_a_transport(two: Two) -> None:
    assert isinstance(ZenohTransport(), Transport)
    assert isinstance(two[0], Session)


async def test_programs_meet_in_any_order_and_go_on_meeting_when_the_first_has_gone(
    open_one: Open, here: dict[str, Any]
) -> None:
    """The first has the address at which they meet; when it goes, the next who comes has it, and the others find it."""

    async def join(name: str) -> tuple[ZenohSession, Callable[[set[str]], Coroutine[Any, Any, None]]]:
        session = await open_one(**here)
        session.announce(name)
        there = present(session)
        return session, lambda names: until(lambda: there == names)

    first, first_sees = await join("first")
    _, second_sees = await join("second")
    _, third_sees = await join("third")
    for sees in (first_sees, second_sees, third_sees):
        await sees({"first", "second", "third"})
    await first.close()
    await second_sees({"second", "third"})
    _, fourth_sees = await join("fourth")
    for sees in (second_sees, third_sees, fourth_sees):
        await sees({"second", "third", "fourth"})


async def test_a_session_that_closes_withdraws_what_it_has_declared_before_zenoh_closes(
    open_one: Open, here: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Zenoh may connect again while it closes, and would declare there what the session still has.

    The lease is long because a lost connection, too, withdraws what was declared over it.
    """

    async def answer(question: bytes) -> bytes:
        return question

    here["lease_s"] = 60.0
    first, second = await open_one(**here), await open_one(**here)
    there = present(second)
    first.announce("first")
    first.answer("name", answer)
    first.announce("answers")
    await until(lambda: there == {"first", "answers"})
    assert await soon(second.ask("name", b"1")) == b"1"
    raw = first._raw
    monkeypatch.setattr(first, "_raw", SimpleNamespace(close=lambda: None))
    await first.close()
    await until(lambda: not there)
    with pytest.raises(NoAnswer, match="nobody answers"):
        await second.ask("name", b"2")
    raw.close()


async def test_programs_that_were_first_find_the_agent_that_comes_later(open_one: Open, here: dict[str, Any]) -> None:
    first = await open_one(**here)
    agent = await open_one(**here, mode="router")
    await until(partial(connected, first, {agent.name}))
    client = await open_one(**here, mode="client")
    got: asyncio.Queue[Message] = asyncio.Queue()
    first.subscribe("a", into(got))
    publisher = client.publisher("a", Traffic.TOKENS)

    await put_until(lambda: not got.empty(), lambda: publisher.put(b"1"))
    assert got.get_nowait() == (b"1", b"")


async def test_programs_of_two_realms_do_not_hear_each_other(open_one: Open, here: dict[str, Any]) -> None:
    first, second = await open_one(**here, realm="a"), await open_one(**here, realm="b")
    await until(first.connections)
    got: list[Message] = []
    seen: list[Presence] = []
    fence: asyncio.Queue[Message] = asyncio.Queue()
    second.subscribe("k", got.extend)
    second.watch("", seen.extend)
    second.subscribe("fence", into(fence))
    first.announce("k")
    first.publisher("k", Traffic.TOKENS).put(b"1")
    fences = second.publisher("fence", Traffic.TOKENS)
    await put_until(lambda: not fence.empty(), lambda: fences.put(b""))
    assert (got, seen) == ([], [])


async def test_long_and_short_payloads_of_one_publisher_keep_their_order(two: Two) -> None:
    """The long ones go through a thread, so a short one must not pass them."""
    got: list[tuple[int, bytes]] = []

    def arrived(burst: list[Message]) -> None:
        got.extend((int.from_bytes(header), bytes(payload)) for header, payload in burst)

    two[1].subscribe("frames", arrived)
    publisher = two[0].publisher("frames", Traffic.TOKENS)
    await until(lambda: publisher.wanted)
    long = bytes(range(256)) * (LONG // 128)
    numbers = itertools.count()

    def put() -> None:
        number = next(numbers)
        publisher.put(number.to_bytes(4), b"short" if number % 3 else memoryview(long))

    def whole() -> bool:
        """Whether one long one and the two behind it have come twice; any may be lost, none may pass another."""
        came = {number for number, _ in got}
        return sum({first, first + 1, first + 2} <= came for first in range(0, max(came, default=0), 3)) >= 2

    await put_until(whole, *(put,) * 6)
    assert [number for number, _ in got] == sorted({number for number, _ in got})
    assert all(payload == (b"short" if number % 3 else long) for number, payload in got)

    def put_the_last() -> None:
        last = two[0].publisher("frames", Traffic.TOKENS)
        last.put(bytes(4), long)
        last.close()

    await put_until(lambda: got[-1] == (0, long), put_the_last)


def wait(event: threading.Event) -> None:
    event.wait(20)


async def test_what_waits_for_the_senders_thread_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    sender, go, done = Sender(), threading.Event(), threading.Event()
    assert sender.give(lambda: wait(go), 100 * 2**20)
    assert not sender.give(done.set, 100 * 2**20)
    assert sender.give(done.set, 1)
    assert sender.dropped == 1
    go.set()
    await asyncio.to_thread(done.wait, 20)
    assert done.is_set()
    sender.close(1)
    assert not sender.give(done.set, 1)


async def test_what_is_longer_than_the_receiver_takes_is_counted_and_passed_over(
    open_one: Open, here: dict[str, Any]
) -> None:
    """Zenoh itself refuses what is much longer, and goes on too."""
    first = await open_one(**here, largest_message=2**20)
    second = await open_one(**here, largest_message=2**17)
    await until(first.connections)
    got: asyncio.Queue[Message] = asyncio.Queue()
    second.subscribe("a", into(got))
    publisher = first.publisher("a", Traffic.TOKENS)
    await until(lambda: publisher.wanted)
    publisher.put(b"", b"x" * (2**19))
    while not second.refused:  # what is long may be dropped on its way
        publisher.put(b"", b"x" * (2**17 + 1))
        await asyncio.sleep(0.01)
    await put_until(lambda: not got.empty(), lambda: publisher.put(b"1"))
    assert got.get_nowait() == (b"1", b"")
    with pytest.raises(MessageTooLarge, match="a message of 131073 bytes"):
        second.publisher("a", Traffic.TOKENS).put(b"1", b"x" * 2**17)


async def test_who_speaks_another_version_than_those_who_are_there_is_refused(
    open_one: Open, here: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    await open_one(**here, mode="router")
    await open_one(**here, mode="client")
    monkeypatch.setattr(versions, "WIRE_VERSION", 2)
    said = (
        r'in the realm "default" there is hfg \S+ with version 1 of the wire format, and this is hfg \S+ with version 2'
    )
    with pytest.raises(TransportError, match=f"{said}; install the same hfg for all programs, or take another realm"):
        await open_one(**here, mode="client")


async def test_a_session_that_cannot_be_made_leaves_no_thread_that_keeps_the_program(
    here: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def raises(*_: object) -> str:
        raise ValueError("on purpose")

    before = set(threading.enumerate())
    monkeypatch.setattr(sys.modules["hfg_transports.zenoh.transport"], "version_key", raises)
    with pytest.raises(ValueError, match="on purpose"):
        await ZenohTransport().open(**here)
    await until(lambda: not [one for one in threading.enumerate() if "pyo3" in one.name and one not in before])


async def test_a_program_that_was_there_first_warns(
    open_one: Open, here: dict[str, Any], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    first = await open_one(**here)
    with monkeypatch.context() as patched:
        patched.setattr(versions, "WIRE_VERSION", 2)
        key = versions.version_key(names.Keys("default"), "someone")
    other = await open_one(**here)
    other._raw.liveliness().declare_token(key)
    await until(lambda: "with version 2 of the wire format" in caplog.text)
    assert "install the same hfg for all programs, or take another realm" in caplog.text
    del first


async def test_settings_that_do_not_exist_are_refused(open_one: Open) -> None:
    with pytest.raises(TransportError, match="unknown field `relm`; see hfg_transports.zenoh.Settings"):
        await open_one(relm="a")


LEAVING = """
import asyncio, sys
from hfg.transport import Traffic
from hfg_transports.zenoh import ZenohTransport
async def main():
    session = await ZenohTransport().open(mode="router", listen=(sys.argv[1],), insecure=True)
    session.subscribe("a", lambda burst: None)
    session.publisher("a", Traffic.BULK).put(b"", bytes(1_000_000))
    raise SystemExit(3)
asyncio.run(main())
"""


async def test_a_program_that_leaves_its_session_open_ends_all_the_same() -> None:
    """Python would wait for Zenoh's threads, and they for the session; a thread that comes too late aborts."""
    async with Program([sys.executable, "-c", LEAVING, f"tcp/127.0.0.1:{free_port()}"]) as program:
        assert await soon(program.wait()) == 3


STANDING = """
import asyncio, sys
from hfg_transports.zenoh import ZenohTransport
async def main():
    session = await ZenohTransport().open(mode="router", listen=(sys.argv[1],), insecure=True, lease_s=0.5)
    session.subscribe("bulk", lambda burst: None)
    session.announce("standing/here")
    print("ready", flush=True)
    await asyncio.Event().wait()
asyncio.run(main())
"""


async def test_a_peer_that_stands_still_holds_neither_the_loop_nor_the_end(open_one: Open) -> None:
    """Zenoh's own close takes ten seconds then, and says that it has failed."""
    address = f"tcp/127.0.0.1:{free_port()}"
    presences: asyncio.Queue[Presence] = asyncio.Queue()
    async with Program([sys.executable, "-c", STANDING, address]) as standing:
        assert await soon(standing.line()) == "ready"
        session = await open_one(mode="client", connect=(address,), lease_s=0.5, insecure=True)
        session.watch("standing", into(presences))
        assert (await soon(presences.get())).present
        publisher = session.publisher("bulk", Traffic.BULK)
        await until(lambda: publisher.wanted)
        standing.stop()
        for _ in range(200):
            publisher.put(b"", b"x" * 100_000)
        began = time.monotonic()
        await session.close()
        # No time is promised, but that the end of what Zenoh does is not waited for: half of it is already too much.
        assert time.monotonic() - began < 5 + CLOSE_S / 2
    with pytest.raises(TransportError, match="closed"):
        publisher.put(b"")


async def test_a_program_that_is_killed_has_gone_and_one_that_stands_still_is_gone_after_the_lease(
    open_one: Open, here: dict[str, Any]
) -> None:
    address = f"tcp/127.0.0.1:{free_port()}"
    presences: asyncio.Queue[Presence] = asyncio.Queue()
    watcher = await open_one(connect=(), listen=(address,), meet=here["meet"], lease_s=0.5, insecure=True)
    watcher.watch("", into(presences))
    async with Program([sys.executable, "-c", STANDING, address]) as program:
        assert await soon(program.line()) == "ready"
        assert await soon(presences.get()) == Presence("standing/here", b"", True)
        program.stop()
        assert await soon(presences.get()) == Presence("standing/here", b"", False)
        program.resume()
        assert await soon(presences.get()) == Presence("standing/here", b"", True)
        program.kill()
        assert await soon(presences.get()) == Presence("standing/here", b"", False)


async def test_an_opening_that_is_given_up_leaves_no_session(
    here: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a thread has opened for nobody is closed when it comes."""
    closed = threading.Event()
    close_raw = ZenohSession.close_raw

    def close_and_tell(session: ZenohSession) -> None:
        close_raw(session)
        closed.set()

    monkeypatch.setattr(ZenohSession, "close_raw", close_and_tell)
    opening = asyncio.create_task(ZenohTransport().open(**here))
    await asyncio.sleep(0)
    opening.cancel()
    with pytest.raises(asyncio.CancelledError):
        await opening
    assert await asyncio.to_thread(closed.wait, 20)
