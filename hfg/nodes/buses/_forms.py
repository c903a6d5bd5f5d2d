"""Messages as bytes and as values, and where one ends in a stream of bytes. Bounded, and it never waits.

Depends on the encoding and on the nodes that parse.
"""

from __future__ import annotations

from typing import Any, Final, Literal, TypeAlias

from hfg.encoding.plain import json_value
from hfg.nodes.values.parsing import json_bytes

Form: TypeAlias = Literal["text", "bytes", "json"]
Framing: TypeAlias = Literal["lines", "bytes"]

_END: Final = b"\n"


class BadMessage(ValueError):
    """A message that cannot be read; the connection stays open."""


def to_bytes(value: Any, form: Form) -> bytes:
    """Return a value as the bytes of a message.

    Raises:
      TypeError: it is not of that form.
      ValueError: part of it cannot be represented in JSON.
    """
    if form == "json":
        return json_bytes(value)
    if form == "text" and isinstance(value, str):
        return value.encode()
    if form == "bytes" and isinstance(value, bytes | bytearray | memoryview):
        return bytes(value)
    wanted = {"text": "str", "bytes": "bytes"}[form]
    raise TypeError(
        f'a message is {wanted}, got {type(value).__name__}; convert it, or set the parameter "form" '
        'to "text", "bytes" or "json"'
    )


def from_bytes(data: bytes, form: Form) -> Any:
    """Return the bytes of a message as a value.

    Raises:
      BadMessage: they are not of that form.
    """
    if form == "bytes":
        return data
    try:
        return data.decode() if form == "text" else json_value(data)
    except (ValueError, RecursionError) as error:
        what = "UTF-8" if form == "text" else "JSON"
        raise BadMessage(f"a message of {len(data):,} bytes is not {what}: {error}") from None


class Splitter:
    """Cuts a stream of bytes into messages, in memory that is bounded.

    A line that is too long is skipped up to its end.

    Args:
      framing: "lines", without their ends, or "bytes" as they come.
      most: bytes of a line.

    Attributes:
      too_long: lines that were skipped.
    """

    def __init__(self, framing: Framing, most: int) -> None:
        self.too_long = 0
        self._lines = framing == "lines"
        self._most = most
        self._rest = bytearray()
        self._skips = False

    def feed(self, data: bytes) -> list[bytes]:
        """Return the messages that are complete now."""
        if not self._lines:
            return [data] if data else []
        done: list[bytes] = []
        *complete, rest = data.split(_END)
        for part in complete:
            self._add(part)
            if not self._skips:
                done.append(bytes(self._rest).removesuffix(b"\r"))
            self._rest.clear()
            self._skips = False
        self._add(rest)
        return done

    def finish(self) -> list[bytes]:
        """Return a last line without an end: the stream is over."""
        last = [bytes(self._rest)] if self._rest and not self._skips else []
        self._rest.clear()
        self._skips = False
        return last

    def _add(self, part: bytes) -> None:
        if not self._skips and len(self._rest) + len(part) > self._most:
            self._skips = True
            self.too_long += 1
            self._rest.clear()
        if not self._skips:
            self._rest += part


def framed(data: bytes, framing: Framing) -> bytes:
    """Return a message as it stands in a stream.

    Raises:
      ValueError: it has an end of a line within.
    """
    if framing == "bytes":
        return data
    if _END in data:
        raise ValueError('a message with an end of a line cannot be sent as a line; set framing="bytes", or replace it')
    return data + _END
