"""Programs that meet by a name: the publishing and the subscribing end, over a session of a transport (rules L1 to L4).

Each publisher has two links of his own, an exact one for consumers that want every value and a bounded one for all
others; a consumer announces that it takes part, and is admitted. Who announces what, and who fits whom, is in `offers`;
here is what follows from it. Programs come in any order, die and return: a watch over the name tells, within the lease
of the transport. Stands on `running` and `offers`.
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
from collections.abc import Callable
from typing import Any, Final, Literal, TypeAlias

import msgspec

from hfg.encoding import TokenCodec
from hfg.errors import EncodingError, QueueOverflow, TransportError
from hfg.links.offers import Introduction, introduce, key_of, read_introduction, read_name, unfit
from hfg.links.running import BoundedReceiver, BoundedSender, LinkReceiver, LinkSender
from hfg.token import END, Token
from hfg.transport import Closing, LinkOverflow, Presence, Session

__all__ = ["Absent", "Publication", "PublicationCounts", "Subscription", "SubscriptionCounts"]

Absent: TypeAlias = Literal["pass", "wait"]

_MOST: Final = 1_000  # publishers of one name, and consumers of one publisher, that are taken note of
_ANSWER_S: Final = 2.0  # how long a publisher may take to answer


class _News:
    """Something has changed: whoever waits looks again."""

    def __init__(self) -> None:
        self._event = asyncio.Event()

    def tell(self) -> None:
        self._event.set()

    async def wait(self) -> None:
        await self._event.wait()
        self._event.clear()


class PublicationCounts(msgspec.Struct):
    """What has happened at a publisher.

    Attributes:
      sent: values that somebody was there for.
      passed: values that nobody was there for.
      joined: consumers that have come.
      left: those that have gone, whatever the reason.
      refused: those that do not fit.
      lost: values that were on their way to consumers that have gone.
    """

    sent: int = 0
    passed: int = 0
    joined: int = 0
    left: int = 0
    refused: int = 0
    lost: int = 0


class Publication:
    """The publishing end.

    Args:
      session: of the transport, on the running loop.
      name: by which the programs meet.
      hint: the declared type of the values.
      who: for people, whose end this is.
      lossless: whether those who want every value are waited for; else nobody is.
      window: how many values may be on their way to them.
      absent: "pass": values go by while nobody is there; "wait": they wait until somebody comes, who also gets what the
        last one that has gone had not done.
      complain: told each sentence about somebody who does not fit, once.

    Attributes:
      counts: what has happened.
    """

    def __init__(
        self,
        session: Session,
        name: str,
        hint: Any,
        *,
        who: str,
        lossless: bool = True,
        window: int = 8,
        absent: Absent = "pass",
        complain: Callable[[str], None] = lambda _: None,
    ) -> None:
        said = introduce(hint, who, lossless=lossless)
        mine = read_introduction(said)
        assert mine is not None
        self.name = name
        self.counts = PublicationCounts()
        self._hint = hint
        self._mine = mine
        self._complain = complain
        self._waits = absent == "wait"
        self._codec = TokenCodec[Any](hint, what=f'a value of "{name}"')
        self._number = 0
        self._latest: Token[Any] | None = None
        self._over = self._closed = False
        self._members: set[str] = set()  # who gets every value
        self._left: list[str] = []  # who did, and whose place waits for an heir
        self._listeners: set[str] = set()  # who gets what arrives
        self._told: set[str] = set()
        self._news = _News()
        self._id = secrets.token_hex(8)
        key = key_of(name, self._id)
        self._exact = LinkSender(session, f"{key}/exact", epoch=1, window=window)
        self._bounded = BoundedSender(session, f"{key}/bounded", epoch=1)
        self._session = session
        self._open: list[Closing] = [
            session.answer(f"{key}/latest", self._tell_latest),
            session.answer(f"{key}/finished", self._hear_finished),
            session.watch(key_of(name), self._changed),
            session.announce(f"{key}/offer", said),
        ]

    @property
    def attended(self) -> bool:
        """Whether somebody takes part."""
        return bool(self._members or self._listeners)

    async def send(self, value: object, stamp: float) -> None:
        """Publish a value or marker; wait while those who get every value have no room for it.

        Raises:
          EncodingError: the value is not of the declared type, or too large.
          TransportError: the publication is closed, or the value is too large for the transport.
        """
        self._number += 1
        token = self._latest = Token(value, 0, stamp, self._number)
        while self._waits and not self.attended:
            self._need_open()
            await self._news.wait()
        self._need_open()
        if not self.attended:
            self.counts.passed += 1
            return
        encoded = self._codec.encode(token)
        if self._members:
            await self._exact.send(encoded)
        if self._listeners:
            self._bounded.send_nowait(encoded)
        self.counts.sent += 1

    async def end(self, stamp: float) -> None:
        """Say that nothing more comes, and wait until all who get every value have done with it."""
        self._over = True
        if self.attended or self._waits:
            await self.send(END, stamp)
        self._latest = None
        self._open.append(self._session.announce(f"{key_of(self.name, self._id)}/end"))
        await self._exact.wait_finished()

    async def close(self) -> None:
        """Take part no more; who is still there sees that this end has gone."""
        if self._closed:
            return
        self._closed = True
        for one in reversed(self._open):  # the offer before the end, which says why it is gone
            one.close()
        await self._bounded.close()
        self.counts.lost += self._exact.machine.unfinished
        await self._exact.close()
        self._news.tell()

    def statistics(self) -> dict[str, int]:
        """What has happened, in numbers."""
        here = {"here": len(self._members) + len(self._listeners)}
        return msgspec.structs.asdict(self.counts) | here | {"resent": self._exact.machine.counts.resent}

    def _need_open(self) -> None:
        if self._closed:
            raise TransportError(f'"{self.name}" is published no more: its publisher is closed')

    async def _tell_latest(self, question: bytes) -> bytes:
        del question
        if self._latest is None:
            return b""
        return msgspec.msgpack.encode(self._codec.encode(self._latest))

    async def _hear_finished(self, consumer: bytes) -> bytes:
        """Somebody has done the end itself, and goes: his last word on the link may get lost, this one does not."""
        name = consumer.decode(errors="replace")
        if self._over and name in self._members:
            self._members.remove(name)
            self.counts.left += 1
            self._exact.dismiss(name)
        return b""

    # --- who comes and goes

    def _changed(self, presences: list[Presence]) -> None:
        for one in presences:
            seen = read_name(self.name, one.name)
            if seen is None:
                continue
            if seen.publisher != self._id:
                if seen.what == "offer" and one.present:
                    self._another(one)
            elif seen.what == "join":
                if one.present:
                    self._join(seen.consumer, one.metadata)
                else:
                    self._leave(seen.consumer)
        self._news.tell()

    def _another(self, one: Presence) -> None:
        other = read_introduction(one.metadata)
        whose = "something that says nothing of itself" if other is None else other.who
        self._tell_once(
            f'"{self.name}" is published twice: here and by {whose}; each subscriber takes the first that it finds, so '
            "give one of them another name or end it"
        )

    def _join(self, consumer: str, metadata: bytes) -> None:
        if consumer in self._members or consumer in self._listeners:
            return
        theirs = read_introduction(metadata)
        if theirs is None or len(self._members) + len(self._listeners) >= _MOST:
            self.counts.refused += 1
            return
        problem = unfit(self._hint, self._mine, theirs, here="publisher")
        if problem:
            self.counts.refused += 1
            self._tell_once(f'"{self.name}" is not sent to {theirs.who}: {problem}')
            return
        self.counts.joined += 1
        if not theirs.lossless:
            self._listeners.add(consumer)
            return
        self._members.add(consumer)
        if consumer in self._left:  # it was cut off, and its place is still there
            self._left.remove(consumer)
        elif self._left:
            self._exact.admit(consumer, 1, after=0)  # all that its predecessors have not done
            while self._left:
                self._exact.dismiss(self._left.pop())
        else:
            self._exact.admit(consumer, 1)

    def _leave(self, consumer: str) -> None:
        if consumer in self._listeners:
            self._listeners.remove(consumer)
        elif consumer in self._members:
            self._members.remove(consumer)
            if self._waits and not self._members:
                self._left.append(consumer)
            else:
                before = self._exact.machine.counts.given_up
                self._exact.dismiss(consumer)
                self.counts.lost += self._exact.machine.counts.given_up - before
        else:
            return
        self.counts.left += 1

    def _tell_once(self, sentence: str) -> None:
        if sentence not in self._told and len(self._told) < _MOST:
            self._told.add(sentence)
            self._complain(sentence)


class SubscriptionCounts(msgspec.Struct):
    """What has happened at a subscriber.

    Attributes:
      received: values that were taken.
      joined: publishers that were joined.
      left: those that have gone or ended.
      refused: publishers that do not fit, and values that are not of the type.
      lost: values that are missing, on their way or between two publishers' lives as far as that is known.
      dropped: values that were too many, by `overflow`.
    """

    received: int = 0
    joined: int = 0
    left: int = 0
    refused: int = 0
    lost: int = 0
    dropped: int = 0


class Subscription:
    """The subscribing end.

    It takes part in what one publisher sends, the first that fits; when that has gone, in what the next one does.

    Args:
      session: of the transport, on the running loop.
      name: by which the programs meet.
      hint: the declared type of the values.
      who: for people, whose end this is.
      overflow: "wait": the publisher waits for this end, and nothing is lost; else what becomes of a value too many.
      capacity: how many values wait here.
      latest: begin with the latest value that was published before.
      complain: told each sentence about somebody who does not fit, once.

    Attributes:
      counts: what has happened.
    """

    def __init__(
        self,
        session: Session,
        name: str,
        hint: Any,
        *,
        who: str,
        overflow: Literal["wait"] | LinkOverflow = "wait",
        capacity: int = 8,
        latest: bool = False,
        complain: Callable[[str], None] = lambda _: None,
    ) -> None:
        said = introduce(hint, who, lossless=overflow == "wait")
        mine = read_introduction(said)
        assert mine is not None
        self.name = name
        self.counts = SubscriptionCounts()
        self._session = session
        self._hint = hint
        self._said = said
        self._mine = mine
        self._overflow = overflow
        self._capacity = capacity
        self._wants_latest = latest
        self._complain = complain
        self._codec = TokenCodec[Any](hint, what=f'a value of "{name}"')
        self._id = secrets.token_hex(8)
        self._lives = 0
        self._offers: dict[str, Introduction] = {}  # who publishes, in the order in which they were heard of
        self._ended: set[str] = set()
        self._protests: dict[str, Closing] = {}  # what tells those who do not fit that somebody would take part
        self._told: set[str] = set()
        self._joined = ""
        self._part: Closing | None = None
        self._receiver: LinkReceiver | BoundedReceiver | None = None
        self._undone = False
        self._closed = False
        self._news = _News()
        self._watch = session.watch(key_of(name), self._changed)

    async def take(self) -> Token[Any] | None:
        """Give the next token, waiting for it; the one before is done.

        END ends what one publisher sends, and None means that he has gone without an end. Behind both it goes on with
        whoever publishes next.

        Raises:
          QueueOverflow: a value was too many, under overflow="error".
          TransportError: the subscription is closed.
        """
        self._done()
        while True:
            if self._closed:
                raise TransportError(f'the subscription to "{self.name}" is closed')
            receiver = self._receiver
            if receiver is None:
                token = await self._join_one()
            else:
                token = self._next_of(receiver)
                if token is None and self._joined not in self._offers:
                    ended = self._joined in self._ended
                    await self._leave()
                    return Token(END) if ended else None
            if token is None:
                await self._news.wait()
            elif token.value is END:
                self._done()
                self._ended.add(self._joined)
                await self._say_finished()
                await self._leave()
                return token
            else:
                self.counts.received += 1
                return token

    async def close(self) -> None:
        """Take part no more."""
        if self._closed:
            return
        self._closed = True
        self._watch.close()
        self._done()
        await self._leave()
        for one in self._protests.values():
            one.close()
        self._news.tell()

    def statistics(self) -> dict[str, int]:
        """What has happened, in numbers."""
        receiver = self._receiver
        waiting = 0 if receiver is None else receiver.machine.waiting
        counts = msgspec.structs.asdict(self.counts)
        if receiver is not None:
            for name, more in self._missing(receiver).items():
                counts[name] += more
        return counts | {"here": int(receiver is not None), "waiting": waiting}

    # --- tokens

    def _next_of(self, receiver: LinkReceiver | BoundedReceiver) -> Token[Any] | None:
        while True:
            if isinstance(receiver, BoundedReceiver) and receiver.machine.overflowed:
                receiver.machine.overflowed = False
                raise QueueOverflow(
                    f'more values of "{self.name}" wait than its capacity={self._capacity}; raise that, or choose '
                    'another overflow, such as "latest"'
                )
            delivery = receiver.take_nowait()
            if delivery is None:
                return None
            self._undone = True
            try:
                return self._codec.decode(*delivery.token)
            except EncodingError as error:
                self.counts.refused += 1
                self._tell_once(f'"{self.name}": {error}')
                self._done()

    def _done(self) -> None:
        if self._undone and isinstance(self._receiver, LinkReceiver):
            self._receiver.done()
        self._undone = False

    # --- who comes and goes

    def _changed(self, presences: list[Presence]) -> None:
        for one in presences:
            seen = read_name(self.name, one.name)
            if seen is None:
                continue
            if seen.what == "offer" and one.present:
                introduction = read_introduction(one.metadata)
                if introduction is not None and len(self._offers) < _MOST:
                    self._offers.setdefault(seen.publisher, introduction)
            elif seen.what == "offer":
                self._offers.pop(seen.publisher, None)
                protest = self._protests.pop(seen.publisher, None)
                if protest is not None:
                    protest.close()
            elif seen.what == "end" and one.present and seen.publisher == self._joined:
                self._ended.add(seen.publisher)
        self._look_for_others()
        self._news.tell()

    def _look_for_others(self) -> None:
        others = [self._offers[one].who for one in self._offers if one not in self._protests and one != self._joined]
        if self._joined in self._offers and others:
            self._tell_once(
                f'"{self.name}" is published twice: by {self._offers[self._joined].who}, which is listened to, and by '
                f"{others[0]}; give one of them another name or end it"
            )

    async def _join_one(self) -> Token[Any] | None:
        """Take part in what the first publisher sends that fits; give its latest value if that is wanted."""
        for publisher, theirs in tuple(self._offers.items()):
            if publisher in self._ended or publisher in self._protests:
                continue
            consumer = f"{self._id}.{self._lives}"
            self._lives += 1
            key = key_of(self.name, publisher)
            problem = unfit(self._hint, theirs, self._mine, here="consumer")
            if problem:
                self.counts.refused += 1
                self._tell_once(f'"{self.name}" of {theirs.who} is not taken: {problem}')
                self._protests[publisher] = self._session.announce(f"{key}/join {consumer}", self._said)
                continue
            self._joined = publisher
            self.counts.joined += 1
            token = await self._ask_latest(key) if self._wants_latest else None
            if self._overflow == "wait":
                self._receiver = LinkReceiver(
                    self._session,
                    f"{key}/exact",
                    consumer=consumer,
                    incarnation=1,
                    capacity=self._capacity,
                    arrived=self._news.tell,
                )
            else:
                self._receiver = BoundedReceiver(
                    self._session,
                    f"{key}/bounded",
                    capacity=self._capacity,
                    overflow=self._overflow,
                    arrived=self._news.tell,
                )
            # Only now, for what is sent from here on has somebody who hears it.
            self._part = self._session.announce(f"{key}/join {consumer}", self._said)
            self._look_for_others()
            self._news.tell()
            return token
        return None

    async def _ask_latest(self, key: str) -> Token[Any] | None:
        try:
            answer = await self._session.ask(f"{key}/latest", timeout_s=_ANSWER_S)
            return self._codec.decode(*msgspec.msgpack.decode(answer, type=tuple[bytes, bytes])) if answer else None
        except (TransportError, EncodingError, msgspec.DecodeError):
            return None  # it has gone, or has none that can be told: then from now on

    async def _say_finished(self) -> None:
        receiver = self._receiver
        if isinstance(receiver, LinkReceiver):
            with contextlib.suppress(TransportError):  # it has heard by the link, and is gone
                key = key_of(self.name, self._joined)
                await self._session.ask(f"{key}/finished", receiver.machine.name.encode(), timeout_s=_ANSWER_S)

    async def _leave(self) -> None:
        receiver = self._receiver
        if receiver is None:
            return
        for name, more in self._missing(receiver).items():
            setattr(self.counts, name, getattr(self.counts, name) + more)
        self.counts.left += 1
        self._receiver, part, self._part = None, self._part, None
        self._undone = False
        await receiver.close()
        if part is not None:
            part.close()
        self._joined = ""

    @staticmethod
    def _missing(receiver: LinkReceiver | BoundedReceiver) -> dict[str, int]:
        if isinstance(receiver, LinkReceiver):
            return {"lost": receiver.machine.counts.missed}
        return {"lost": receiver.machine.counts.lost, "dropped": receiver.machine.counts.dropped}

    def _tell_once(self, sentence: str) -> None:
        if sentence not in self._told and len(self._told) < _MOST:
            self._told.add(sentence)
            self._complain(sentence)
