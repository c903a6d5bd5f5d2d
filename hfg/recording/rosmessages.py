"""Tokens from messages of ROS 2 in a recording. Depends on `messages` and `hfg.ros`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mcap.records import Channel, Schema

from hfg.base.token import Token
from hfg.recording.messages import TokenReader
from hfg.recording.reading import CDR
from hfg.ros.messages import MessageType, types_of


def reader_of(channel: Channel, schema: Schema | None, hint: Any, *, may_pickle: bool) -> TokenReader:
    """Return what makes tokens of a channel's messages.

    Args:
      channel: the channel.
      schema: of its messages.
      hint: the type of the port that plays it.
      may_pickle: whether pickled values are read.
    """
    if channel.message_encoding == CDR and schema is not None:
        return RosReader(schema, hint)
    return TokenReader("" if schema is None else schema.name, hint, may_pickle=may_pickle)


def type_of(schema: Schema) -> MessageType:
    """Return the type of a channel's messages.

    Raises:
      UsageError: it is unknown, and its definition cannot be read.
    """
    return types_of(schema.name, schema.data.decode("utf-8", "replace") if schema.encoding == "ros2msg" else "")


class RosReader(TokenReader):
    """Makes tokens from messages of ROS 2, with the stamps in their headers, or else the times they were written."""

    def __init__(self, schema: Schema, hint: Any) -> None:
        super().__init__(schema.name, hint, may_pickle=False)
        known = type_of(schema)
        self._stamp = known.stamp
        self._decode = known.unpack if hint is known.record else known.decode

    def fields(self, data: bytes, ns: int, plain: Callable[[bytes], Any]) -> Any:
        """Return the message as it is, and its stamp."""
        return {"value": data, "stamp": self._stamp(data) or ns / 1e9}

    def token(self, message: dict[str, Any]) -> Token[Any]:
        """Return the token of a message.

        Raises:
          EncodingError: it is not of its type.
        """
        return Token(self._decode(message["value"]), 0, message["stamp"])
