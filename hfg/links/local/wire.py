"""Frames on a connection, as bytes: made, and taken out of what comes. No sockets, no event loop.

A frame is its head (kind, and the lengths of key, header and payload), then key, header and payload, and a seal that
covers all of it. The seal of a payload that is longer than `LONG` stands before it and covers its length only: on a
connected socket nobody but the other end can write, and that end has proved who it is, so hashing megabytes would buy
nothing.
Depends on `proof`.
"""

from __future__ import annotations

import enum
import struct
from typing import Final, NamedTuple

from hfg.links.local.proof import TAG_SIZE, Refused, Seals
from hfg.transport import Buffer, size_of

_HEAD: Final = struct.Struct("<BHII")  # kind, and bytes of the key, the header and the payload, which follow
LONG: Final = 2**18
"""A payload with more bytes gets a buffer of its own, which nobody copies."""
LONGEST_KEY: Final = 2**15
LONGEST_HEADER: Final = 2**17
CHUNK: Final = _HEAD.size + LONGEST_KEY + LONGEST_HEADER + LONG + TAG_SIZE
"""Bytes that are read at once: the longest frame whose payload is not long."""


class Kind(enum.IntEnum):
    """What a frame is for."""

    DATAGRAM = 0
    WANT = 1
    UNWANT = 2
    ANNOUNCE = 3
    WITHDRAW = 4
    ANSWER = 5
    UNANSWER = 6
    ASK = 7
    TELL = 8
    REFUSE = 9
    GONE = 10
    READY = 11
    WIDE = 12


_KINDS: Final = frozenset(Kind)


class Frame(NamedTuple):
    """One frame, as it came."""

    kind: int
    key: bytes
    header: bytes
    payload: Buffer


def frame(seals: Seals, kind: int, key: bytes, header: bytes, payload: Buffer) -> tuple[bytes, Buffer]:
    """Return a frame as bytes, and behind them the payload if that is long."""
    size = size_of(payload)
    head = _HEAD.pack(kind, len(key), len(header), size)
    if size > LONG:
        said = head + key + header
        return said + seals.next(said), payload
    said = b"".join((head, key, header, payload))
    return said + seals.next(said), b""


class Inflow:
    """Takes frames out of what comes over a connection, in any pieces.

    Args:
      seals: of the connection.
      largest: the most bytes of header and payload together.
    """

    def __init__(self, seals: Seals, largest: int) -> None:
        self._seals = seals
        self._largest = largest
        self._chunk = bytearray(CHUNK)
        self._filled = 0  # bytes of it that are not a whole frame yet
        self._long: Frame | None = None
        self._rest = memoryview(b"")

    @property
    def room(self) -> memoryview:
        """Where the next bytes belong."""
        return self._rest if self._long is not None else memoryview(self._chunk)[self._filled :]

    @property
    def is_in_long(self) -> bool:
        """Whether a long payload is still coming."""
        return self._long is not None

    def take(self, count: int) -> list[Frame]:
        """So many bytes have come into `room`: return the frames that are whole now.

        Raises:
          Refused: it is not a frame of the other end's.
        """
        if self._long is None:
            self._filled += count
            return self._whole()
        self._rest = self._rest[count:]
        if self._rest:
            return []
        long, self._long = self._long, None
        return [long]

    def _whole(self) -> list[Frame]:
        chunk, filled = memoryview(self._chunk), self._filled
        frames: list[Frame] = []
        start = 0
        while filled - start >= _HEAD.size:
            kind, of_key, of_header, of_payload = _HEAD.unpack_from(chunk, start)
            if (
                kind not in _KINDS
                or of_key > LONGEST_KEY
                or of_header > LONGEST_HEADER
                or of_header + of_payload > self._largest
            ):
                raise Refused("it has sent what is not a frame")
            is_long = of_payload > LONG
            header = start + _HEAD.size + of_key
            value = header + of_header
            sealed = value if is_long else value + of_payload
            end = sealed + TAG_SIZE
            if end > filled:
                break
            if chunk[sealed:end] != self._seals.next(chunk[start:sealed]):
                raise Refused("it has sent a frame with a wrong seal")
            key, said = bytes(chunk[start + _HEAD.size : header]), bytes(chunk[header:value])
            start = end
            if not is_long:
                frames.append(Frame(kind, key, said, bytes(chunk[value:sealed])))
                continue
            here = chunk[end : min(filled, end + of_payload)]
            start += len(here)
            payload = memoryview(bytearray(of_payload))  # of its own, which nobody copies
            payload[: len(here)] = here
            long = Frame(kind, key, said, payload.toreadonly())
            if len(here) < of_payload:
                self._long, self._rest = long, payload[len(here) :]
                break
            frames.append(long)
        if start:
            self._chunk[: filled - start] = chunk[start:filled]
            self._filled = filled - start
        return frames
