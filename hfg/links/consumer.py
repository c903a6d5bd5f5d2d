"""The receiving end of an exact link: order, repetitions, credits and fencing (rules L1 to L4).

It accepts each token once and in order, whatever the network does. It reports what has arrived, what is processed and
how many tokens it has room for, and trusts only the newest incarnation of the producer. It sends only when there is
news or when it was probed, never spontaneously, so it needs no time.

This machine does not know how datagrams travel or what a token is, and of a ledger only the position that it starts
with. No input can make it raise.
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


class ConsumerCounts(msgspec.Struct):
    """Counts at the receiving end.

    Attributes:
      received: tokens that were accepted.
      repeated: tokens that had been accepted before.
      early: tokens that arrived before earlier ones, or before the producer's position was known; they will be resent.
      overrun: tokens for which there was no room; they will be resent.
      missed: tokens that are processed according to the producer but not according to this end: the ledger is behind,
        or older tokens were dropped while this consumer did not take part.
      abandoned: tokens of a dead producer that are known to have existed and will never arrive.
      streams: how often a producer started over.
      statuses: statuses sent.
      refused: datagrams that are not frames, or whose payload does not match their header.
      other_versions: datagrams of another version of the protocol.
      strangers: probes for other consumers.
      stale: frames of previous incarnations of the producer, or for previous incarnations of this consumer.
      fenced: frames that show that a newer incarnation of this consumer is running.
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
      name: its name at the producer.
      incarnation: number of this incarnation of the consumer; must be higher than all previous ones.
      capacity: maximum number of tokens that have arrived and are not processed; at least the producer's window, or it
        slows the producer down.
      ledger: position of the last processed token, if recorded.
      producer: the only trusted epoch, if known; otherwise the newest one that sends a message is trusted.

    Attributes:
      name: see above.
      incarnation: see above.
      capacity: see above.
      counts: see `ConsumerCounts`.
      epoch: the trusted incarnation of the producer; 0: none yet.
      newer_incarnation: number of a newer incarnation of this consumer, for which the producer has fenced this one off;
        or 0.
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
        """Number of processed tokens that were not reported to the producer yet."""
        return self._done - self._told

    @property
    def position(self) -> Position:
        """Position of the last processed token, in the current stream."""
        return Position(self._stream, self._done)

    @property
    def accepted(self) -> Position:
        """Position of the last token that has arrived."""
        return Position(self._stream, self._accepted)

    def take(self) -> Delivery | None:
        """Return the next token, if there is one."""
        if not self._waiting:
            return None
        self._taken += 1
        return self._waiting.popleft()

    def take_all(self) -> list[Delivery]:
        """Return all waiting tokens."""
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
        # If no tokens wait here, the producer may be blocked and needs the acknowledgement now. Otherwise it still has
        # room, and one status for several tokens is cheaper.
        if (count and not self._waiting) or older or 4 * (self._done - self._told) >= self.capacity:
            self._owes = True

    def believe(self, epoch: int) -> None:
        """Trust only this incarnation of the producer."""
        self._expected = epoch

    # --- what arrives

    def receive(self, header: Buffer, payload: Buffer = b"") -> None:
        """Process a datagram from the producer; then `take` returns the tokens, `flush` the answer."""
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
            # Not kept: the status shows the gap and the producer resends. Keeping early tokens would need memory that
            # the credits do not account for.
            self.counts.early += count
            self._owes = True
            return
        if known >= count:
            # Answered all the same: a repetition means that the producer has lost our acknowledgement.
            self.counts.repeated += count
            self._owes = True
            return
        values = values_of(frame, payload)  # may raise Unreadable, so it comes before any change
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
            self._owes = True  # so that the producer sends its position, or learns that this stream is over
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
            # A newer incarnation has our name, so we must stop: if both processed and acknowledged tokens, some would
            # be processed twice and others by the one whose effects are discarded (L2).
            if probe.incarnation > self.incarnation:
                self.counts.fenced += 1
                self.newer_incarnation = max(self.newer_incarnation, probe.incarnation)
            else:
                self.counts.stale += probe.incarnation > 0
                self._owes = True  # so that the producer learns the incarnation of this end
        else:
            self._follow(probe)
            self._owes = True

    def _follow(self, probe: Probe) -> None:
        """Follow a probe for this incarnation of the consumer, which has the producer's position."""
        # Only a probe changes the epoch, never a token: a probe for this incarnation shows that the producer knows us
        # and states its position, so no token can be skipped in between.
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
        """Continue with other numbers. Tokens that have arrived and are not processed stay ahead of new ones."""
        # They have no number in the new stream, so `done` must not count them there; but they still occupy room.
        self._older = self.unfinished
        self._accepted = self._done = self._told = number

    # --- what leaves

    def flush(self) -> list[Outgoing]:
        """Return the datagrams to send now: at most one status.

        Call it after tokens were processed or datagrams arrived, at the end of each burst, and once at the start.
        """
        if not self._owes:
            return []
        self._owes = False
        self._told = self._done
        self.counts.statuses += 1
        # Never below what has already been accepted: a limit that shrinks would contradict an earlier status.
        limit = self._done + max(self.capacity - self._older, self._accepted - self._done)
        assert limit >= self._accepted >= self._done, "a status would contradict itself"
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
