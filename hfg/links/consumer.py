"""The receiving end of an exact link: order, repetitions, credits and fencing (rules L1 to L4).

It takes tokens in their order and each once, whatever the way between does, tells what it has got, what is done and
what it has room for, and believes only the newest life of the producer. It speaks when something is new or was asked,
never by itself, so it needs no time.

What this machine does not know: how datagrams travel, what a token is, and what a ledger is but for the position that
it begins with. Nothing that arrives can make it raise.
"""

from __future__ import annotations

from collections import deque

import msgspec

from hfg.errors import UsageError
from hfg.links.frames import (
    LONGEST_NAME,
    OtherVersion,
    Outgoing,
    Probe,
    Status,
    Tokens,
    Unreadable,
    read_from_producer,
    values_of,
    write,
)
from hfg.transport import Buffer, Delivery, Position

__all__ = ["ConsumerCounts", "ExactConsumer"]


class ConsumerCounts(msgspec.Struct):
    """What has happened at the receiving end.

    Attributes:
      received: tokens that were accepted.
      repeated: tokens that had been accepted before.
      early: tokens that came before others, or before it was told where the producer stands; they will come again.
      overrun: tokens that there was no room for; they will come again.
      missed: tokens that were done by the producer's account and not by this one's: the ledger is behind, or older
        tokens were given up while this consumer did not take part.
      abandoned: tokens of a dead producer that are known to have existed and will never come.
      streams: how often a producer began afresh.
      statuses: that were sent.
      refused: datagrams that are no frame, or whose payload does not fit their header.
      other_versions: datagrams of another version of the protocol.
      strangers: probes for others.
      stale: frames of former lives of the producer, or for former lives of this consumer.
      fenced: frames that say that a newer life of this consumer is at work.
    """

    received: int = 0
    repeated: int = 0
    early: int = 0
    overrun: int = 0
    missed: int = 0
    abandoned: int = 0
    streams: int = 0
    statuses: int = 0
    refused: int = 0
    other_versions: int = 0
    strangers: int = 0
    stale: int = 0
    fenced: int = 0


class ExactConsumer:
    """The receiving end of an exact link.

    Args:
      name: by which the producer knows it.
      incarnation: which life of the consumer this is; each must be higher than all before.
      capacity: how many tokens it holds that are not done; no less than the producer's window, or it slows it down.
      ledger: the position of the last token that was done, if that was recorded.
      producer: the only epoch to believe, if somebody knows; else the newest that is heard of.

    Attributes:
      name: see above.
      incarnation: see above.
      capacity: see above.
      counts: what has happened.
      epoch: the life of the producer it listens to; 0: none yet.
      newer_incarnation: that of a newer life of this consumer, by which the producer has fenced this one off; or 0.
      closed: the producer has ended the link.
    """

    def __init__(
        self,
        name: str,
        incarnation: int,
        *,
        capacity: int = 8,
        ledger: Position | None = None,
        producer: int | None = None,
    ) -> None:
        if incarnation < 1 or capacity < 1:
            raise UsageError(f"a link needs incarnation >= 1 and capacity >= 1, got {incarnation}, {capacity}")
        if not 0 < len(name) <= LONGEST_NAME:
            raise UsageError(f"a consumer's name has 1 to {LONGEST_NAME} characters, got {len(name)}")
        self.name = name
        self.incarnation = incarnation
        self.counts = ConsumerCounts()
        self.epoch = 0
        self.newer_incarnation = 0
        self.closed = False
        self.capacity = capacity
        self._expected = producer
        start = ledger or Position(0, 0)
        self._stream = start.stream
        self._accepted = self._done = start.sequence
        self._older = 0  # not done, and of numbers before those of `_done`: of a former stream
        self._waiting: deque[Delivery] = deque()
        self._taken = 0  # of those that are not done, how many the node has
        self._seen = 0
        self._highest = start.sequence  # that was heard of in this stream
        self._eager = False
        self._owes = True  # a status; the first says that it is here
        self._told = start.sequence  # of `_done`, by the last status

    # --- what the consuming node asks and does

    @property
    def waiting(self) -> int:
        """How many tokens can be taken."""
        return len(self._waiting)

    @property
    def unfinished(self) -> int:
        """How many tokens have arrived and are not done."""
        return len(self._waiting) + self._taken

    @property
    def untold(self) -> int:
        """How many tokens are done that the producer was not told of."""
        return self._done - self._told

    @property
    def position(self) -> Position:
        """That of the last token that is done, in the stream that is followed now."""
        return Position(self._stream, self._done)

    @property
    def accepted(self) -> Position:
        """That of the last token that has arrived."""
        return Position(self._stream, self._accepted)

    def take(self) -> Delivery | None:
        """Give the next token, if there is one."""
        if not self._waiting:
            return None
        self._taken += 1
        return self._waiting.popleft()

    def take_all(self) -> list[Delivery]:
        """Give all tokens that wait."""
        taken = list(self._waiting)
        self._waiting.clear()
        self._taken += len(taken)
        return taken

    def done(self, count: int = 1) -> None:
        """The oldest tokens that were taken are processed, and recorded if there is a ledger.

        Raises:
          UsageError: fewer have been taken.
        """
        if not 0 <= count <= self._taken:
            raise UsageError(f"{count} tokens cannot be done, {self._taken} have been taken and are not")
        self._taken -= count
        older = min(self._older, count)
        self._older -= older
        self._done += count - older
        # A producer that waits needs the word now; else it has room still, and one word for several is cheaper.
        if (count and not self._waiting) or older or 4 * (self._done - self._told) >= self.capacity:
            self._owes = True

    def believe(self, epoch: int) -> None:
        """Listen to that life of the producer only, whatever else is heard."""
        self._expected = epoch

    # --- what arrives

    def receive(self, header: Buffer, payload: Buffer = b"") -> None:
        """Take a datagram of the producer; `take` gives the tokens, `flush` the answer."""
        try:
            frame = read_from_producer(header)
            if type(frame) is Tokens:
                self._accept(frame, payload)
            else:
                self._hear(frame)  # type: ignore[arg-type]  # what is no run of tokens is a probe
        except OtherVersion:
            self.counts.other_versions += 1
        except Unreadable:
            self.counts.refused += 1

    def _accept(self, frame: Tokens, payload: Buffer) -> None:
        count = len(frame.metadata)
        if frame.epoch != self.epoch or frame.stream != self._stream:
            self._set_aside(frame, count)
            return
        if frame.serial > self._seen:
            self._seen = frame.serial
        known = self._accepted + 1 - frame.first
        if known < 0:
            self.counts.early += count
            self._owes = True
            return
        if known >= count:
            self.counts.repeated += count
            self._owes = True
            return
        values = values_of(frame, payload)
        room = self.capacity - self._taken - len(self._waiting)
        stop = min(count, known + room)
        self.counts.repeated += known
        self.counts.overrun += count - stop
        self._owes = self._owes or self._eager or known > 0 or stop < count
        if stop > known:
            stream, number = self._stream, frame.first + known
            pairs = zip(
                range(number, number + stop - known), frame.metadata[known:stop], values[known:stop], strict=True
            )
            self._waiting.extend([Delivery(stream, number, metadata, value) for number, metadata, value in pairs])
            self._accepted += stop - known
            self.counts.received += stop - known
            self._highest = max(self._highest, self._accepted)

    def _set_aside(self, frame: Tokens, count: int) -> None:
        """Tokens of another life of the producer, or of another stream of it."""
        if frame.epoch < self.epoch or not self._believes(frame.epoch):
            self.counts.stale += count
        else:
            self._owes = True  # so that the producer tells where it stands, or hears that this stream is over
            if frame.epoch == self.epoch and frame.stream < self._stream:
                self.counts.stale += count
            else:
                self.counts.early += count

    def _believes(self, epoch: int) -> bool:
        return epoch > 0 and (self._expected is None or epoch == self._expected)

    def _hear(self, probe: Probe) -> None:
        if probe.consumer != self.name:
            self.counts.strangers += 1
        elif not self._believes(probe.epoch) or probe.epoch < self.epoch:
            self.counts.stale += 1
        elif probe.incarnation != self.incarnation:
            if probe.incarnation > self.incarnation:
                self.counts.fenced += 1
                self.newer_incarnation = max(self.newer_incarnation, probe.incarnation)
            else:
                self.counts.stale += probe.incarnation > 0
                self._owes = True  # so that the producer hears which life this is
        else:
            self._follow(probe)
            self._owes = True

    def _follow(self, probe: Probe) -> None:
        """The producer says to this very life of the consumer where it stands."""
        if probe.epoch > self.epoch:
            self.epoch = probe.epoch
            self._seen = 0
            self.closed = False
        self._seen = max(self._seen, probe.serial)
        if probe.stream < self._stream or probe.lowest < 1:
            self.counts.stale += 1
            return
        if probe.stream > self._stream:
            if self._stream:
                self.counts.streams += 1
                self.counts.abandoned += self._highest - self._accepted
            self._stream = probe.stream
            self._highest = 0
            self._go_on_after(probe.lowest - 1)
        elif probe.lowest > self._accepted + 1:
            self.counts.missed += probe.lowest - 1 - self._accepted
            self._go_on_after(probe.lowest - 1)
        self._highest = max(self._highest, probe.highest)
        self._eager = probe.eager
        self.closed = self.closed or probe.closing

    def _go_on_after(self, number: int) -> None:
        """Numbers go on from elsewhere; what has arrived and is not done stays, before what comes."""
        self._older = self.unfinished
        self._accepted = self._done = self._told = number

    # --- what leaves

    def flush(self) -> list[Outgoing]:
        """Give what is to be sent now, at most one status.

        To be called when something was done or has arrived, at the end of a burst of either, and once at the beginning.
        """
        if not self._owes:
            return []
        self._owes = False
        self._told = self._done
        self.counts.statuses += 1
        limit = self._done + max(self.capacity - self._older, self._accepted - self._done)
        status = Status(
            self.name, self.incarnation, self.epoch, self._stream, self._accepted, self._done, limit, self._seen
        )
        return [Outgoing(None, write(status), b"")]

    def check_invariants(self) -> None:
        """Check what must hold between any two calls.

        Raises:
          AssertionError: it does not.
        """
        assert self.unfinished <= self.capacity, f"it holds {self.unfinished} tokens, more than {self.capacity} (L1)"
        assert self._accepted - self._done == self.unfinished - self._older, "its numbers and its tokens differ"
        numbers = [(one.stream, one.sequence) for one in self._waiting]
        assert numbers == sorted(set(numbers)), "tokens wait out of order (L2)"
