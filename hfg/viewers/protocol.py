"""Foxglove's WebSocket protocol, the part that a server needs that only shows. Depends on msgspec.

Source: the specification in github.com/foxglove/ws-protocol; Foxglove's SDK uses the same messages under another name
of the protocol. A viewer can subscribe and unsubscribe, and nothing else.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import Any, Final

import msgspec

from hfg.errors import UsageError

SUBPROTOCOLS: Final = ("foxglove.sdk.v1", "foxglove.websocket.v1")
"""The newer one first."""

_HEAD: Final = struct.Struct("<BIQ")
_TIME: Final = struct.Struct("<BQ")
_MESSAGE, _CLOCK = 1, 2
_LARGEST_ID: Final = 2**32 - 1

HEAD: Final = _HEAD.size
"""Bytes in front of the data of a message."""


class _Wanted(msgspec.Struct):
    id: int
    channelId: int  # noqa: N815 - as in the protocol


class Subscribe(msgspec.Struct, tag_field="op", tag="subscribe"):
    """A viewer wants to see channels, under numbers of its own."""

    subscriptions: list[_Wanted]


class Unsubscribe(msgspec.Struct, tag_field="op", tag="unsubscribe"):
    """A viewer no longer wants what it has under these numbers."""

    subscriptionIds: list[int]  # noqa: N815 - as in the protocol


class _Any(msgspec.Struct):
    op: str


_OPERATION: Final = msgspec.json.Decoder(_Any)
_KNOWN: Final = msgspec.json.Decoder(Subscribe | Unsubscribe)


def read(text: str | bytes) -> Subscribe | Unsubscribe | str:
    """Read what a viewer says; of operations that are not allowed, the name.

    Raises:
      UsageError: it is not a message of the protocol.
    """
    try:
        operation: str = _OPERATION.decode(text).op
        if operation not in ("subscribe", "unsubscribe"):
            return operation
        message: Subscribe | Unsubscribe = _KNOWN.decode(text)
    except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
        raise UsageError(f"this is not a message of Foxglove's protocol: {error}") from None
    if isinstance(message, Subscribe) and not all(0 <= one.id <= _LARGEST_ID for one in message.subscriptions):
        raise UsageError(f"a subscription has a number from 0 to {_LARGEST_ID}")
    return message


def json_of(operation: str, **fields: Any) -> str:
    """Return a message of the server that is JSON."""
    return msgspec.json.encode({"op": operation, **fields}).decode()


def server_info(name: str, session: str, *, has_clock: bool) -> str:
    """Return the first message: nothing can be changed, and the clock may be the run's."""
    return json_of("serverInfo", name=name, capabilities=["time"] if has_clock else [], sessionId=session, metadata={})


def message_head(subscription: int, ns: int) -> bytes:
    """Return what stands in front of a message's data; `ns`: when it was sent, in nanoseconds."""
    return _HEAD.pack(_MESSAGE, subscription, ns)


def time(ns: int) -> bytes:
    """Return a message that says how late it is on the run's clock, in nanoseconds."""
    return _TIME.pack(_CLOCK, ns)


def refusals(reasons: Iterable[str]) -> str:
    """Return a message for the user of the viewer."""
    return json_of("status", level=2, message="; ".join(reasons))
