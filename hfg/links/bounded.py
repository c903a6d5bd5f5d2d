"""Both ends of the link that may lose tokens: it keeps their order, never waits, and counts losses (rule L2, P5).

The sending end numbers and sends tokens; the receiving end puts tokens that arrive in order into a queue with a policy.
A gap in the numbers is a loss in transit, detected when the next token arrives. Nothing is sent back. Does not use
time; no input can make it raise.
"""

from __future__ import annotations

from collections import deque

import msgspec

from hfg.errors import UsageError
from hfg.links.frames import (
    OtherVersion,
    Outgoing,
    Tokens,
    Unreadable,
    batches,
    checked,
    read_from_producer,
    values_of,
    write,
)
from hfg.transport import Buffer, Delivery, EncodedToken, LinkOverflow, Position


class BoundedProducerCounts(msgspec.Struct):
    """Counts at the sending end.

    Attributes:
      sent: tokens.
      datagrams: datagrams that contained them.
    """

    sent: int = 0
    datagrams: int = 0


class BoundedProducer:
    """The sending end of a link that may lose tokens; to any number of consumers.

    Args:
      epoch: which life of the producer this is; each must be higher than all before.
      largest_batch: bytes of a datagram of several tokens.
      largest_token: bytes of a value and its metadata that can be sent at all.

    Attributes:
      epoch: see above.
      counts: what has happened.
    """

    def __init__(self, epoch: int, *, largest_batch: int = 60_000, largest_token: int = 2**30) -> None:
        if epoch < 1:
            raise UsageError(f"a link needs epoch >= 1, got {epoch}")
        self.epoch = epoch
        self.counts = BoundedProducerCounts()
        self._largest_batch = largest_batch
        self._largest_token = largest_token
        self._next = 1
        self._unsent: list[EncodedToken] = []

    @property
    def position(self) -> Position:
        """Position of the last token that was sent."""
        return Position(self.epoch, self._next - 1)

    def send(self, token: EncodedToken) -> int:
        """Accept the next token. Return its number; it is sent with the next `flush`.

        Raises:
          MessageTooLarge: the value is too large for the transport, or its metadata for a header.
        """
        self._unsent.append(checked(token, self._largest_token))
        self._next += 1
        return self._next - 1

    def flush(self) -> list[Outgoing]:
        """Return the datagrams to send now."""
        if not self._unsent:
            return []
        out: list[Outgoing] = []
        first = self._next - len(self._unsent)
        for metadata, payload in batches(self._unsent, self._largest_batch):
            self.counts.datagrams += 1
            out.append(Outgoing(None, write(Tokens(self.epoch, self.epoch, first, 0, metadata)), payload))
            first += len(metadata)
        self.counts.sent += len(self._unsent)
        self._unsent = []
        return out


class BoundedConsumerCounts(msgspec.Struct):
    """Counts at the receiving end.

    Attributes:
      received: tokens that were put into the queue, including those dropped later.
      lost: tokens lost in transit, by the gaps in their numbers.
      dropped: tokens dropped by the policy because the queue was full.
      late: tokens that arrived after later ones, or again; they are ignored.
      streams: how often a producer started over.
      refused: datagrams that are not frames, or whose payload does not match their header.
      other_versions: datagrams of another version of the protocol.
      stale: tokens of previous incarnations of the producer.
    """

    received: int = 0
    lost: int = 0
    dropped: int = 0
    late: int = 0
    streams: int = 0
    refused: int = 0
    other_versions: int = 0
    stale: int = 0


class BoundedConsumer:
    """The receiving end of a link that may lose tokens.

    Args:
      capacity: maximum number of waiting tokens.
      overflow: what to do with a token when the queue is full, in the terms of rule P5. Under `error` it is dropped and
        `overflowed` is set: its emitter is in another program, so the consuming side has to fail.
      producer: the only trusted epoch, if known; otherwise the newest one that sends a message is trusted.

    Attributes:
      counts: see the class.
      epoch: the trusted incarnation of the producer; 0: none yet.
      overflowed: the queue overflowed under `error`.
    """

    def __init__(
        self, *, capacity: int = 16, overflow: LinkOverflow = "drop_oldest", producer: int | None = None
    ) -> None:
        if capacity < 1:
            raise UsageError(f"a link needs capacity >= 1, got {capacity}")
        self.counts = BoundedConsumerCounts()
        self.epoch = 0
        self.overflowed = False
        self._capacity = 1 if overflow == "latest" else capacity
        self._overflow = overflow
        self._expected = producer
        self._last = 0
        self._waiting: deque[Delivery] = deque()

    @property
    def waiting(self) -> int:
        """How many tokens can be taken."""
        return len(self._waiting)

    def take(self) -> Delivery | None:
        """Return the next token, if there is one."""
        return self._waiting.popleft() if self._waiting else None

    def take_all(self) -> list[Delivery]:
        """Return all waiting tokens."""
        taken = list(self._waiting)
        self._waiting.clear()
        return taken

    def forget_overflow(self) -> None:
        """Reset `overflowed`: the consumer has been notified."""
        self.overflowed = False

    def believe(self, epoch: int) -> None:
        """Trust only this incarnation of the producer."""
        self._expected = epoch

    def receive(self, header: Buffer, payload: Buffer = b"") -> None:
        """Take a datagram of the producer."""
        try:
            frame = read_from_producer(header)
            if type(frame) is Tokens and frame.first > 0:
                self._accept(frame, payload)
            else:
                self.counts.refused += 1
        except OtherVersion:
            self.counts.other_versions += 1
        except Unreadable:
            self.counts.refused += 1

    def _accept(self, frame: Tokens, payload: Buffer) -> None:
        count = len(frame.metadata)
        if frame.epoch < max(self.epoch, 1) or (self._expected is not None and frame.epoch != self._expected):
            self.counts.stale += count
            return
        values = values_of(frame, payload)
        if frame.epoch > self.epoch:
            self.counts.streams += self.epoch > 0
            # For a producer that was there before this end, no earlier loss is known; for a new one, missing first
            # tokens are losses.
            self._last = 0 if self.epoch else frame.first - 1
            self.epoch = frame.epoch
        known = min(max(self._last + 1 - frame.first, 0), count)
        self.counts.late += known
        if known == count:
            return
        self.counts.lost += max(frame.first - self._last - 1, 0)
        self._last = frame.first + count - 1
        self.counts.received += count - known
        for index in range(known, count):
            self._put(Delivery(frame.stream, frame.first + index, frame.metadata[index], values[index]))

    def _put(self, token: Delivery) -> None:
        if len(self._waiting) >= self._capacity:
            self.counts.dropped += 1
            if self._overflow == "error":
                self.overflowed = True
                return
            if self._overflow == "drop_newest":
                return
            self._waiting.popleft()
        self._waiting.append(token)

    def check_invariants(self) -> None:
        """Check what must hold between any two calls.

        Raises:
          AssertionError: it does not.
        """
        assert len(self._waiting) <= self._capacity, f"{len(self._waiting)} tokens wait, more than {self._capacity}"
        numbers = [(one.stream, one.sequence) for one in self._waiting]
        assert numbers == sorted(set(numbers)), "tokens wait out of order"
