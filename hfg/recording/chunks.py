"""Unpacks a chunk of an MCAP file within bounds, and finds the messages in it (rule L4).

A chunk says itself how long it is, packed and unpacked, and each record in it how long that one is. None of this is
believed: whatever does not fit is `Damaged`, before memory is spent on it. Stands on bounds, lz4 and zstandard.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from collections.abc import Callable, Iterator
from io import BytesIO
from typing import Final, NamedTuple

import lz4.frame  # type: ignore[import-untyped]
import zstandard

from hfg.base.bounds import CHUNK_BYTES

__all__ = [
    "CHANNEL",
    "CHUNK",
    "HEAD",
    "MESSAGE",
    "SCHEMA",
    "ChunkHead",
    "Content",
    "Damaged",
    "Message",
    "chunk_head",
    "content_of",
    "unpacked",
]

HEAD: Final = struct.Struct("<BQ")
"""What stands before each record: what it is, and its length."""
SCHEMA, CHANNEL, MESSAGE, CHUNK = 3, 4, 5, 6

_MESSAGE: Final = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_BEFORE: Final = struct.Struct("<QQQII")  # times, size and checksum unpacked, length of the compression's name
_BLOCK: Final = 2**20


class Damaged(Exception):
    """Something in a file is not what it says."""


class ChunkHead(NamedTuple):
    """What a chunk says of itself.

    Attributes:
      first: time of its first message, in nanoseconds.
      last: of its last.
      size: unpacked.
      checksum: of what is unpacked; 0: none.
      compression: its name.
      begin: where what is packed begins in the record.
    """

    first: int
    last: int
    size: int
    checksum: int
    compression: str
    begin: int


def chunk_head(data: bytes, length: int) -> ChunkHead:
    """Read what a chunk says of itself.

    Args:
      data: the beginning of its record, 60 bytes or all.
      length: of the whole record.

    Raises:
      Damaged: it is no chunk, or says what cannot be.
    """
    try:
        first, last, size, checksum, letters = _BEFORE.unpack_from(data)
        at = _BEFORE.size + letters
        if letters > 8:
            raise Damaged("it names no way to unpack it")
        compression = data[_BEFORE.size : at].decode("ascii")
        (packed,) = struct.unpack_from("<Q", data, at)
    except (struct.error, UnicodeDecodeError):
        raise Damaged("its first bytes are none of a chunk") from None
    if packed != length - at - 8:
        raise Damaged(f"it says that {packed:,} bytes are in it, but {length - at - 8:,} are")
    return ChunkHead(first, last, size, checksum, compression, at + 8)


def unpacked(record: bytes) -> bytes:
    """Give what a chunk holds; no more memory is spent than `CHUNK_BYTES`, and what it says of its size.

    Raises:
      Damaged: it cannot be unpacked, or is more than it says or than the limit.
    """
    head = chunk_head(record, len(record))
    if head.size > CHUNK_BYTES.most:
        raise Damaged(f"it says that it unpacks to {head.size:,} bytes, {CHUNK_BYTES.remedy}")
    packed = memoryview(record)[head.begin :]
    match head.compression:
        case "":
            content = bytes(packed)
        case "lz4":
            content = _unlz4(packed, head.size)
        case "zstd":
            content = _unzstd(packed, head.size)
        case other:
            raise Damaged(f'it is packed as "{other}", and only lz4 and zstd are known')
    if len(content) != head.size:
        more = "more than" if len(content) > head.size else f"{len(content):,} bytes, not"
        raise Damaged(f"it unpacks to {more} the {head.size:,} bytes that it says")
    if head.checksum and zlib.crc32(content) != head.checksum:
        raise Damaged("its checksum is another")
    return content


def _unlz4(packed: memoryview, size: int) -> bytes:
    try:
        unpacking = lz4.frame.LZ4FrameDecompressor()
        content: bytes = unpacking.decompress(packed, max_length=size + 1)
        return content
    except (RuntimeError, ValueError, EOFError, MemoryError) as error:
        raise Damaged(f"it cannot be unpacked ({error})") from None


def _unzstd(packed: memoryview, size: int) -> bytes:
    """Read it piece by piece: what its frame says of its size is not asked."""
    window = 1 << max(20, CHUNK_BYTES.most.bit_length())
    parts: list[bytes] = []
    left = size + 1
    try:
        unpacking = zstandard.ZstdDecompressor(max_window_size=min(window, 2**31))
        with unpacking.stream_reader(BytesIO(packed), read_across_frames=True) as stream:
            while left > 0 and (part := stream.read(min(_BLOCK, left))):
                parts.append(part)
                left -= len(part)
    except (zstandard.ZstdError, MemoryError) as error:
        raise Damaged(f"it cannot be unpacked ({error})") from None
    return b"".join(parts)


class Message(NamedTuple):
    """One message: its channel, number, times in nanoseconds, and bytes."""

    channel: int
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


class Content(NamedTuple):
    """What is in a chunk.

    Attributes:
      data: unpacked.
      places: where each message begins, and where it ends.
    """

    data: bytes
    places: array[int]

    def messages(self) -> Iterator[Message]:
        """Go through the messages; they are made as they are asked for, so that many small ones fit into memory."""
        data, places = self.data, self.places
        for number in range(0, len(places), 2):
            begin, end = places[number], places[number + 1]
            channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(data, begin)
            yield Message(channel, sequence, log_time, publish_time, data[begin + _MESSAGE.size : end])


def content_of(data: bytes, declare: Callable[[int, bytes], None]) -> Content:
    """Find the records.

    Args:
      data: unpacked.
      declare: is given each schema and channel that is declared in it.

    Raises:
      Damaged: the lengths that they say do not add up to its own.
    """
    places = array("Q")
    at, end = 0, len(data)
    while at < end:
        if at + HEAD.size > end:
            raise Damaged("a record in it is not whole")
        opcode, length = HEAD.unpack_from(data, at)
        begin = at + HEAD.size
        at = begin + length
        if at > end:
            raise Damaged(f"a record in it says that it has {length:,} bytes, and there are {end - begin:,}")
        if opcode == MESSAGE:
            if length < _MESSAGE.size:
                raise Damaged("a message in it is too short")
            places.extend((begin, at))
        elif opcode in (SCHEMA, CHANNEL):
            declare(opcode, data[begin:at])
    return Content(data, places)
