"""The sending end of an exact link: numbers, windows, resends on evidence, probes (rules L1 to L3).

Tokens are kept until every consumer has acknowledged them. They are sent once to all consumers. They are sent again
only to a consumer whose status proves that it lacks them although it has seen later datagrams, or that has started a
new incarnation. A silent consumer gets small probes, less and less often, but never a large value just to be sure.

This machine gets the time only as an argument, and does not know how datagrams travel or what a token is. No input from
the network can make it raise.
"""

from __future__ import annotations

from collections import deque
from itertools import islice
from typing import Final, Literal, NamedTuple

import msgspec

from hfg.errors import UsageError
from hfg.links.frames import (
    LONGEST_METADATA,
    LONGEST_NAME,
    OtherVersion,
    Outgoing,
    Probe,
    Status,
    Tokens,
    Unreadable,
    batches,
    checked,
    read_from_consumer,
    write,
)
from hfg.links.peer import Peer
from hfg.transport import Buffer, EncodedToken, Position

_AWAY: Final = 4
"""Number of consecutive probes without an answer, about a second, after which a consumer is reported as away."""


class Outbox(NamedTuple):
    """The unacknowledged tokens of a producer's previous incarnation.

    Attributes:
      stream: the stream to continue.
      first: the number of the first token, or of the next one if there is none.
      tokens: tokens that are not acknowledged, as far as known.
    """

    stream: int
    first: int
    tokens: tuple[EncodedToken, ...] = ()


class ProducerCounts(msgspec.Struct):
    """Counts at the sending end.

    Attributes:
      sent: tokens that were sent for the first time.
      resent: tokens that were sent again, to each consumer that lacked them.
      datagrams: datagrams sent, including probes.
      probes: probes sent.
      restarts: new incarnations of consumers.
      given_up: tokens that were not acknowledged when the link was closed or a consumer dismissed.
      superseded: tokens that a consumer no longer takes because it follows a newer stream.
      repeated: tokens that had already been sent, by their positions; they were ignored.
      refused: datagrams that are not frames, or acknowledge tokens that were never sent.
      other_versions: datagrams of another version of the protocol.
      strangers: frames of consumers that do not take part.
      stale: frames of previous incarnations of a consumer.
      late: frames that were overtaken by newer ones.
      fenced: frames that show that a newer incarnation of this producer is running.
    """

    sent: int = 0
    resent: int = 0
    datagrams: int = 0
    probes: int = 0
    restarts: int = 0
    given_up: int = 0
    superseded: int = 0
    repeated: int = 0
    refused: int = 0
    other_versions: int = 0
    strangers: int = 0
    stale: int = 0
    late: int = 0
    fenced: int = 0


class ExactProducer:
    """The sending end of an exact link to one or several consumers.

    Args:
      epoch: number of this incarnation of the producer; must be higher than all previous ones.
      window: how many tokens may be unreleased, P4's buffer; 1 is the paper's rule.
      release: what frees the producer's output: a token is processed ("done") or, for slots, accepted.
      depth: with `release="accepted"`, how many more tokens may be accepted and not yet processed.
      inherits: tokens come with their positions; the first one starts the numbering.
      outbox: tokens from the previous incarnation.
      largest_batch: bytes of a datagram of several tokens.
      largest_token: bytes of a value and its metadata that can be sent at all.
      probe_s: how long a consumer may be silent before it is probed.
      slowest_probe_s: maximum time between two probes of a silent consumer.

    Attributes:
      counts: see `ProducerCounts`.
      window: see above.
      newer_epoch: number of a newer incarnation of this producer, for which consumers have fenced this one off; or 0.
    """

    def __init__(
        self,
        epoch: int,
        *,
        window: int = 8,
        release: Literal["done", "accepted"] = "done",
        depth: int = 0,
        inherits: bool = False,
        outbox: Outbox | None = None,
        largest_batch: int = 60_000,
        largest_token: int = 2**30,
        probe_s: float = 0.1,
        slowest_probe_s: float = 0.25,
    ) -> None:
        if epoch < 1 or window < 1 or depth < 0:
            raise UsageError(f"a link needs epoch >= 1, window >= 1 and depth >= 0, got {epoch}, {window}, {depth}")
        self.epoch = epoch
        self.counts = ProducerCounts()
        self.newer_epoch = 0
        self.window = window
        self._most = window + depth
        self._eager = release == "accepted"
        self._inherits = inherits
        self._largest_batch = largest_batch
        self._largest_token = largest_token
        self._probe_s = probe_s
        self._slowest_probe_s = slowest_probe_s
        # The epoch is the first stream, so that a producer that returns without an outbox starts a higher one: its
        # numbers cannot be mistaken for those of its previous incarnation.
        kept = outbox or Outbox(0 if inherits else epoch, 1)
        self._stream = kept.stream  # 0: not started
        self._kept: deque[EncodedToken] = deque(kept.tokens)  # what is not done by all
        self._next = kept.first + len(kept.tokens)
        self._put = kept.first - 1  # what was sent to all, but for those out of step
        self._released = kept.first - 1
        self._limit = 0
        self._admitted = False
        self._serial = 0
        self._peers: dict[str, Peer] = {}
        self._closed = False
        self._open_up()

    # --- what the producing node asks and does

    @property
    def free(self) -> bool:
        """Whether it takes a token."""
        return self._next <= self._limit

    @property
    def released(self) -> int:
        """The last number of the stream for which the producer's output is free again."""
        return self._released

    @property
    def position(self) -> Position:
        """Position of the last token that was sent."""
        return Position(self._stream, self._next - 1)

    @property
    def unfinished(self) -> int:
        """How many tokens are not done by all."""
        return len(self._kept)

    @property
    def outbox(self) -> Outbox:
        """The state that another incarnation needs to continue from here."""
        return Outbox(self._stream, self._next - len(self._kept), tuple(self._kept))

    @property
    def away(self) -> list[str]:
        """The consumers that tokens wait for and that have not answered for about a second, by name."""
        return [peer.name for peer in self._peers.values() if peer.unanswered >= _AWAY]

    def is_pressing(self, portion: int) -> bool:
        """Return whether unsent tokens should leave now: they are enough, none is in transit, or none can join them."""
        unsent = self._next - 1 - self._put
        return unsent >= portion or unsent == len(self._kept) or self._next > self._limit

    def takes(self, position: Position | None = None) -> bool:
        """Whether a token of that position can be sent now: `free`, and where numbers jump all before is done."""
        if position is not None and tuple(position) >= (self._stream, self._next):
            # A jump while tokens are kept would leave numbers without tokens in `_kept`, which is indexed by number.
            follows = position == (self._stream, self._next)
            return self.free if follows else not self._kept
        return self.free or position is not None

    def send(self, token: EncodedToken, position: Position | None = None) -> int:
        """Accept the next token. Return its number; it is sent with the next `flush`.

        Raises:
          UsageError: the window is full, or the link is closed.
          MessageTooLarge: the value is too large for the transport, or its metadata for a header.
        """
        if position is not None and not self._begin_at(position):
            self.counts.repeated += 1
            return position.sequence
        number = self._next
        if number > self._limit:
            raise self._why_not()
        metadata, value = token
        if type(value) is not bytes or len(value) > self._largest_token or len(metadata) > LONGEST_METADATA:
            token = checked(token, self._largest_token)  # which most need not
        self._kept.append(token)
        self._next = number + 1
        if number <= self._released or not self._peers:  # already processed: a relay that started over repeats it
            self._free()
        return number

    def begin_at(self, number: int) -> None:
        """Nothing was sent in this life: the first token has that number.

        Raises:
          UsageError: something is not done.
        """
        self._begin_at(Position(self._stream, number))

    def _why_not(self) -> UsageError:
        if self._closed:
            return UsageError("the link is closed")
        if self._stream == 0:
            return UsageError("this link inherits its numbers: pass the position of the input with each token")
        return UsageError(f"the window of {self.window} tokens is full: look at `free` first, or await send()")

    def _begin_at(self, position: Position) -> bool:
        """Return whether a token of this position is new. If the numbers jump, continue from there."""
        here = (self._stream, self._next)
        if position == here:
            return True
        if tuple(position) < here and self._stream:
            return False
        if self._kept:
            raise UsageError(f"numbers jump from {here} to {tuple(position)} while tokens are not done: await send()")
        self._stream = position.stream
        self._next = position.sequence
        self._put = self._released = position.sequence - 1
        self._open_up()
        for peer in self._peers.values():
            peer.move_to(position.sequence - 1)
        return True

    def admit(self, consumer: str, incarnation: int | None = None, *, after: int | None = None) -> None:
        """Add a consumer, or set the trusted incarnation of one that already takes part.

        Args:
          consumer: its name on this link.
          incarnation: its only trusted incarnation from now on; None: the newest one that sends a message.
          after: number of the last token before it takes part, for consumers from the time when an outbox was kept;
            None: from the next token on.
        """
        peer = self._peers.get(consumer)
        if peer is None:
            if not 0 < len(consumer) <= LONGEST_NAME:
                raise UsageError(f"a consumer's name has 1 to {LONGEST_NAME} characters, got {len(consumer)}")
            last = self._next - 1
            # A position before the first kept token cannot be served any more: begin with what is there.
            done = last if after is None else min(max(after, last - len(self._kept)), last)
            peer = self._peers[consumer] = Peer(consumer, done, self._probe_s)
            self._admitted = True  # after all are admitted, tokens from an outbox may turn out to have no consumer
        if incarnation is not None:
            peer.believe(incarnation)

    def dismiss(self, consumer: str) -> None:
        """Wait for a consumer no longer."""
        peer = self._peers.pop(consumer, None)
        if peer is not None:
            self.counts.given_up += self._next - 1 - peer.done
            self._free()  # it may have been the slowest, on which the others' window depended

    def close(self, *, over: bool = False) -> list[Outgoing]:
        """End this incarnation: unacknowledged tokens are dropped and counted.

        Args:
          over: this is the last incarnation, so consumers are told to stop waiting.
        """
        if self._closed:
            return []
        self._closed = True
        self._open_up()
        self.counts.given_up += len(self._kept)
        return [self._probe(peer) for peer in self._peers.values()] if over and self._stream else []

    # --- what arrives

    def receive(self, header: Buffer, payload: Buffer = b"") -> None:
        """Process a datagram from a consumer; then `flush` returns the consequences."""
        del payload  # statuses have none
        try:
            status = read_from_consumer(header)
        except OtherVersion:
            self.counts.other_versions += 1
        except Unreadable:
            self.counts.refused += 1
        else:
            peer = self._peers.get(status.consumer)
            if peer is None:
                self.counts.strangers += 1
            elif not peer.believes(status.incarnation):
                self.counts.stale += 1
            else:
                self._learn(peer, status)

    def _learn(self, peer: Peer, status: Status) -> None:
        peer.heard()
        if status.incarnation != peer.incarnation:
            self.counts.restarts += peer.incarnation > 0
            peer.begin(status.incarnation)
            peer.ask_soon()
        if status.epoch > self.epoch:  # only recorded: the supervisor of this producer may know that it is forged
            self.counts.fenced += 1
            self.newer_epoch = max(self.newer_epoch, status.epoch)
        elif (status.epoch, status.stream) == (self.epoch, self._stream):
            self._acknowledge(peer, status)
        elif status.epoch == self.epoch and status.stream > self._stream and self._inherits:
            # The source of the numbers has returned with a higher stream, and the consumer already got it by another
            # relay. It will never acknowledge this stream; waiting for it would block the output forever.
            self.counts.superseded += self._next - 1 - peer.done
            peer.give_up(self._next - 1)
            self._free()
        elif status.epoch == self.epoch and status.stream > self._stream:
            self.counts.refused += 1
        elif peer.in_step:
            # Overtaken by newer statuses. A probe would be answered with what is already known.
            self.counts.late += 1
        else:
            peer.owe()

    def _acknowledge(self, peer: Peer, status: Status) -> None:
        """A word on this very stream: what it has, what is done, what it lacks."""
        # Only a relay may see acknowledgements ahead of itself: when it starts over, it repeats numbers that its
        # consumers already have. For any other producer they are forged or corrupt, and believing them would lose
        # tokens.
        impossible = status.accepted >= self._next and not self._inherits
        if impossible or not status.done <= status.accepted <= status.limit:
            self.counts.refused += 1
            return
        if not peer.in_step:
            # its ledger is behind its own acknowledgement: probe it again with the position where it can continue
            if status.accepted < peer.done:
                peer.owe()
                return
            peer.step_in(status.accepted)
        if peer.learn(status):
            self._free()

    def _free(self) -> None:
        """Forget what is done by all, and see how far the output is free."""
        # The slowest consumer decides: a token may be forgotten only when no consumer can ask for it again (L2).
        last = self._next - 1
        peers = self._peers.values()
        done = released = min([peer.done for peer in peers], default=last)
        if self._eager:
            released = min([max(peer.accepted, peer.done) for peer in peers], default=last)
        self._released = max(self._released, released)  # ahead of what was sent, if a relay comes to it again
        first = self._next - len(self._kept)
        if done >= last:
            self._kept.clear()
        else:
            for _ in range(done - first + 1):
                self._kept.popleft()
        assert len(self._kept) == max(0, last - done), "it keeps other tokens than the unacknowledged ones"
        self._put = max(self._put, min(done, last))
        self._open_up()

    def _open_up(self) -> None:
        """See up to which number tokens may be sent."""
        before = self._next - 1 - len(self._kept)  # done by all
        self._limit = 0 if self._closed or not self._stream else min(self._released + self.window, before + self._most)

    # --- what leaves

    def flush(self, now: float) -> list[Outgoing]:
        """Return the datagrams to send now: new tokens, tokens that consumers lack, and probes that are due.

        Call it after tokens were sent or datagrams arrived, at the end of each burst, and at `due`.
        """
        if self._closed or self._stream == 0:
            return []
        if self._admitted:
            self._admitted = False
            self._free()
        out: list[Outgoing] = []
        ready = [peer for peer in self._peers.values() if peer.in_step]
        for peer in ready:
            # `sent` falls back to `accepted` only if a status proves a loss (`Peer.learn`), so nothing is resent on
            # suspicion: with large values a resend on a timeout would fill the network that was only slow.
            last = min(self._put, peer.limit)
            if peer.sent < last:
                self.counts.resent += last - peer.sent
                self._transmit(out, peer.name, peer.sent + 1, last, [peer], now)
        last = self._next - 1
        # New tokens go out once, to all consumers together, up to the smallest limit. A consumer without room holds up
        # the others; sending to each by itself would cost one datagram per consumer for every token.
        if ready and self._put < last:
            has = min([peer.sent for peer in ready])
            if has >= self._put:  # otherwise a consumer has no room for tokens that others already got
                last = min(last, min([peer.limit for peer in ready]))
                first = max(self._put, min(has, last)) + 1
                self._put = first - 1
                if first <= last:
                    self.counts.sent += last - first + 1
                    self._put = last
                    self._transmit(out, None, first, last, ready, now)
        for peer in self._peers.values():
            if peer.owed or (peer.done < self._next - 1 and now >= peer.since + peer.patience_s):
                peer.probed(now, self._slowest_probe_s)
                out.append(self._probe(peer))
        return out

    @property
    def due(self) -> float | None:
        """When `flush` has something to do though nothing happens; None: never."""
        waits = [peer.since + peer.patience_s for peer in self._peers.values() if peer.done < self._next - 1]
        return min(waits) if waits and self._stream and not self._closed else None

    def _transmit(
        self, out: list[Outgoing], to: str | None, first: int, last: int, peers: list[Peer], now: float
    ) -> None:
        skipped = first - (self._next - len(self._kept))
        run = list(islice(self._kept, skipped, skipped + last - first + 1))
        for metadata, payload in batches(run, self._largest_batch):
            self._serial += 1
            out.append(Outgoing(to, write(Tokens(self.epoch, self._stream, first, self._serial, metadata)), payload))
            first += len(metadata)
            self.counts.datagrams += 1
        for peer in peers:
            peer.carry(last, self._serial, now)

    def _probe(self, peer: Peer) -> Outgoing:
        self._serial += 1
        self.counts.datagrams += 1
        self.counts.probes += 1
        probe = Probe(
            peer.name,
            peer.incarnation,
            self.epoch,
            self._stream,
            peer.done + 1,
            self._next - 1,
            self._serial,
            self._eager,
            self._closed,
        )
        return Outgoing(peer.name, write(probe), b"")

    def check_invariants(self) -> None:
        """Check what must hold between any two calls.

        Raises:
          AssertionError: it does not.
        """
        first = self._next - len(self._kept)
        assert len(self._kept) <= self._most, f"it keeps {len(self._kept)} tokens, more than {self._most} (L1)"
        assert first - 1 <= self._put < self._next, f"it has put {self._put} and keeps {first} to {self._next - 1}"
        for peer in self._peers.values():
            assert peer.done >= first - 1, f"{peer.name} lacks {peer.done + 1}, which is not kept (L2)"
            assert not peer.in_step or peer.sent >= peer.accepted >= peer.done, f"{peer.name} is ahead of itself"
