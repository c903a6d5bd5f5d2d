"""The tests that any transport passes: what `hfg.transport` asks of it, and links over it.

Write a class in a test module, its name beginning with `Test`, derived from `TransportTests`, with its own `sessions`:

    class TestMine(TransportTests):
        @asynccontextmanager
        async def sessions(self, count):
            opened = [await my_transport.open(...) for _ in range(count)]
            yield opened
            for one in opened:
                await one.close()

Each test runs on an event loop of its own and waits for what it expects, never for a time. A transport whose network
can be disturbed says how in `disturb` and `calm`; then links are tested under it.
"""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Coroutine
from contextlib import AbstractAsyncContextManager
from functools import partial
from typing import Any, Generic, TypeVar

from hfg.errors import MessageTooLarge, NoAnswer, QueryRefused, TransportError
from hfg.links.running import BoundedReceiver, BoundedSender, LinkReceiver, LinkSender
from hfg.transport import Closing, Delivery, Message, Position, Presence, Publisher, Session, Traffic

__all__ = ["Collected", "TransportTests"]

T = TypeVar("T")


class Collected(Generic[T]):
    """A callback that keeps what it is given, and lets a test wait for it.

    Attributes:
      bursts: the lists that it was called with.
      threads: in which threads.
    """

    def __init__(self, patience_s: float) -> None:
        self.bursts: list[list[T]] = []
        self.threads: set[int] = set()
        self._patience_s = patience_s
        self._more = asyncio.Event()

    def __call__(self, burst: list[T]) -> None:
        """Keep a burst."""
        self.bursts.append(burst)
        self.threads.add(threading.get_ident())
        self._more.set()

    @property
    def items(self) -> list[T]:
        """All of it, in order."""
        return [item for burst in self.bursts for item in burst]

    async def wait(self, until: Callable[[list[T]], bool], *, patience_s: float | None = None) -> bool:
        """Wait until it has what is wanted; False if that takes too long."""
        try:
            async with asyncio.timeout(patience_s or self._patience_s):
                while not until(self.items):
                    self._more.clear()
                    await self._more.wait()
        except TimeoutError:
            return False
        return True


def _plain(message: Message) -> tuple[bytes, bytes]:
    """Return a datagram as bytes, to be compared."""
    return bytes(message[0]), bytes(message[1])


class TransportTests:
    """The requirements on a transport, as tests.

    Attributes:
      patience_s: how long a test waits for what must come.
      lease_s: how long it may take until a dead program is reported as gone.
      large: bytes of a large datagram that must go.
      factory: makes the event loop; None: asyncio's.
    """

    patience_s: float = 10.0
    lease_s: float = 10.0
    large: int = 4_000_000
    factory: Callable[[], asyncio.AbstractEventLoop] | None = None

    def sessions(self, count: int) -> AbstractAsyncContextManager[list[Any]]:
        """Open `count` sessions that can reach each other, and close them at the end."""
        raise NotImplementedError("a class of transport tests says in `sessions` how sessions are opened")

    def disturb(self, sessions: list[Any]) -> bool:
        """Make the network lose, repeat and reorder; False if that cannot be done here."""
        del sessions
        return False

    def calm(self, sessions: list[Any]) -> None:
        """Make the network kind again."""

    async def kill(self, session: Any) -> bool:
        """Let a session end without a word, as by kill -9; False if that cannot be done here."""
        del session
        return False

    def run(self, scenario: Callable[[list[Any]], Coroutine[Any, Any, None]], count: int = 2) -> None:
        """Run a test with `count` sessions."""

        async def main() -> None:
            async with self.sessions(count) as sessions:
                await scenario(sessions)

        with asyncio.Runner(loop_factory=type(self).factory) as runner:
            runner.run(main())

    def collected(self) -> Collected[Any]:
        """Make a callback that keeps what it is given."""
        return Collected(self.patience_s)

    async def reach(self, publisher: Publisher, *inboxes: Collected[Message], header: bytes = b"hello") -> None:
        """Put until it arrives everywhere: it takes a moment until subscribers are known."""

        def has_come(got: list[Message]) -> bool:
            return any(bytes(one[0]) == header for one in got)

        for _ in range(200):
            publisher.put(header)
            for inbox in inboxes:
                await inbox.wait(has_come, patience_s=self.patience_s / 100)
            if all(has_come(inbox.items) for inbox in inboxes):
                return
        raise AssertionError("nothing that is put arrives")

    # --- datagrams

    def test_a_datagram_reaches_all_who_have_subscribed(self) -> None:
        """Header and payload arrive as they were put, also at the session that has put them."""

        async def scenario(sessions: list[Session]) -> None:
            inboxes = [self.collected() for _ in sessions]
            for session, inbox in zip(sessions, inboxes, strict=True):
                session.subscribe("a/b c/%é", inbox)
            publisher = sessions[0].publisher("a/b c/%é", Traffic.TOKENS)
            await self.reach(publisher, *inboxes)
            publisher.put(b"\x00header\xff", memoryview(b"\x00payload\xff"))
            for inbox in inboxes:
                assert await inbox.wait(lambda got: _plain(got[-1]) == (b"\x00header\xff", b"\x00payload\xff"))

        self.run(scenario, 3)

    def test_keys_are_kept_apart(self) -> None:
        """What is put on one key is not heard on another, whatever characters are in them."""

        async def scenario(sessions: list[Session]) -> None:
            keys = ["a", "a/b", "a/b/c", "a/*", "a/**", "a b", "a%2Fb", "@a", "$*", "a?b", "a#b"]
            inboxes = {key: self.collected() for key in keys}
            for key, inbox in inboxes.items():
                sessions[1].subscribe(key, inbox)
            for key in keys:
                publisher = sessions[0].publisher(key, Traffic.TOKENS)
                await self.reach(publisher, inboxes[key])
                publisher.put(key.encode(), b"only")
                assert await inboxes[key].wait(lambda got, key=key: _plain(got[-1]) == (key.encode(), b"only"))  # type: ignore[misc]
            for key, inbox in inboxes.items():
                heard = {bytes(header) for header, _ in inbox.items} - {b"hello"}
                assert heard == {key.encode()}, f'on "{key}" was heard {heard}'

        self.run(scenario)

    def test_what_is_no_key_is_refused(self) -> None:
        """Chunks are not empty."""

        async def scenario(sessions: list[Session]) -> None:
            for key in ("", "/a", "a/", "a//b"):
                self._refuses(TransportError, partial(sessions[0].publisher, key, Traffic.TOKENS))
                self._refuses(TransportError, partial(sessions[0].subscribe, key, self.collected()))
                self._refuses(TransportError, partial(sessions[0].announce, key))

        self.run(scenario, 1)

    def test_datagrams_of_one_publisher_keep_their_order(self) -> None:
        """On a kind network; none is doubled. Some may be lost."""

        async def scenario(sessions: list[Session]) -> None:
            inbox = self.collected()
            sessions[1].subscribe("order", inbox)
            publisher = sessions[0].publisher("order", Traffic.TOKENS)
            await self.reach(publisher, inbox)
            for number in range(2000):
                publisher.put(b"number", number.to_bytes(4, "big"))
                if number % 100 == 99:  # datagrams that are not taken in time may be dropped, even on a perfect network
                    await self.reach(publisher, inbox, header=b"%d" % number)
            arrived = [payload for header, payload in map(_plain, inbox.items) if header == b"number"]
            numbers = [int.from_bytes(payload, "big") for payload in arrived]
            assert numbers == sorted(set(numbers)), "the order is lost, or something is doubled"
            assert len(numbers) > 1000, f"of 2000 datagrams {len(numbers)} have arrived on a kind network"

        self.run(scenario)

    def test_callbacks_come_on_the_loop_in_bursts_that_are_never_empty(self) -> None:
        """Many datagrams do not cost as many calls."""

        async def scenario(sessions: list[Session]) -> None:
            inbox = self.collected()
            sessions[1].subscribe("burst", inbox)
            publisher = sessions[0].publisher("burst", Traffic.BULK)
            await self.reach(publisher, inbox)
            for _ in range(1000):
                publisher.put(b"x")
            await self.reach(publisher, inbox, header=b"end")
            assert inbox.threads == {threading.get_ident()}
            assert all(inbox.bursts)
            assert len(inbox.bursts) < len(inbox.items), "each datagram wakes the loop by itself"

        self.run(scenario)

    def test_a_callback_that_raises_stops_nothing(self) -> None:
        """The session counts it and continues."""

        async def scenario(sessions: list[Session]) -> None:
            inbox = self.collected()

            def raises(burst: list[Message]) -> None:
                inbox(burst)
                raise ValueError("of purpose")

            sessions[1].subscribe("raises", raises)
            publisher = sessions[0].publisher("raises", Traffic.TOKENS)
            await self.reach(publisher, inbox)
            publisher.put(b"again")
            assert await inbox.wait(lambda got: _plain(got[-1])[0] == b"again")
            assert sessions[1].failed >= 2

        self.run(scenario)

    def test_large_datagrams_go_and_too_large_ones_are_refused(self) -> None:
        """The limit is known beforehand, and the refusal comes at once."""

        async def scenario(sessions: list[Session]) -> None:
            inbox = self.collected()
            sessions[1].subscribe("large", inbox)
            publisher = sessions[0].publisher("large", Traffic.TOKENS)
            await self.reach(publisher, inbox)
            limit = sessions[0].largest_message
            size = min(self.large, limit - 5)
            for attempt in range(20):  # even a kind network may lose it
                payload = bytes([attempt]) * size
                publisher.put(b"large", payload)
                if await inbox.wait(
                    lambda got, payload=payload: _plain(got[-1]) == (b"large", payload),  # type: ignore[misc]
                    patience_s=self.patience_s / 5,
                ):
                    break
            else:
                raise AssertionError(f"no datagram of {size} bytes arrives")
            if limit < 2**27:
                self._refuses(MessageTooLarge, lambda: publisher.put(b"12345", bytes(limit)))

        self.run(scenario)

    def test_a_put_that_nobody_hears_is_lost_in_silence(self) -> None:
        """It neither waits nor raises, and is not kept for those who come later."""

        async def scenario(sessions: list[Session]) -> None:
            publisher = sessions[0].publisher("nobody", Traffic.TOKENS)
            for _ in range(1000):
                publisher.put(b"early")
            inbox = self.collected()
            sessions[0].subscribe("nobody", inbox)
            sessions[1].subscribe("nobody", inbox)
            await self.reach(publisher, inbox)
            assert b"early" not in {bytes(header) for header, _ in inbox.items}

        self.run(scenario)

    def test_what_is_closed_is_silent(self) -> None:
        """A subscription that is closed is not called any more; closing twice does nothing; a publisher refuses."""

        async def scenario(sessions: list[Session]) -> None:
            closed, other = self.collected(), self.collected()
            subscription = sessions[1].subscribe("closing", closed)
            sessions[1].subscribe("closing", other)
            publisher = sessions[0].publisher("closing", Traffic.TOKENS)
            await self.reach(publisher, closed, other)
            subscription.close()
            subscription.close()
            before = len(closed.items)
            publisher.put(b"after")
            assert await other.wait(lambda got: _plain(got[-1])[0] == b"after")
            assert len(closed.items) == before
            publisher.close()
            publisher.close()
            self._refuses(TransportError, lambda: publisher.put(b"x"))

        self.run(scenario)

    # --- presence

    def test_who_watches_hears_of_those_who_are_there_and_of_those_who_come_and_go(self) -> None:
        """With their metadata; names elsewhere are not told, nor those that only begin alike."""

        async def scenario(sessions: list[Session]) -> None:
            sessions[0].announce("here/first", b"\x00one")
            sessions[0].announce("here too", b"")
            changes = self.collected()
            sessions[1].watch("here", changes)
            assert await changes.wait(lambda got: Presence("here/first", b"\x00one", True) in got)
            second = sessions[0].announce("here/a b/%*", b"two")
            assert await changes.wait(lambda got: got[-1] == Presence("here/a b/%*", b"two", True))
            second.close()
            second.close()
            assert await changes.wait(lambda got: got[-1] == Presence("here/a b/%*", b"", False))
            assert len(changes.items) == 3
            assert changes.threads == {threading.get_ident()}

        self.run(scenario)

    def test_a_name_is_announced_once_by_a_session(self) -> None:
        """A second time is a mistake; another session may, and both are reported."""

        async def scenario(sessions: list[Session]) -> None:
            sessions[0].announce("twice")
            self._refuses(TransportError, lambda: sessions[0].announce("twice"))
            sessions[1].announce("twice")
            changes = self.collected()
            sessions[2].watch("twice", changes)
            assert await changes.wait(lambda got: len(got) == 2)

        self.run(scenario, 3)

    def test_a_session_that_ends_is_told_as_gone(self) -> None:
        """All that it had announced."""

        async def scenario(sessions: list[Session]) -> None:
            for name in ("life/1", "life/2"):
                sessions[0].announce(name)
            changes = self.collected()
            sessions[1].watch("life", changes)
            assert await changes.wait(lambda got: len(got) == 2)
            await sessions[0].close()
            assert await changes.wait(lambda got: len(got) == 4)
            assert {one.name for one in changes.items if not one.present} == {"life/1", "life/2"}

        self.run(scenario)

    def test_a_session_that_dies_is_told_as_gone(self) -> None:
        """Without a word of its own."""

        async def scenario(sessions: list[Session]) -> None:
            sessions[0].announce("life")
            changes = self.collected()
            sessions[1].watch("life", changes)
            assert await changes.wait(lambda got: len(got) == 1)
            if await self.kill(sessions[0]):
                gone = Presence("life", b"", False)
                assert await changes.wait(lambda got: got[-1] == gone, patience_s=self.lease_s + self.patience_s)

        self.run(scenario)

    # --- questions

    def test_a_question_is_answered_or_refused(self) -> None:
        """The message of the handler's exception is sent to the caller."""

        async def scenario(sessions: list[Session]) -> None:
            async def answer(question: bytes) -> bytes:
                if question == b"refuse":
                    raise ValueError("not on a Sunday")
                await asyncio.sleep(0)
                return question + b"!"

            sessions[0].answer("ask/me", answer)
            assert await self.ask(sessions[1], "ask/me", b"\x00why") == b"\x00why!"
            error = await self._refused(QueryRefused, sessions[1].ask("ask/me", b"refuse"))
            assert "not on a Sunday" in str(error)
            assert await sessions[0].ask("ask/me", b"myself") == b"myself!"
            large = bytes(min(1_000_000, sessions[0].largest_message // 2))
            assert await sessions[1].ask("ask/me", large, timeout_s=self.patience_s) == large + b"!"

        self.run(scenario)

    def test_several_questions_are_under_way_at_once(self) -> None:
        """One that takes its time holds up no other."""

        async def scenario(sessions: list[Session]) -> None:
            may_answer = asyncio.Event()

            async def slow(question: bytes) -> bytes:
                if question == b"slow":
                    await may_answer.wait()
                return question

            sessions[0].answer("slow", slow)
            await self.ask(sessions[1], "slow", b"first")
            waiting = asyncio.ensure_future(sessions[1].ask("slow", b"slow", timeout_s=self.patience_s))
            assert await sessions[1].ask("slow", b"quick", timeout_s=self.patience_s) == b"quick"
            assert not waiting.done()
            may_answer.set()
            assert await waiting == b"slow"

        self.run(scenario)

    def test_a_question_that_nobody_answers_ends(self) -> None:
        """At once or after its time, and when who answers closes meanwhile."""

        async def scenario(sessions: list[Session]) -> None:
            await self._refused(NoAnswer, sessions[1].ask("nobody", timeout_s=0.5))
            asked = asyncio.Event()

            async def never(question: bytes) -> bytes:
                if question == b"hello":
                    return b""
                asked.set()
                await asyncio.Event().wait()
                raise AssertionError

            answering = sessions[0].answer("never", never)
            await self.ask(sessions[1], "never", b"hello")
            await self._refused(NoAnswer, sessions[1].ask("never", b"x", timeout_s=0.2))
            asked.clear()
            waiting = asyncio.ensure_future(sessions[1].ask("never", b"x", timeout_s=self.patience_s))
            await asked.wait()
            answering.close()
            await sessions[0].close()
            await self._refused(NoAnswer, waiting)

        self.run(scenario)

    # --- the end

    def test_closing_a_session_always_ends(self) -> None:
        """With all that it can have open, twice; afterwards nothing is called and all is refused."""

        async def scenario(sessions: list[Session]) -> None:
            inbox, changes = self.collected(), self.collected()

            async def never(question: bytes) -> bytes:
                await asyncio.Event().wait()
                return question

            parts: list[Closing] = [
                sessions[0].subscribe("end", inbox),
                sessions[0].watch("end", changes),
                sessions[0].announce("end/me"),
                sessions[0].answer("end", never),
            ]
            own = sessions[0].publisher("end", Traffic.BACKGROUND)
            publisher = sessions[1].publisher("end", Traffic.TOKENS)
            await self.reach(publisher, inbox)
            waiting = asyncio.ensure_future(sessions[0].ask("end", b"x", timeout_s=60))
            await asyncio.sleep(0)
            for _ in range(100):
                publisher.put(b"x" * 1000)
            async with asyncio.timeout(self.patience_s):
                await sessions[0].close()
                await sessions[0].close()
                await self._refused(NoAnswer, waiting)
            before = len(inbox.bursts), len(changes.bursts)
            publisher.put(b"late")
            echo = self.collected()
            sessions[1].subscribe("end", echo)
            await self.reach(publisher, echo)
            assert (len(inbox.bursts), len(changes.bursts)) == before, "a session that is closed calls back"
            for part in parts:
                part.close()
            self._refuses(TransportError, lambda: own.put(b"x"))
            self._refuses(TransportError, lambda: sessions[0].subscribe("end", inbox))
            self._refuses(TransportError, lambda: sessions[0].publisher("end", Traffic.TOKENS))

        self.run(scenario)

    # --- links

    def test_an_exact_link_delivers_each_token_once_and_in_order(self) -> None:
        """Rules L1 and L2, with windows small and large; the ends come in either order."""

        async def scenario(sessions: list[Session]) -> None:
            for window, count in ((1, 50), (8, 500), (64, 2000)):
                sender = self._sender(sessions[0], f"link/{window}", window=window)
                assert await self._pass(sender, sessions[1], count) == list(range(1, count + 1))
                statistics = sender.statistics()
                assert statistics["sent"] == count
                assert statistics["unfinished"] == 0
                await sender.close()

        self.run(scenario)

    def test_an_exact_link_goes_on_with_a_consumer_that_returns(self) -> None:
        """Rule L2: from its ledger on."""

        async def scenario(sessions: list[Session]) -> None:
            sender = self._sender(sessions[0], "link/return", window=8)
            sending = asyncio.ensure_future(self._send(sender, 300))
            ledger: list[Delivery] = []
            for life in range(1, 11):
                known = ledger[-1].position if ledger else None
                receiver = self._receiver(sessions[life % 2], "link/return", life, known)
                while len(ledger) < 30 * life:
                    ledger.append(await self._in_time(receiver.take()))
                    if len(ledger) < 30 * life:  # it dies between its record and its word on it
                        receiver.done()
                await receiver.close()
            await self._in_time(self._finish(sender, sessions[1], ledger[-1].position))
            await sending
            assert [int(bytes(one.value)) for one in ledger] == list(range(1, 301))

        self.run(scenario)

    def test_an_exact_link_holds_its_producer_back(self) -> None:
        """Rules L1 and L3: a window, without a consumer."""

        async def scenario(sessions: list[Session]) -> None:
            sender = self._sender(sessions[0], "link/held", window=4)
            sending = asyncio.ensure_future(self._send(sender, 8))
            await asyncio.sleep(0.2)
            assert not sending.done()
            assert sender.machine.position.sequence == 4
            receiver = self._receiver(sessions[1], "link/held", 1, None)
            for number in range(1, 9):
                token = await self._in_time(receiver.take())
                assert token.sequence == number
                receiver.done()
            await self._in_time(sender.wait_finished())
            await sending

        self.run(scenario)

    def test_an_exact_link_reaches_several_consumers(self) -> None:
        """Each gets all, and the slowest holds the producer back."""

        async def scenario(sessions: list[Session]) -> None:
            sender = LinkSender(sessions[0], "link/several", epoch=1, window=4)
            receivers = []
            for number, session in enumerate(sessions):
                sender.admit(f"consumer {number}")
                receivers.append(LinkReceiver(session, "link/several", consumer=f"consumer {number}", incarnation=1))
            sending = asyncio.ensure_future(self._send(sender, 100))
            got = await self._in_time(asyncio.gather(*(self._take(one, 100) for one in receivers)))
            assert got == [list(range(1, 101))] * len(sessions)
            await self._in_time(sending)

        self.run(scenario, 3)

    def test_an_exact_link_bears_what_the_network_does(self) -> None:
        """Rule L2 under disturbance, if the transport can be disturbed."""

        async def scenario(sessions: list[Session]) -> None:
            if self.disturb(sessions):
                for window, count in ((1, 40), (8, 150)):
                    sender = self._sender(sessions[0], f"link/disturbed/{window}", window=window, probe_s=0.02)
                    assert await self._pass(sender, sessions[1], count) == list(range(1, count + 1))
                    assert sender.statistics()["resent"] > 0, "nothing was disturbed"
                    await sender.close()
                self.calm(sessions)

        self.run(scenario)

    def test_a_bounded_link_counts_what_it_loses(self) -> None:
        """Each token at most once and in order; what is missing is in the numbers."""

        async def scenario(sessions: list[Session]) -> None:
            receiver = BoundedReceiver(sessions[1], "link/bounded", capacity=10_000)
            sender = BoundedSender(sessions[0], "link/bounded", epoch=1)
            first = 0
            while not first:  # until the subscription is known
                sender.send_nowait((b"", b"hello"))
                try:
                    async with asyncio.timeout(self.patience_s / 100):
                        first = (await receiver.take()).sequence
                except TimeoutError:
                    continue
            disturbed = self.disturb(sessions)
            for number in range(1000):
                last = sender.send_nowait((b"", b"%d" % number))
                if number % 10 == 9:
                    await asyncio.sleep(0)
            self.calm(sessions)
            numbers = [first]
            while numbers[-1] < last:
                sender.send_nowait((b"", b"more"))
                numbers.append((await self._in_time(receiver.take())).sequence)
            assert numbers == sorted(set(numbers))
            counts = receiver.statistics()
            assert counts["lost"] + counts["received"] == numbers[-1] + receiver.machine.waiting - first + 1
            assert counts["lost"] > 0 or not disturbed

        self.run(scenario)

    # --- parts of the tests

    def _sender(self, session: Session, name: str, *, window: int, probe_s: float = 0.1) -> LinkSender:
        sender = LinkSender(session, name, epoch=1, window=window, probe_s=probe_s)
        sender.admit("consumer")
        return sender

    def _receiver(self, session: Session, name: str, life: int, ledger: Position | None) -> LinkReceiver:
        return LinkReceiver(session, name, consumer="consumer", incarnation=life, ledger=ledger, capacity=64)

    async def _send(self, sender: LinkSender, count: int) -> None:
        for number in range(1, count + 1):
            await sender.send((b"", b"%d" % number))
        await sender.wait_finished()

    async def _take(self, receiver: LinkReceiver, count: int) -> list[int]:
        numbers = []
        for _ in range(count):
            numbers.append(int(bytes((await receiver.take()).value)))
            receiver.done()
        return numbers

    async def _pass(self, sender: LinkSender, session: Session, count: int) -> list[int]:
        sending = asyncio.ensure_future(self._send(sender, count))
        receiver = self._receiver(session, sender.name, 1, None)
        numbers: list[int] = await self._in_time(self._take(receiver, count))
        await self._in_time(sending)
        await receiver.close()
        return numbers

    async def _finish(self, sender: LinkSender, session: Session, ledger: Position) -> None:
        """The last life only tells what was recorded before."""
        receiver = self._receiver(session, sender.name, 99, ledger)
        await sender.wait_finished()
        await receiver.close()

    async def ask(self, session: Session, name: str, question: bytes) -> bytes:
        """Ask until there is an answer: it takes a moment until the answerer is known."""
        for _ in range(100):
            try:
                return await session.ask(name, question, timeout_s=self.patience_s)
            except NoAnswer:
                await asyncio.sleep(self.patience_s / 1000)
        raise AssertionError(f'there is no answer to "{name}"')

    async def _in_time(self, what: Any) -> Any:
        async with asyncio.timeout(6 * self.patience_s):
            return await what

    def _refuses(self, error: type[Exception], call: Callable[[], object]) -> None:
        try:
            call()
        except error:
            return
        raise AssertionError(f"{error.__name__} was expected")

    async def _refused(self, error: type[Exception], what: Any) -> Exception:
        try:
            await what
        except error as found:
            return found
        raise AssertionError(f"{error.__name__} was expected")
