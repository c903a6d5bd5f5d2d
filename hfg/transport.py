"""What a transport gives, and what a link makes of it (rules L1 to L4).

A *transport* carries datagrams between programs that know each other by keys. It may lose, repeat and delay them, and
says nothing when it does. A *link* is an edge of a graph whose ends are in two programs; it keeps the rules of that
edge over any transport, by numbers, acknowledgements and resends of its own (`hfg.links`). So a transport has little
to promise, and is little to write:

- `Session.publisher(key, traffic).put(header, payload)`  one datagram to all who have subscribed to the key
- `Session.subscribe(key, receive)`                       datagrams, a burst at a time
- `Session.announce(name, metadata)`, `Session.watch`     who is there, and who has gone
- `Session.answer(name, handler)`, `Session.ask`          questions with an answer or a refusal, for control

`hfg.testing.transports` has the tests that any transport must pass. Transports are found by entry points in the group
`hfg.transports`; the core never imports one. Stands on nothing; names neither a product nor an event loop.

A *key* or *name* is text of one or more chunks with "/" between them. A chunk is any text that is not empty and has no
"/" in it; what its own syntax forbids is escaped by the transport.
"""

from __future__ import annotations

import enum
from collections.abc import Awaitable, Callable, Mapping
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias, runtime_checkable

import msgspec

__all__ = [
    "Answer",
    "Buffer",
    "Closing",
    "Datagrams",
    "Delivery",
    "EncodedToken",
    "Guarantee",
    "IncomingLink",
    "LinkOverflow",
    "Message",
    "OutgoingLink",
    "Position",
    "Presence",
    "Publisher",
    "Receive",
    "Session",
    "Traffic",
    "Transport",
    "Watch",
    "size_of",
]

Buffer: TypeAlias = bytes | bytearray | memoryview
"""Bytes somewhere. What has been put or has arrived is not written to."""


def size_of(buffer: Buffer) -> int:
    """Give its bytes; a view may count its elements otherwise."""
    return buffer.nbytes if isinstance(buffer, memoryview) else len(buffer)


Message: TypeAlias = tuple[Buffer, Buffer]
"""One datagram as it arrives: header and payload. Both stay as they are for as long as somebody holds them."""

Receive: TypeAlias = Callable[[list[Message]], None]
"""Called on the session's event loop with what has arrived since the last call, oldest first, never with nothing.

A burst costs one wake-up of the loop, however many datagrams are in it: that, not the bytes, is what limits the rate.
It must not wait. If it raises, the session logs that and goes on.
"""


class Traffic(enum.Enum):
    """What a datagram is for, from which a transport takes its priority and how it weighs delay against throughput.

    They are listed from the most to the least urgent. Order is kept within one publisher, never between two.
    """

    ACKNOWLEDGEMENTS = "acknowledgements"
    """Small, and others wait for it: sent at once."""
    TOKENS = "tokens"
    """Tokens of links that keep their back-pressure: sent at once, links make batches themselves."""
    BULK = "bulk"
    """Tokens of links that may lose some: may wait a moment to be sent together."""
    BACKGROUND = "background"
    """Statistics, logs and taps: the first to be left out."""


class Presence(NamedTuple):
    """Somebody has come or gone.

    Attributes:
      name: as it was announced.
      metadata: as it was announced; empty when somebody has gone.
      present: False when it was withdrawn, its program is dead, or has not been heard of for the transport's lease.
    """

    name: str
    metadata: bytes
    present: bool


Watch: TypeAlias = Callable[[list[Presence]], None]
"""Called on the session's event loop as `Receive` is, with changes in their order; begins with all who are there."""

Answer: TypeAlias = Callable[[bytes], Awaitable[bytes]]
"""Answers a question. Raising anything refuses it: the sentence of the exception goes to who has asked."""


@runtime_checkable
class Closing(Protocol):
    """What goes on until it is closed: a subscription, an announcement, a watch or an answerer."""

    def close(self) -> None:
        """Stop it. Nothing is called back any more once this returns; closing twice does nothing."""


@runtime_checkable
class Publisher(Protocol):
    """Puts datagrams on one key."""

    def put(self, header: bytes, payload: Buffer = b"") -> None:
        """Send one datagram to all who have subscribed to the key now.

        Never waits, and never blocks the loop: what cannot be sent is lost, silently, and so is what nobody subscribes
        to. What the transport still has to send is bounded. A buffer may be read until its receivers have acknowledged
        it, so it is left as it is until then.

        Raises:
          MessageTooLarge: header and payload are longer than `Session.largest_message`.
          TransportError: the publisher or its session is closed.
        """

    def close(self) -> None:
        """Stop it; what was put is still sent."""


@runtime_checkable
class Datagrams(Protocol):
    """What carries datagrams, on one event loop: all that a link needs of a transport."""

    @property
    def largest_message(self) -> int:
        """The most bytes of header and payload together."""

    def publisher(self, key: str, traffic: Traffic) -> Publisher:
        """Make what puts datagrams on a key.

        What one publisher puts arrives in the order it was put, apart from what is lost, as long as the network is
        kind; links rely on none of it. Two publishers of one key are two sources without an order.
        """

    def subscribe(self, key: str, receive: Receive) -> Closing:
        """Have all datagrams of one key that are put from about now on, also by this session itself."""


@runtime_checkable
class Session(Datagrams, Protocol):
    """One program's end of a transport, on one event loop.

    Its methods are called on that loop, and that is where it calls back. All of it is bounded in memory and time.
    """

    @property
    def host(self) -> str:
        """What this computer is called there; the agent of a host has the same name."""

    @property
    def failed(self) -> int:
        """How many callbacks have raised."""

    def announce(self, name: str, metadata: bytes = b"") -> Closing:
        """Say that somebody is here, until it is closed, the session is, or the program ends in whatever way.

        Raises:
          TransportError: this session announces the name already. (That another does too is seen by those who watch.)
        """

    def watch(self, prefix: str, changed: Watch) -> Closing:
        """Hear of all names at or below `prefix`: those that are there, then who comes and goes.

        One that dies and returns is first told as gone. A name that two sessions announce is told twice.
        """

    def answer(self, name: str, handler: Answer) -> Closing:
        """Answer the questions to a name; several may be under way at once."""

    async def ask(self, name: str, question: bytes = b"", *, timeout_s: float = 5.0) -> bytes:
        """Ask who answers to a name.

        Raises:
          NoAnswer: nobody answers to it, who did has gone, or it took longer than `timeout_s`.
          QueryRefused: the answer is a refusal; its text says why.
          MessageTooLarge: the question is too long.
        """

    async def close(self) -> None:
        """End all of it. Always returns within seconds, whatever others do; nothing is called back afterwards.

        What is asked meanwhile gets `NoAnswer`. Closing twice does nothing.
        """


@runtime_checkable
class Transport(Protocol):
    """What the entry points of the group `hfg.transports` name: makes sessions."""

    async def open(self, **settings: Any) -> Session:
        """Begin a session on the running loop.

        Args:
          **settings: the transport's own; addresses, keys, limits.

        Raises:
          TransportError: it cannot begin, with the reason and the remedy.
        """


# --- what a link is ---

Guarantee: TypeAlias = Literal["exact", "bounded"]
"""What a link promises beyond its order, which each keeps.

exact (L1, L2, L3): for edges from an output, `wait` edges from an event, and every active edge. Each token is delivered
  exactly once and in order, through loss, repetition and reordering, through loss of connection and through the death
  and return of the consumer, as far as its effects are recorded with its `Position`. While the consumer is away tokens
  stay with the producer, whose window fills up; nobody spins. A dead producer's tokens that were not done are gone,
  unless it kept an outbox, and a new one begins a new stream.
bounded: for edges from an event with a policy that drops. Each token is delivered at most once and in order. The
  producer never waits; what the transport loses and what the policy drops is counted, and that is all.
"""

LinkOverflow: TypeAlias = Literal["drop_oldest", "drop_newest", "latest", "error"]
"""What a bounded link does with a token too many, in the words of rule P5."""

EncodedToken: TypeAlias = tuple[bytes, Buffer]
"""A token made ready for its way: what is small about it (markers, modifier, stamp), and its value.

A link looks into neither.
"""


class Position(NamedTuple):
    """Where a token stands, for good: what a ledger records, and a key by which its effects can be told from others.

    Positions are ordered: a producer that returns without its memory begins a higher stream, and numbers within a
    stream go up by one. A node that answers each token with one token may give its outputs the positions of its inputs;
    then it needs no ledger, since whoever comes behind it knows a repetition by its position.

    Attributes:
      stream: which numbering; from 1.
      sequence: the number in it; from 1. 0 is before the first.
    """

    stream: int
    sequence: int


class Delivery(msgspec.Struct, frozen=True, gc=False):
    """A token at the receiving end of a link; there are many, so making one is cheap.

    Attributes:
      stream: of its position.
      sequence: of its position.
      metadata: what is small about it.
      value: its value.
    """

    stream: int
    sequence: int
    metadata: bytes
    value: Buffer

    @property
    def position(self) -> Position:
        """Where it stands, for good."""
        return Position(self.stream, self.sequence)

    @property
    def token(self) -> EncodedToken:
        """It, as it was sent."""
        return self.metadata, self.value


@runtime_checkable
class OutgoingLink(Protocol):
    """The producer's end of a link, to one or several consumers that all get each token."""

    @property
    def free(self) -> bool:
        """Whether `send_nowait` would take a token. Always, if the link is bounded."""

    @property
    def released(self) -> int:
        """The last number of the stream for which the producer's output counts as free again.

        Those are done or, if the link says so (edges into slots), accepted by all consumers.
        """

    def send_nowait(self, token: EncodedToken, position: Position | None = None) -> int:
        """Take the next token and give its number in the stream.

        Args:
          token: what to send; its value is left as it is until it is done.
          position: that of the input which it answers; None: the next number of the producer's own stream.

        Raises:
          UsageError: the window is full; look at `free` first, or await `send`.
        """

    async def send(self, token: EncodedToken, position: Position | None = None) -> int:
        """The same, but wait while the window is full."""

    def admit(self, consumer: str, incarnation: int | None = None, *, after: int | None = None) -> None:
        """Let a consumer take part from the next token on; all that follow wait for it too, also while it is away.

        Args:
          consumer: its name on this link.
          incarnation: whom to believe from now on, if somebody knows; else the newest that is heard of.
          after: the number behind which it takes part, for those that did when an outbox was kept.
        """

    def dismiss(self, consumer: str) -> None:
        """Wait for a consumer no longer: what it has not done counts as processed (R4)."""

    def statistics(self) -> Mapping[str, int]:
        """What was sent, resent, acknowledged, refused and lost, in numbers."""

    async def close(self, *, over: bool = False) -> None:
        """End this life of it; what was not done is given up and counted.

        Args:
          over: there will be no other, so consumers are told to wait no longer.
        """


@runtime_checkable
class IncomingLink(Protocol):
    """A consumer's end of a link."""

    def take_nowait(self) -> Delivery | None:
        """Give the next token if there is one."""

    async def take(self) -> Delivery:
        """Give the next token, waiting for it."""

    def done(self, count: int = 1) -> None:
        """Say that the oldest tokens that were taken are processed, so that they are never delivered again.

        All their effects are there by now and, if there is a ledger, their position is in it. Bounded links need no
        word.

        Raises:
          UsageError: fewer have been taken.
        """

    def statistics(self) -> Mapping[str, int]:
        """What was received, refused, repeated, missing and dropped, in numbers."""

    async def close(self) -> None:
        """End it; what was not done will be delivered to whoever comes next."""
