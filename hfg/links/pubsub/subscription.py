"""The subscribing end of programs that connect by a name.

Depends on `end` and `hfg.links.running`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any, Final, Literal

import msgspec

from hfg.base.token import END, Token
from hfg.errors import EncodingError, QueueOverflow, TransportError
from hfg.links.offers import Introduction, key_of, read_introduction, unfit
from hfg.links.pubsub.end import MOST, End
from hfg.links.running import BoundedReceiver, LinkReceiver
from hfg.transport import Closing, LinkOverflow, Presence, Session

_ANSWER_S: Final = 2.0  # how long a publisher may take to answer


class SubscriptionCounts(msgspec.Struct):
    """Counts of a subscriber.

    Attributes:
      received: values that were taken.
      repeated: values that were already received from a previous incarnation of the publisher, and are not returned
        again.
      joined: publishers that were joined.
      left: publishers that have gone or ended.
      refused: publishers that do not match, and values that are not of the type.
      lost: missing values, lost in transit or between two incarnations of a publisher, as far as known.
      dropped: values dropped by the policy `overflow`.
    """

    received: int = 0
    repeated: int = 0
    joined: int = 0
    left: int = 0
    refused: int = 0
    lost: int = 0
    dropped: int = 0


class Subscription(End):
    """The subscribing end.

    It subscribes to one publisher, the first that matches; when this one has gone, to the next.

    Args:
      session: of the transport, on the running loop.
      name: the common name of the programs.
      hint: the declared type of the values.
      who: the owner of this end, for messages.
      overflow: "wait": the publisher waits for this end, and nothing is lost; otherwise, what to do with a value when
        the queue is full.
      capacity: maximum number of waiting values.
      latest: start with the latest value that was published before.
      complain: called with each message about an end that does not match, once.

    Attributes:
      counts: see `SubscriptionCounts`.
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
        super().__init__(session, name, hint, who, lossless=overflow == "wait", complain=complain)
        self.counts = SubscriptionCounts()
        self._overflow = overflow
        self._capacity = capacity
        self._wants_latest = latest
        self._lives = 0
        self._offers: dict[str, Introduction] = {}  # who publishes, in the order in which they were heard of
        self._ended: set[str] = set()
        # announcements that tell publishers that do not match about this subscriber
        self._protests: dict[str, Closing] = {}
        self._joined = ""
        self._stream = ""  # of its publisher, if this has an outbox
        self._part: Closing | None = None
        self._receiver: LinkReceiver | BoundedReceiver | None = None
        self._undone = False
        self._taken: dict[str, int] = {}  # the last number of each stream of a publisher with an outbox
        self._watch = session.watch(key_of(name), self._changed)

    async def take(self) -> Token[Any] | None:
        """Wait for the next token and return it; the previous one is acknowledged.

        END ends the stream of one publisher, and None means that the publisher has gone without an END. After both, it
        continues with the next publisher.

        Raises:
          QueueOverflow: the queue overflowed under overflow="error".
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
        """Return the counts."""
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
                receiver.machine.forget_overflow()
                raise QueueOverflow(
                    f'more values of "{self.name}" wait than its capacity={self._capacity}; raise that, or choose '
                    'another overflow, such as "latest"'
                )
            delivery = receiver.take_nowait()
            if delivery is None:
                return None
            self._undone = True
            try:
                token = self._codec.decode(*delivery.token)
            except EncodingError as error:
                self.counts.refused += 1
                self._tell_once(f'"{self.name}": {error}')
            else:
                if self._is_new(token):
                    return token
                self.counts.repeated += 1
            self._done()

    def _is_new(self, token: Token[Any]) -> bool:
        """Whether it was not taken before; publishers with an outbox send again what may not be done."""
        stream = self._stream
        if not stream or token.value is END:
            return True
        if token.sequence <= self._taken.get(stream, 0):
            return False
        if stream in self._taken or len(self._taken) < MOST:
            self._taken[stream] = token.sequence
        return True

    def _done(self) -> None:
        if self._undone and isinstance(self._receiver, LinkReceiver):
            self._receiver.done()
        self._undone = False

    # --- who comes and goes

    def _changed(self, presences: list[Presence]) -> None:
        for seen, one in self._seen(presences):
            if seen.what == "offer" and one.present:
                introduction = read_introduction(one.metadata)
                if introduction is not None and len(self._offers) < MOST:
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
                f'"{self.name}" is published twice: by {self._offers[self._joined].who}, which is subscribed '
                f"to, and by {others[0]}; rename or stop one of them"
            )

    async def _join_one(self) -> Token[Any] | None:
        """Subscribe to the first publisher that matches. Return its latest value if that is wanted."""
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
            self._stream = theirs.stream if self._overflow == "wait" else ""
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
            # Only now, because values sent from here on have a receiver.
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
            return None  # it has gone, or has no latest value to send: then only later values count

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
