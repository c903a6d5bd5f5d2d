"""What a link puts on the wire: headers in msgpack, read by type and never trusted (rule L4).

A header is an array that begins with a number which says both what it is and by which version of the protocol, so that
another version is recognised before anything of it is read. Tokens go in runs of consecutive numbers: the header holds
what is small about each, the payload is their values. All limits are here. Stands on the contract alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Final, NamedTuple, TypeAlias, TypeVar

import msgspec

from hfg.errors import MessageTooLarge
from hfg.transport import Buffer, EncodedToken

__all__ = [
    "LONGEST_METADATA",
    "LONGEST_NAME",
    "MOST_TOKENS",
    "VERSION",
    "FromConsumer",
    "FromProducer",
    "OtherVersion",
    "Outgoing",
    "Probe",
    "Status",
    "Tokens",
    "Unreadable",
    "batches",
    "checked",
    "read_from_consumer",
    "read_from_producer",
    "values_of",
    "write",
]

VERSION: Final = 1
MOST_TOKENS: Final = 1024
"""Tokens of one datagram."""
LONGEST_METADATA: Final = 4096
"""Bytes of what is small about a token."""
LONGEST_NAME: Final = 512
"""Characters of a consumer's name."""
_LARGEST: Final = 2**62  # so that sums of two stay in 64 bits, whoever reads them
_TAG: Final = VERSION * 16  # the lower four bits say what it is

Number: TypeAlias = Annotated[int, msgspec.Meta(ge=0, le=_LARGEST)]
Name: TypeAlias = Annotated[str, msgspec.Meta(max_length=LONGEST_NAME)]
Metadata: TypeAlias = Annotated[bytes, msgspec.Meta(max_length=LONGEST_METADATA)]


class Unreadable(Exception):
    """The datagram is no frame of a link."""


class OtherVersion(Unreadable):
    """It may be one, of a version of the protocol that is not this one."""


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
      epoch: which life of the producer this is.
      stream: which numbering; see `Position`.
      first: the number of the first of them.
      serial: counts what the producer has sent, so that it can tell what is known of by when.
      metadata: of each token.
    """

    epoch: Number
    stream: Number
    first: Number
    serial: Number
    metadata: Annotated[list[Metadata], msgspec.Meta(min_length=1, max_length=MOST_TOKENS)]


class Probe(msgspec.Struct, array_like=True, frozen=True, gc=False, tag=_TAG + 2):
    """The producer tells one consumer where it stands and wants its status.

    Attributes:
      consumer: whom it is for.
      incarnation: which life of the consumer it is for; 0: none is known.
      epoch: which life of the producer this is.
      stream: which numbering is in use.
      lowest: the first number that this consumer may still get; all before are done, or gone.
      highest: the last number there is.
      serial: as with `Tokens`.
      eager: what was accepted is to be told at once, not only what is done.
      closing: there will be no more.
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
    """A consumer tells where it stands: acknowledgement, credit and evidence of what is missing, all in one.

    Attributes:
      consumer: its name.
      incarnation: which life of it this is.
      epoch: the life of the producer it listens to; 0: none yet.
      stream: the numbering it follows; 0: none yet.
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
"""Gives a frame as the header of a datagram."""


def read_from_producer(header: Buffer) -> FromProducer:
    """Read what a consumer has got.

    Raises:
      Unreadable: it is no such frame.
    """
    return _read(_read_producers, header)


def read_from_consumer(header: Buffer) -> FromConsumer:
    """Read what a producer has got.

    Raises:
      Unreadable: it is no such frame.
    """
    return _read(_read_consumers, header)


def _read(decoder: msgspec.msgpack.Decoder[Frame], header: Buffer) -> Frame:
    try:
        return decoder.decode(header)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise _what_is_wrong(header) from error


def _what_is_wrong(header: Buffer) -> Unreadable:
    """An array that begins with a whole number of another version; the rest of it may be anything."""
    view = memoryview(header)
    start = view[1] if len(view) > 1 and 0x90 <= view[0] <= 0x9F else 0
    if start in range(16, 128) and start // 16 != VERSION:
        return OtherVersion(f"frames of version {start // 16} of the link protocol; this is version {VERSION}")
    return Unreadable("no frame of the link protocol")


def checked(token: EncodedToken, largest: int) -> EncodedToken:
    """Give a token as it can be sent: its value in plain bytes, whose number is their length.

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
    """Give the values of a run of tokens; a single one is the payload itself, not copied.

    Raises:
      Unreadable: they are not as many as the header says.
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
    """Part a run of tokens into datagrams: the metadata and the payload of each.

    Args:
      tokens: at least one.
      largest: the bytes of a datagram of several tokens; a token that is larger goes alone.
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
