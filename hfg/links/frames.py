"""The wire format of links: headers in msgpack, read by type and never trusted (rule L4).

A header is an array that starts with a number for both its kind and the protocol version, so that another version is
recognised before anything else is read. Tokens are sent in runs of consecutive numbers: the header has the small parts
of each, the payload has their values. All limits are defined here. Depends only on the contract.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Final, NamedTuple, TypeAlias, TypeVar

import msgspec

from hfg.errors import MessageTooLarge
from hfg.transport import Buffer, EncodedToken

VERSION: Final = 1
MOST_TOKENS: Final = 1024
"""Tokens of one datagram."""
LONGEST_METADATA: Final = 4096
"""Bytes of what is small about a token."""
LONGEST_NAME: Final = 512
"""Characters of a consumer's name."""
_LARGEST: Final = 2**62  # so that the sum of two stays within 64 bits in any implementation
_TAG: Final = VERSION * 16  # the lower four bits are the kind

Number: TypeAlias = Annotated[int, msgspec.Meta(ge=0, le=_LARGEST)]
Name: TypeAlias = Annotated[str, msgspec.Meta(max_length=LONGEST_NAME)]
Metadata: TypeAlias = Annotated[bytes, msgspec.Meta(max_length=LONGEST_METADATA)]


class Unreadable(Exception):
    """The datagram is not a frame of a link."""


class OtherVersion(Unreadable):
    """It may be a frame of another version of the protocol."""


class Outgoing(NamedTuple):
    """A datagram that a machine wants to be put.

    Attributes:
      to: the consumer it is for; None: all of them, or the producer.
      header: its header.
      payload: values of tokens.
    """

    to: str | None
    header: bytes
    payload: Buffer


class Tokens(msgspec.Struct, array_like=True, frozen=True, gc=False, tag=_TAG + 1):
    """A run of tokens with consecutive numbers; the payload has their values.

    Attributes:
      epoch: incarnation of the producer.
      stream: number of the stream; see `Position`.
      first: the number of the first of them.
      serial: counts the producer's datagrams, so that it can tell which of them a status has taken into account.
      metadata: the small parts of each token.
    """

    epoch: Number
    stream: Number
    first: Number
    serial: Number
    metadata: Annotated[list[Metadata], msgspec.Meta(min_length=1, max_length=MOST_TOKENS)]


class Probe(msgspec.Struct, array_like=True, frozen=True, gc=False, tag=_TAG + 2):
    """The producer tells one consumer its position and asks for a status.

    Attributes:
      consumer: the receiver's name.
      incarnation: incarnation of the consumer; 0: unknown.
      epoch: incarnation of the producer.
      stream: number of the current stream.
      lowest: the first number that this consumer may still get; earlier ones are processed or gone.
      highest: the last number in use.
      serial: as with `Tokens`.
      eager: report accepted tokens at once, not only processed ones.
      closing: there will be no more tokens.
    """

    consumer: Name
    incarnation: Number
    epoch: Number
    stream: Number
    lowest: Number
    highest: Number
    serial: Number
    eager: bool
    closing: bool


class Status(msgspec.Struct, array_like=True, frozen=True, gc=False, tag=_TAG + 3):
    """A consumer's position: acknowledgement, credit and evidence of missing tokens, all in one.

    Attributes:
      consumer: its name.
      incarnation: its incarnation.
      epoch: the incarnation of the producer that it trusts; 0: none yet.
      stream: number of the stream that it follows; 0: none yet.
      accepted: all up to this number have arrived.
      done: all up to this number are processed and recorded.
      limit: it has room for tokens up to this number.
      seen: the newest serial number of that epoch that has arrived.
    """

    consumer: Name
    incarnation: Number
    epoch: Number
    stream: Number
    accepted: Number
    done: Number
    limit: Number
    seen: Number


FromProducer: TypeAlias = Tokens | Probe
FromConsumer: TypeAlias = Status
Frame = TypeVar("Frame", FromProducer, FromConsumer)

_encoder: Final = msgspec.msgpack.Encoder()
_read_producers: Final[msgspec.msgpack.Decoder[FromProducer]] = msgspec.msgpack.Decoder(FromProducer)
_read_consumers: Final = msgspec.msgpack.Decoder(FromConsumer)
_read_values: Final = msgspec.msgpack.Decoder(Annotated[list[bytes], msgspec.Meta(max_length=MOST_TOKENS)])

write: Final = _encoder.encode
"""Returns a frame as the header of a datagram."""


def read_from_producer(header: Buffer) -> FromProducer:
    """Read a frame that a consumer has received.

    Raises:
      Unreadable: it is not such a frame.
    """
    return _read(_read_producers, header)


def read_from_consumer(header: Buffer) -> FromConsumer:
    """Read a frame that a producer has received.

    Raises:
      Unreadable: it is not such a frame.
    """
    return _read(_read_consumers, header)


def _read(decoder: msgspec.msgpack.Decoder[Frame], header: Buffer) -> Frame:
    try:
        return decoder.decode(header)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise _what_is_wrong(header) from error


def _what_is_wrong(header: Buffer) -> Unreadable:
    """Return the error for a header: `OtherVersion` if it starts with another version's number, whatever follows."""
    view = memoryview(header)
    start = view[1] if len(view) > 1 and 0x90 <= view[0] <= 0x9F else 0
    if start in range(16, 128) and start // 16 != VERSION:
        return OtherVersion(f"frames of version {start // 16} of the link protocol; this is version {VERSION}")
    return Unreadable("no frame of the link protocol")


def checked(token: EncodedToken, largest: int) -> EncodedToken:
    """Return a token in the form for sending: its value as plain bytes, whose item count is their length.

    Raises:
      MessageTooLarge: it is larger than a transport carries, or its metadata than a header holds.
    """
    metadata, value = token
    if type(value) is memoryview and (value.ndim != 1 or value.itemsize != 1):
        value = value.cast("B")
        token = (metadata, value)
    if len(value) > largest or len(metadata) > LONGEST_METADATA:
        raise MessageTooLarge(
            f"a token of {len(value)} bytes and {len(metadata)} of metadata cannot be sent: the transport carries "
            f"{largest} and {LONGEST_METADATA} at once"
        )
    return token


def values_of(frame: Tokens, payload: Buffer) -> list[Buffer]:
    """Return the values of a run of tokens; a single value is the payload itself, not copied.

    Raises:
      Unreadable: their number differs from the header's.
    """
    if len(frame.metadata) == 1:
        return [payload]
    try:
        values: list[Buffer] = [*_read_values.decode(payload)]
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise Unreadable("the payload holds no values") from error
    if len(values) != len(frame.metadata):
        raise Unreadable(f"{len(values)} values for {len(frame.metadata)} tokens")
    return values


def batches(tokens: list[EncodedToken], largest: int) -> Iterator[tuple[list[bytes], Buffer]]:
    """Split a run of tokens into datagrams. Yield metadata and payload of each.

    Args:
      tokens: at least one.
      largest: maximum bytes of a datagram of several tokens; a larger token gets a datagram of its own.
    """
    metadata = [token[0] for token in tokens]
    values = [token[1] for token in tokens]
    lengths = sum(map(len, values)) + sum(map(len, metadata))
    if len(tokens) == 1:
        yield metadata, values[0]
    elif lengths + 8 * len(tokens) <= largest and len(tokens) <= MOST_TOKENS:
        yield metadata, _encoder.encode(values)
    else:
        yield from _parted(metadata, values, largest)


def _parted(metadata: list[bytes], values: list[Buffer], largest: int) -> Iterator[tuple[list[bytes], Buffer]]:
    start, filled = 0, 0
    for index, value in enumerate(values):
        length = len(value) + len(metadata[index]) + 8
        if index > start and (filled + length > largest or index - start == MOST_TOKENS):
            yield metadata[start:index], _payload(values[start:index])
            start, filled = index, 0
        filled += length
    yield metadata[start:], _payload(values[start:])


def _payload(values: list[Buffer]) -> Buffer:
    return values[0] if len(values) == 1 else _encoder.encode(values)
