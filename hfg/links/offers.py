"""The announcements of programs that connect by a name, and whether two of them match (rule L4).

Every publisher and subscriber is announced on the transport, below the name that they share:

    hfg/named/NAME/PUBLISHER/offer          a publisher
    hfg/named/NAME/PUBLISHER/end            its stream has ended
    hfg/named/NAME/PUBLISHER/join CONSUMER  a subscriber of it

together with a description. Publishers and consumers have a random identity per incarnation, so one that returns is a
new one, and it does not matter which incarnation is newer. Pure functions; depends on the encoding of types.
"""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal, NamedTuple, TypeAlias

import msgspec

from hfg.base.controls import cleaned
from hfg.encoding import description_of, difference, type_fingerprint
from hfg.errors import EncodingError, UsageError

VERSION: Final = 1
_LONGEST_TYPE: Final = 12_000  # of a description: all that is announced has to fit into a key of Zenoh
_LONGEST_NAME: Final = 400

What: TypeAlias = Literal["offer", "end", "join"]


class Introduction(msgspec.Struct, frozen=True, array_like=True):
    """The description of a publisher or consumer.

    Attributes:
      version: version of the protocol, here and on the links.
      who: for messages: graph, process and host.
      fingerprint: fingerprint of the type.
      lossless: of a publisher: whether it waits for consumers that want every value; of a consumer: whether it wants
        every value.
      type: description of the type; empty if it is too long.
      stream: a publisher with an outbox: what all his lives publish, so that nobody takes a value twice; else empty.
    """

    version: Annotated[int, msgspec.Meta(ge=1)]
    who: Annotated[str, msgspec.Meta(max_length=300)]
    fingerprint: Annotated[str, msgspec.Meta(max_length=64)]
    lossless: bool
    type: Annotated[str, msgspec.Meta(max_length=_LONGEST_TYPE)]
    stream: Annotated[str, msgspec.Meta(max_length=64)] = ""


_encode: Final = msgspec.msgpack.Encoder().encode
_decode: Final = msgspec.msgpack.Decoder(Introduction).decode


def introduce(hint: Any, who: str, *, lossless: bool, stream: str = "") -> bytes:
    """Return the announcement.

    Raises:
      EncodingError: values of this type cannot be sent to another process.
    """
    described = description_of(hint)
    said = described if len(described) <= _LONGEST_TYPE else ""
    return _encode(Introduction(VERSION, who[:300], type_fingerprint(hint), lossless, said, stream))


def read_introduction(metadata: bytes) -> Introduction | None:
    """Return the announcement, or None if it is not valid: any program may have sent it."""
    try:
        return cleaned(_decode(metadata))
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return None


class Seen(NamedTuple):
    """The contents of an announced name.

    Attributes:
      publisher: the publisher that it is about.
      what: the kind of announcement.
      consumer: the consumer that takes part, or "".
    """

    publisher: str
    what: What
    consumer: str


def need_link_name(name: str) -> str:
    """Return the name if it is valid.

    Raises:
      UsageError: it is not a valid name.
    """
    if not all(name.split("/")) or len(name) > _LONGEST_NAME:
        raise UsageError(
            f'"{name:.80}" is not a valid name for publishing: write words with "/" between them, as in '
            f'"camera/front", at most {_LONGEST_NAME} characters'
        )
    return name


def key_of(name: str, publisher: str = "") -> str:
    """Return the common prefix of all keys of a name, or of one publisher of it."""
    return f"hfg/named/{name}/{publisher}" if publisher else f"hfg/named/{name}"


def read_name(name: str, announced: str) -> Seen | None:
    """Return the contents of an announced name below `name`; None if it belongs to another, longer name."""
    publisher, slash, rest = announced.removeprefix(f"{key_of(name)}/").partition("/")
    what, _, consumer = rest.partition(" ")
    if not slash or "/" in rest or what not in ("offer", "end", "join") or (what == "join") != bool(consumer):
        return None
    return Seen(publisher, what, consumer)  # type: ignore[arg-type]  # one of the three, as was just seen


def unfit(hint: Any, publisher: Introduction, consumer: Introduction, *, here: Literal["publisher", "consumer"]) -> str:
    """Return why a consumer cannot subscribe to a publisher, and what to do; "" if it can.

    Args:
      hint: type of this end.
      publisher: its description.
      consumer: its description.
      here: which of the two is at this end.
    """
    theirs = consumer if here == "publisher" else publisher
    if publisher.version != consumer.version:
        return (
            f"it uses version {theirs.version} of this protocol, and this end {VERSION}; install the same version "
            "of hfg"
        )
    if publisher.fingerprint != consumer.fingerprint:
        return f"the types differ: {_difference(hint, theirs)}; declare the same type at both ends"
    if consumer.lossless and not publisher.lossless:
        whose = ("the subscriber wants", "subscribe there") if here == "publisher" else ("this end wants", "subscribe")
        return (
            f"it is published with lossless=False, which waits for no subscriber, but {whose[0]} every value; "
            f'{whose[1]} with overflow="latest", or publish with lossless=True'
        )
    return ""


def _difference(hint: Any, theirs: Introduction) -> str:
    try:
        return (difference(hint, theirs.type) if theirs.type else None) or "somewhere deep inside"
    except EncodingError:
        return "the other end's description of its type cannot be read"
