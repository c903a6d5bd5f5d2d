"""The interface of transports, and the links that build on it (rules L1 to L4).

A *transport* carries datagrams between programs that know each other by keys. It may lose, repeat and delay them
without notice. A *link* is an edge of a graph whose ends are in two programs. It keeps the rules of that edge over any
transport, with its own numbers, acknowledgements and resends (`hfg.links`). So a transport has to guarantee little, and
is easy to write:

- `Session.publisher(key, traffic).put(header, payload)`  one datagram to all subscribers of the key
- `Session.subscribe(key, receive)`                       datagrams, a burst at a time
- `Session.announce(name, metadata)`, `Session.watch`     who is present, and who has gone
- `Session.answer(name, handler)`, `Session.ask`          questions with an answer or a refusal, for control

`hfg.testing.transports` has the tests that any transport must pass. Transports are found by entry points in the group
`hfg.transports`; the core never imports one. No dependencies, and not bound to a product or an event loop.

A *key* or *name* is a string of one or more chunks with "/" between them. A chunk is any non-empty string without "/".
The transport escapes characters that its own syntax forbids.
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
"""Bytes in memory. A buffer that was put or has arrived must not be written to."""


def size_of(buffer: Buffer) -> int:
    """Return the length in bytes; `len` of a view may count its elements instead."""
    return buffer.nbytes if isinstance(buffer, memoryview) else len(buffer)


Message: TypeAlias = tuple[Buffer, Buffer]
"""A datagram as it arrives: header and payload. Both stay unchanged for as long as they are referenced."""

Receive: TypeAlias = Callable[[list[Message]], None]
"""Called on the session's event loop with all datagrams since the last call, oldest first, at least one.

A burst costs one wake-up of the loop, however many datagrams it has; wake-ups, not bytes, limit the rate. The function
must not wait. If it raises, the session logs the error and continues.
"""


class Traffic(enum.Enum):
    """The purpose of a datagram, from which a transport derives its priority and its trade-off of delay and throughput.

    Listed from the most to the least urgent. Order is kept within one publisher, never between two.
    """

    ACKNOWLEDGEMENTS = "acknowledgements"
    """Small, and others wait for it: sent at once."""
    TOKENS = "tokens"
    """Tokens of links with back-pressure: sent at once, since links make batches themselves."""
    BULK = "bulk"
    """Tokens of links that may lose some: may wait a moment in order to be sent together."""
    BACKGROUND = "background"
    """Statistics, logs and taps: the first to be dropped."""


class Presence(NamedTuple):
    """A program has come or gone.

    Attributes:
      name: as announced.
      metadata: as announced; empty when the program has gone.
      present: False when the name was withdrawn, or its program is dead or has been silent for the transport's lease.
    """

    name: str
    metadata: bytes
    present: bool


Watch: TypeAlias = Callable[[list[Presence]], None]
"""Called on the session's event loop like `Receive`, with changes in order; the first call has all who are present."""

Answer: TypeAlias = Callable[[bytes], Awaitable[bytes]]
"""Answers a question. Raising any exception refuses it: the exception's message is sent to the caller."""


@runtime_checkable
class Closing(Protocol):
    """An activity that lasts until it is closed: a subscription, an announcement, a watch or an answerer."""

    def close(self) -> None:
        """Stop it. There are no more callbacks once this returns; closing twice does nothing."""


@runtime_checkable
class Publisher(Protocol):
    """Puts datagrams on one key."""

    def put(self, header: bytes, payload: Buffer = b"") -> None:
        """Send one datagram to all current subscribers of the key.

        Never waits, and never blocks the loop: a datagram that cannot be sent, or has no subscriber, is lost silently.
        The number of datagrams waiting to be sent is bounded. A buffer may be read until its receivers have
        acknowledged it, so do not change it before.

        Raises:
          MessageTooLarge: header and payload are longer than `Session.largest_message`.
          TransportError: the publisher or its session is closed.
        """

    def close(self) -> None:
        """Stop it; datagrams that were put are still sent."""


@runtime_checkable
class Datagrams(Protocol):
    """Carries datagrams, on one event loop: the part of a transport that a link needs."""

    @property
    def largest_message(self) -> int:
        """The maximum number of bytes of header and payload together."""

    def publisher(self, key: str, traffic: Traffic) -> Publisher:
        """Return a publisher of datagrams on a key.

        Datagrams of one publisher arrive in order, apart from losses, as long as the network behaves; links do not rely
        on this. Two publishers of one key are two sources without a common order.
        """

    def subscribe(self, key: str, receive: Receive) -> Closing:
        """Receive all datagrams of one key from about now on, including those of this session itself."""


@runtime_checkable
class Session(Datagrams, Protocol):
    """One program's end of a transport, on one event loop.

    Call its methods on that loop; its callbacks run there, too. Everything it does is bounded in memory and time.
    """

    @property
    def host(self) -> str:
        """The name of this computer on the network; the agent of a host has the same name."""

    @property
    def failed(self) -> int:
        """How many callbacks have raised."""

    def announce(self, name: str, metadata: bytes = b"") -> Closing:
        """Announce a name until the announcement or the session is closed, or the program ends in whatever way.

        Raises:
          TransportError: this session already announces the name. (Watchers see it if another session does, too.)
        """

    def watch(self, prefix: str, changed: Watch) -> Closing:
        """Watch all names at or below `prefix`: first those present, then every change.

        A program that dies and returns is first reported as gone. A name that two sessions announce is reported twice.
        """

    def answer(self, name: str, handler: Answer) -> Closing:
        """Answer the questions to a name; several may be in progress at once."""

    async def ask(self, name: str, question: bytes = b"", *, timeout_s: float = 5.0) -> bytes:
        """Ask the program that answers to a name.

        Raises:
          NoAnswer: no program answers to it, the one that did has gone, or it took longer than `timeout_s`.
          QueryRefused: the answer is a refusal; its text says why.
          MessageTooLarge: the question is too long.
        """

    async def close(self) -> None:
        """Close the session. Always returns within seconds, whatever others do; there are no callbacks afterwards.

        Questions in progress get `NoAnswer`. Closing twice does nothing.
        """


@runtime_checkable
class Transport(Protocol):
    """Makes sessions; the entry points of the group `hfg.transports` name one."""

    async def open(self, **settings: Any) -> Session:
        """Start a session on the running loop.

        Args:
          **settings: the transport's own; addresses, keys, limits.

        Raises:
          TransportError: it cannot start; the message has the reason and the remedy.
        """


# --- what a link is ---

Guarantee: TypeAlias = Literal["exact", "bounded"]
"""The guarantee of a link. Both kinds keep the order.

exact (L1, L2, L3): for edges from an output, `wait` edges from an event, and every active edge. Each token is delivered
  exactly once and in order, despite loss, repetition and reordering, loss of connection, and the death and return of
  the consumer, as far as its effects are recorded with its `Position`. While the consumer is away, tokens stay with the
  producer, whose window fills up; there is no busy waiting. When a producer dies, its unacknowledged tokens are lost
  unless it kept an outbox, and its successor starts a new stream.
bounded: for edges from an event with a policy that drops. Each token is delivered at most once and in order. The
  producer never waits; tokens that the transport loses or the policy drops are counted, but not resent.
"""

LinkOverflow: TypeAlias = Literal["drop_oldest", "drop_newest", "latest", "error"]
"""What a bounded link does with a token when its queue is full, in the terms of rule P5."""

EncodedToken: TypeAlias = tuple[bytes, Buffer]
"""A token prepared for sending: its small parts (marker, modifier, stamp), and its value.

A link does not look into either.
"""


class Position(NamedTuple):
    """The permanent position of a token: recorded by a ledger, and a key that identifies the token's effects.

    Positions are ordered: a producer that returns without its memory starts a higher stream, and numbers within a
    stream increase by one. A node that answers each token with one token may give its outputs the positions of its
    inputs. Then it needs no ledger, because its consumers recognise a repetition by its position.

    Attributes:
      stream: number of the stream; from 1.
      sequence: the token's number in the stream; from 1. 0 is before the first.
    """

    stream: int
    sequence: int


class Delivery(msgspec.Struct, frozen=True, gc=False):
    """A token at the receiving end of a link. There are many, so making one must be cheap.

    Attributes:
      stream: of its position.
      sequence: of its position.
      metadata: its small parts.
      value: its value.
    """

    stream: int
    sequence: int
    metadata: bytes
    value: Buffer

    @property
    def position(self) -> Position:
        """Its permanent position."""
        return Position(self.stream, self.sequence)

    @property
    def token(self) -> EncodedToken:
        """The token as it was sent."""
        return self.metadata, self.value


@runtime_checkable
class OutgoingLink(Protocol):
    """The producer's end of a link, to one or several consumers that each receive every token."""

    @property
    def free(self) -> bool:
        """Whether `send_nowait` would accept a token. Always true if the link is bounded."""

    @property
    def released(self) -> int:
        """The last number of the stream for which the producer's output counts as free again.

        All tokens up to it are processed or, if the link is declared so (edges into slots), accepted by all consumers.
        """

    def send_nowait(self, token: EncodedToken, position: Position | None = None) -> int:
        """Accept the next token. Return its number in the stream.

        Args:
          token: what to send; its value must not change until it is processed.
          position: the position of the input that it answers; None: the next number of the producer's own stream.

        Raises:
          UsageError: the window is full; check `free` first, or await `send`.
        """

    async def send(self, token: EncodedToken, position: Position | None = None) -> int:
        """Do the same, but wait while the window is full."""

    def admit(self, consumer: str, incarnation: int | None = None, *, after: int | None = None) -> None:
        """Add a consumer, starting with the next token. All later tokens wait for it, even while it is away.

        Args:
          consumer: its name on this link.
          incarnation: its current incarnation, if known; otherwise the newest one that sends a message is trusted.
          after: the number of the last token before it takes part, for consumers from the time when an outbox was kept.
        """

    def dismiss(self, consumer: str) -> None:
        """Stop waiting for a consumer: tokens that it has not processed count as processed (R4)."""

    def statistics(self) -> Mapping[str, int]:
        """Return the numbers of tokens sent, resent, acknowledged, refused and lost."""

    async def close(self, *, over: bool = False) -> None:
        """End this incarnation of the link. Unacknowledged tokens are abandoned and counted.

        Args:
          over: this is the last incarnation, so consumers are told to stop waiting.
        """


@runtime_checkable
class IncomingLink(Protocol):
    """A consumer's end of a link."""

    def take_nowait(self) -> Delivery | None:
        """Return the next token if there is one."""

    async def take(self) -> Delivery:
        """Return the next token, waiting for it."""

    def done(self, count: int = 1) -> None:
        """Acknowledge the oldest tokens that were taken, so that they are never delivered again.

        By now all their effects exist and, if there is a ledger, their position is in it. Bounded links need no
        acknowledgement.

        Raises:
          UsageError: fewer tokens have been taken.
        """

    def statistics(self) -> Mapping[str, int]:
        """Return the numbers of tokens received, refused, repeated, missing and dropped."""

    async def close(self) -> None:
        """Close it; tokens that were not acknowledged will be delivered to the next consumer."""
