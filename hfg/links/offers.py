"""What programs that meet by a name say of themselves, and whether two of them fit (rule L4).

Everybody who publishes or subscribes is announced on the transport, below the name that they share:

    hfg/named/NAME/PUBLISHER/offer          somebody publishes
    hfg/named/NAME/PUBLISHER/end            what he published has ended
    hfg/named/NAME/PUBLISHER/join CONSUMER  somebody takes part in what he publishes

with what he says of himself. Publishers and consumers have an identity for each life, drawn at random, so one that
returns is another and nobody has to know whose life is newer. Pure: stands on the encoding of types.
"""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal, NamedTuple, TypeAlias

import msgspec

from hfg.base.controls import cleaned
from hfg.encoding import description_of, difference, type_fingerprint
from hfg.errors import EncodingError, UsageError

__all__ = ["Introduction", "Seen", "introduce", "key_of", "need_link_name", "read_introduction", "read_name", "unfit"]

VERSION: Final = 1
_LONGEST_TYPE: Final = 12_000  # of a description: all that is announced has to fit into a key of Zenoh
_LONGEST_NAME: Final = 400

What: TypeAlias = Literal["offer", "end", "join"]


class Introduction(msgspec.Struct, frozen=True, array_like=True):
    """What somebody says of himself.

    Attributes:
      version: of what is said here and on the links.
      who: for people: which graph, in which process, on which host.
      fingerprint: of the type.
      lossless: a publisher: whether he waits for those who want every value; a consumer: whether he wants every one.
      type: its description; empty where it is too long to be said.
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
    """Give what is announced.

    Raises:
      EncodingError: values of this type cannot cross.
    """
    described = description_of(hint)
    said = described if len(described) <= _LONGEST_TYPE else ""
    return _encode(Introduction(VERSION, who[:300], type_fingerprint(hint), lossless, said, stream))


def read_introduction(metadata: bytes) -> Introduction | None:
    """Give what was announced, or None if it is nothing of the kind: it may come from anybody."""
    try:
        return cleaned(_decode(metadata))
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return None


class Seen(NamedTuple):
    """What an announced name says.

    Attributes:
      publisher: whom it is about.
      what: what it says of him.
      consumer: who takes part; "" else.
    """

    publisher: str
    what: What
    consumer: str


def need_link_name(name: str) -> str:
    """Give the name back.

    Raises:
      UsageError: it is none.
    """
    if not all(name.split("/")) or len(name) > _LONGEST_NAME:
        raise UsageError(
            f'"{name:.80}" is no name to meet by: write words with "/" between them, as in "camera/front", '
            f"at most {_LONGEST_NAME} characters"
        )
    return name


def key_of(name: str, publisher: str = "") -> str:
    """Give what everything about a name begins with, or everything about one publisher of it."""
    return f"hfg/named/{name}/{publisher}" if publisher else f"hfg/named/{name}"


def read_name(name: str, announced: str) -> Seen | None:
    """Give what an announced name says of who meets by `name`; None if it is about another, longer name."""
    publisher, slash, rest = announced.removeprefix(f"{key_of(name)}/").partition("/")
    what, _, consumer = rest.partition(" ")
    if not slash or "/" in rest or what not in ("offer", "end", "join") or (what == "join") != bool(consumer):
        return None
    return Seen(publisher, what, consumer)  # type: ignore[arg-type]  # one of the three, as was just seen


def unfit(hint: Any, publisher: Introduction, consumer: Introduction, *, here: Literal["publisher", "consumer"]) -> str:
    """Say why a consumer cannot take part in what is published, and what to do; "" if he can.

    Args:
      hint: the type of this end.
      publisher: what he says of himself.
      consumer: the same.
      here: which of them is at this end.
    """
    theirs = consumer if here == "publisher" else publisher
    if publisher.version != consumer.version:
        return f"it speaks version {theirs.version} of this protocol, and this end {VERSION}; install the same hfg"
    if publisher.fingerprint != consumer.fingerprint:
        return f"the types differ: {_difference(hint, theirs)}; declare the same type at both ends"
    if consumer.lossless and not publisher.lossless:
        whose = ("the subscriber wants", "subscribe there") if here == "publisher" else ("this end wants", "subscribe")
        return (
            f"it is published with lossless=False, which waits for nobody, and {whose[0]} every value; "
            f'{whose[1]} with overflow="latest", or publish with lossless=True'
        )
    return ""


def _difference(hint: Any, theirs: Introduction) -> str:
    try:
        return (difference(hint, theirs.type) if theirs.type else None) or "somewhere deep inside"
    except EncodingError:
        return "what the other end says of its type cannot be read"
