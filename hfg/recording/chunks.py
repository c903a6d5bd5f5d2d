"""Unpacks a chunk of an MCAP file within bounds, and finds the messages in it (rule L4).

A chunk states its own length, packed and unpacked, and each record in it states its length. These lengths are not
trusted: a mismatch raises `Damaged` before memory is allocated for it. Depends on bounds, lz4 and zstandard.
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

from hfg.base.bounds import CHUNK_BYTES, CHUNK_MESSAGES, RECORDING_RATIO

HEAD: Final = struct.Struct("<BQ")
"""The head of each record: its kind and its length."""
SCHEMA, CHANNEL, MESSAGE, CHUNK = 3, 4, 5, 6

_MESSAGE: Final = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_BEFORE: Final = struct.Struct("<QQQII")  # times, size and checksum unpacked, length of the compression's name
_BLOCK: Final = 2**20
_ALWAYS_BYTES: Final = 4 * 2**30
_MESSAGE_BYTES: Final = 512  # that take as long to unpack as a message takes to be looked at


class Damaged(Exception):
    """Part of a file contradicts its own description."""


class ChunkHead(NamedTuple):
    """The head of a chunk.

    Attributes:
      first: time of its first message, in nanoseconds.
      last: time of its last message.
      size: size of the unpacked data.
      checksum: checksum of the unpacked data; 0: none.
      compression: name of the compression.
      begin: offset of the packed data in the record.
    """

    first: int
    last: int
    size: int
    checksum: int
    compression: str
    begin: int


def chunk_head(data: bytes, length: int) -> ChunkHead:
    """Read the head of a chunk.

    Args:
      data: the start of its record, at least 60 bytes or all of it.
      length: length of the whole record.

    Raises:
      Damaged: it is not a chunk, or its head is impossible.
    """
    try:
        first, last, size, checksum, letters = _BEFORE.unpack_from(data)
        at = _BEFORE.size + letters
        if letters > 8:
            raise Damaged("its compression has no name")
        compression = data[_BEFORE.size : at].decode("ascii")
        (packed,) = struct.unpack_from("<Q", data, at)
    except (struct.error, UnicodeDecodeError):
        raise Damaged("it does not start like a chunk") from None
    if packed != length - at - 8:
        raise Damaged(f"its head states {packed:,} bytes, but it has {length - at - 8:,}")
    return ChunkHead(first, last, size, checksum, compression, at + 8)


def unpacked(record: bytes) -> bytes:
    """Return the unpacked data of a chunk. It uses no more memory than `CHUNK_BYTES`, nor than the size in its head.

    Raises:
      Damaged: it cannot be unpacked, or exceeds the size in its head or the limit.
    """
    head = chunk_head(record, len(record))
    if head.size > CHUNK_BYTES.most:
        raise Damaged(f"it would unpack to {head.size:,} bytes, {CHUNK_BYTES.remedy}")
    packed = memoryview(record)[head.begin :]
    match head.compression:
        case "":
            content = bytes(packed)
        case "lz4":
            content = _unlz4(packed, head.size)
        case "zstd":
            content = _unzstd(packed, head.size)
        case other:
            raise Damaged(f'it is packed as "{other}", but only lz4 and zstd are supported')
    if len(content) != head.size:
        more = "more than" if len(content) > head.size else f"{len(content):,} bytes, not"
        raise Damaged(f"it unpacks to {more} the {head.size:,} bytes in its head")
    if head.checksum and zlib.crc32(content) != head.checksum:
        raise Damaged("its checksum is wrong")
    return content


def _unlz4(packed: memoryview, size: int) -> bytes:
    try:
        unpacking = lz4.frame.LZ4FrameDecompressor()
        content: bytes = unpacking.decompress(packed, max_length=size + 1)
        return content
    except (RuntimeError, ValueError, EOFError, MemoryError) as error:
        raise Damaged(f"it cannot be unpacked ({error})") from None


def _unzstd(packed: memoryview, size: int) -> bytes:
    """Read it piece by piece; the size in its frame is ignored."""
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
    """The contents of a chunk.

    Attributes:
      data: the unpacked data.
      places: start and end of each message.
    """

    data: bytes
    places: array[int]

    def messages(self) -> Iterator[Message]:
        """Yield the messages. They are made on demand, so that many small ones fit into memory."""
        data, places = self.data, self.places
        for number in range(0, len(places), 2):
            begin, end = places[number], places[number + 1]
            channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(data, begin)
            yield Message(channel, sequence, log_time, publish_time, data[begin + _MESSAGE.size : end])


def content_of(data: bytes, declare: Callable[[int, bytes], None]) -> Content:
    """Find the records.

    Args:
      data: the unpacked data.
      declare: called with each schema and channel that is declared in it.

    Raises:
      Damaged: the lengths of the records do not add up to the length of the chunk, or it has more messages than
        `CHUNK_MESSAGES`: a few kilobytes may unpack to millions of empty ones, each of which takes time.
    """
    places = array("Q")
    most = 2 * CHUNK_MESSAGES.most
    at, end = 0, len(data)
    while at < end:
        if at + HEAD.size > end:
            raise Damaged("a record in it is incomplete")
        opcode, length = HEAD.unpack_from(data, at)
        begin = at + HEAD.size
        at = begin + length
        if at > end:
            raise Damaged(f"a record in it states {length:,} bytes, but there are {end - begin:,}")
        if opcode == MESSAGE:
            if length < _MESSAGE.size:
                raise Damaged("a message in it is too short")
            if len(places) >= most:
                raise Damaged(f"it has more than {most // 2:,} messages, {CHUNK_MESSAGES.remedy}")
            places.extend((begin, at))
        elif opcode in (SCHEMA, CHANNEL):
            declare(opcode, data[begin:at])
    return Content(data, places)


class Budget:
    """What all chunks of a file may cost together: each may be within its limits, and there may be thousands.

    Args:
      size: bytes of the file.
    """

    def __init__(self, size: int) -> None:
        self._size = size
        self._spent: dict[int, int] = {}  # by number of the chunk
        self._sum = 0

    def spend(self, number: int, unpacked: int, messages: int = 0) -> None:
        """Count a chunk, however often it is read.

        Args:
          number: its place in the file.
          unpacked: its bytes.
          messages: how many are in it, if that is known.

        Raises:
          Damaged: it would cost more than is left.
        """
        before = self._spent.get(number, 0)
        more = unpacked + _MESSAGE_BYTES * messages - before
        if more <= 0:
            return
        if self._sum + more > _ALWAYS_BYTES + RECORDING_RATIO.most * self._size:
            raise Damaged(
                f"the chunks together unpack to more than {_ALWAYS_BYTES:,} bytes, each message counted as "
                f"{_MESSAGE_BYTES} more; beyond that, for each byte of the file {RECORDING_RATIO.remedy}"
            )
        self._spent[number] = before + more
        self._sum += more
