"""The publishing end of programs that connect by a name.

Depends on `end`, `outbox`, `returning` and `hfg.links.running`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any, Literal, TypeAlias

import msgspec
from msgspec.structs import replace

from hfg.base.token import END, Token
from hfg.errors import EncodingError, RunError, TransportError
from hfg.links import Outbox
from hfg.links.offers import key_of, read_introduction, unfit
from hfg.links.pubsub.end import MOST, End
from hfg.links.pubsub.outbox import KeptValue, OutboxFile
from hfg.links.pubsub.returning import Returning, identity_of
from hfg.links.running import BoundedSender, LinkSender
from hfg.transport import Closing, EncodedToken, Presence, Session

Absent: TypeAlias = Literal["pass", "wait"]


class PublicationCounts(msgspec.Struct):
    """Counts of a publisher.

    Attributes:
      sent: values with a subscriber.
      passed: values without a subscriber.
      restored: values of a previous incarnation that were not acknowledged, and are sent again.
      joined: consumers that have joined.
      left: consumers that have gone, for whatever reason.
      refused: consumers that do not match.
      lost: values in transit to consumers that have gone.
    """

    sent: int = 0
    passed: int = 0
    restored: int = 0
    joined: int = 0
    left: int = 0
    refused: int = 0
    lost: int = 0


class Publication(End):
    """The publishing end.

    Args:
      session: of the transport, on the running loop.
      name: the common name of the programs.
      hint: the declared type of the values.
      who: the owner of this end, for messages.
      lossless: wait for consumers that want every value; otherwise, for none.
      window: how many values may be in transit to them.
      absent: "pass": values are discarded while there is no consumer; "wait": they wait until a consumer joins, which
        also gets the unacknowledged values of the last one that left.
      outbox: stores unacknowledged values for the next incarnation of this publisher, which waits for consumers that
        want every value; it is closed together with this end.
      complain: called with each message about an end that does not match, once.

    Attributes:
      counts: see `PublicationCounts`.
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
        outbox: OutboxFile | None = None,
        complain: Callable[[str], None] = lambda _: None,
    ) -> None:
        stream = "" if outbox is None else outbox.stream
        super().__init__(session, name, hint, who, lossless=lossless, complain=complain, stream=stream)
        self.counts = PublicationCounts()
        self._waits = absent == "wait" or outbox is not None
        self._outbox = outbox
        self._number = 0 if outbox is None else outbox.last
        self._latest: Token[Any] | None = None
        self._over = False
        self._members: set[str] = set()  # who gets every value
        self._left: list[str] = []  # consumers that left, whose place waits for a successor
        self._listeners: set[str] = set()  # who gets what arrives
        self._returning: Returning | None = None  # who did in a former life
        key = key_of(name, self._id)
        self._exact = self._sender(f"{key}/exact", window)
        self._bounded = BoundedSender(session, f"{key}/bounded", epoch=1)
        self._open: list[Closing] = [
            session.answer(f"{key}/latest", self._tell_latest),
            session.answer(f"{key}/finished", self._hear_finished),
            session.watch(key_of(name), self._changed),
            session.announce(f"{key}/offer", self._said),
        ]

    def _sender(self, key: str, window: int) -> LinkSender:
        """Make the link of those who get every value; what was not done in a former life is on it already."""
        if self._outbox is None:
            return LinkSender(self._session, key, epoch=1, window=window)
        kept = self._restored(self._outbox)
        if kept:
            self._number = kept[-1].number
        tokens = tuple((one.metadata, one.value) for one in kept)
        before = Outbox(1, self._number + 1 - len(kept), tokens)
        link = LinkSender(self._session, key, epoch=1, window=max(window, len(kept)), outbox=before)
        self.counts.restored = len(kept)
        if self._outbox.last:  # there was a former life, and those who were there may come back
            self._returning = Returning(link, self._outbox.members)
        return link

    def _restored(self, outbox: OutboxFile) -> list[KeptValue]:
        """Return the values to send again. An END was the end of that incarnation."""
        found = []
        for one in outbox.kept:
            try:
                token = self._codec.decode(one.metadata, one.value)
            except EncodingError as error:
                raise RunError(
                    f'outbox "{outbox.path}" of "{self.name}" is broken: {error}; restore it from a copy, or '
                    "remove it to start over"
                ) from error
            if token.value is not END:
                found.append(one)
        return found

    @property
    def attended(self) -> bool:
        """Whether there is a consumer."""
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
        if self._outbox is not None:
            encoded = await self._send_kept(self._outbox, token)
        else:
            encoded = self._codec.encode(token)
            if self._members or self._left:
                await self._exact.send(encoded)
        if self._listeners:
            self._bounded.send_nowait(encoded)
        self.counts.sent += 1

    async def _send_kept(self, outbox: OutboxFile, token: Token[Any]) -> EncodedToken:
        """Send a value that is on disk by then.

        Its number is also its number on the link, so that consumers recognise repetitions.
        """
        await self._exact.wait_free()
        self._number = self._exact.machine.position.sequence + 1
        encoded = self._codec.encode(replace(token, sequence=self._number))
        kept = KeptValue(self._number, *map(bytes, encoded))
        members = {identity_of(one) for one in self._members}
        if self._returning is not None:
            members |= self._returning.expected
        await asyncio.to_thread(outbox.keep, kept, self._exact.released, members)
        self._need_open()
        await self._exact.send(encoded)
        return encoded

    async def end(self, stamp: float) -> None:
        """Say that nothing more comes, and wait until all who get every value have done with it."""
        self._over = True
        if self.attended or self._waits:
            await self.send(END, stamp)
        self._latest = None
        if self._outbox is not None:  # who lacks something waits for the next life of this publisher, if it dies now
            await self._exact.wait_finished()
            await asyncio.to_thread(self._outbox.clear)
        self._open.append(self._session.announce(f"{key_of(self.name, self._id)}/end"))
        await self._exact.wait_finished()

    async def close(self) -> None:
        """Take part no more; who is still there sees that this end has gone."""
        if self._closed:
            return
        self._closed = True
        # withdraw the offer before the end announcement, which explains why the offer is gone
        for one in reversed(self._open):
            one.close()
        await self._bounded.close()
        done = self._exact.released
        if self._outbox is None:
            self.counts.lost += self._exact.machine.unfinished
        await self._exact.close()
        self._news.tell()
        if self._returning is not None:
            self._returning.close()
        if self._outbox is not None:
            try:
                await asyncio.to_thread(self._outbox.forget, done)
            finally:
                self._outbox.close()

    def statistics(self) -> dict[str, int]:
        """Return the counts."""
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
        """Answer a consumer that has processed the END and leaves.

        Its last status on the link may get lost; this answer does not.
        """
        name = consumer.decode(errors="replace")
        if self._over and name in self._members:
            self._members.remove(name)
            self.counts.left += 1
            self._exact.dismiss(name)
        return b""

    # --- who comes and goes

    def _changed(self, presences: list[Presence]) -> None:
        for seen, one in self._seen(presences):
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
        whose = "a program that does not identify itself" if other is None else other.who
        self._tell_once(
            f'"{self.name}" is published twice: here and by {whose}; each subscriber takes the first '
            "publisher that it finds, so rename or stop one of them"
        )

    def _join(self, consumer: str, metadata: bytes) -> None:
        if consumer in self._members or consumer in self._listeners:
            return
        theirs = read_introduction(metadata)
        if theirs is None or len(self._members) + len(self._listeners) >= MOST:
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
        elif self._left or (self._returning is not None and self._returning.open):
            self._exact.admit(consumer, 1, after=0)  # all that its predecessors have not done
            while self._left:
                self._exact.dismiss(self._left.pop())
        else:
            self._exact.admit(consumer, 1)
        if self._returning is not None:
            self._returning.back(consumer)

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
