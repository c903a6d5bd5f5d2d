"""Writes MCAP files in batches: chunked, compressed, indexed, with a summary, and readable up to the last chunk.

The package `mcap` writes one message per call, which costs more time than most graphs spend per token; here a batch of
encoded messages becomes a chunk in a few calls. The output follows the format's specification (https://mcap.dev/spec).
Each chunk is passed to the system as soon as it is complete, so a file that was cut off can be read up to there. Does
not depend on hfg.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, BinaryIO, Final, NamedTuple, TypeAlias

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import numpy.typing as npt

Array: TypeAlias = npt.NDArray[Any]

MAGIC: Final = b"\x89MCAP0\r\n"

_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX, _CHUNK_INDEX = 1, 2, 3, 4, 5, 6, 7, 8
_STATISTICS, _METADATA, _METADATA_INDEX, _SUMMARY_OFFSET, _DATA_END = 11, 12, 13, 14, 15

_MESSAGE_FIELDS: Final = 22  # bytes of a message's record before its data
_U32: Final = 0xFFFFFFFF
_WORTH_COMPRESSING: Final = 0.9


_HEAD: Final = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)
"""The head of a message, before its data."""

_HEAD_BYTES: Final = f"V{_HEAD.itemsize}"  # all heads as bytes, in one call


class _ChunkIndex(NamedTuple):
    start_time: int
    end_time: int
    offset: int
    length: int
    indexes: dict[int, int]
    indexes_length: int
    compression: str
    compressed: int
    uncompressed: int


class Writer:
    """One file.

    Attributes:
      bytes_written: its length so far.
      chunk_bytes: size of the open chunk before compression.
      chunk_messages: number of messages in it.
    """

    def __init__(self, stream: BinaryIO, *, library: str, profile: str = "") -> None:
        self._stream = stream
        self._checksum = 0
        self.bytes_written = 0
        self.chunk_bytes = 0
        self.chunk_messages = 0
        self._contents: list[bytes] = []  # of the open chunk
        self._columns: list[tuple[Array, Array, Array]] = []  # its channels, times and lengths
        self._schemas: list[bytes] = []
        self._channels: list[bytes] = []
        self._new: list[bytes] = []  # schemas and channels that no chunk contains yet
        self._chunks: list[_ChunkIndex] = []
        self._metadata: list[tuple[int, int, str]] = []
        self._counts: dict[int, int] = {}
        self._times: tuple[int, int] | None = None
        self._write(MAGIC + _record(_HEADER, _text(profile), _text(library)))

    @property
    def chunks_written(self) -> int:
        """Number of chunks that were handed to the system completely."""
        return len(self._chunks)

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Declare a schema. Return its number, from 1."""
        number = len(self._schemas) + 1
        record = _record(_SCHEMA, struct.pack("<H", number), _text(name), _text(encoding), _blob(data))
        self._schemas.append(record)
        self._new.append(record)
        return number

    def add_channel(self, topic: str, schema: int, encoding: str, metadata: Mapping[str, str]) -> int:
        """Declare a channel. Return its number, from 1."""
        number = len(self._channels) + 1
        record = _record(_CHANNEL, struct.pack("<HH", number, schema), _text(topic), _text(encoding), _texts(metadata))
        self._channels.append(record)
        self._new.append(record)
        self._counts[number] = 0
        return number

    def add_metadata(self, name: str, metadata: Mapping[str, str]) -> None:
        """Write a record of metadata, and pass it to the system."""
        record = _record(_METADATA, _text(name), _texts(metadata))
        self._metadata.append((self.bytes_written, len(record), name))
        self._write(record)
        self._stream.flush()

    def add_messages(
        self,
        channels: Sequence[int],
        sequences: Sequence[int],
        log_times: Array,
        publish_times: Array,
        bodies: Sequence[bytes],
    ) -> None:
        """Put messages into the open chunk: columns, times in nanoseconds."""
        heads = np.empty(len(bodies), _HEAD)
        lengths = np.fromiter(map(len, bodies), np.int64, len(bodies))
        heads["opcode"] = _MESSAGE
        heads["length"] = lengths + _MESSAGE_FIELDS
        heads["channel"] = channels
        heads["sequence"] = np.bitwise_and(sequences, _U32)
        heads["log_time"] = log_times
        heads["publish_time"] = publish_times
        parts: list[bytes] = [b""] * (2 * len(bodies))
        parts[::2] = heads.view(_HEAD_BYTES).tolist()
        parts[1::2] = bodies
        content = b"".join(parts)
        self._contents.append(content)
        self._columns.append((heads["channel"], heads["log_time"], lengths + _HEAD.itemsize))
        self.chunk_bytes += len(content)
        self.chunk_messages += len(bodies)

    def end_chunk(self) -> None:
        """Write the open chunk, and pass it to the system."""
        if not self._columns:
            return
        declared = b"".join(self._new)
        self._new.clear()
        content = b"".join([declared, *self._contents])
        channels, times, lengths = (np.concatenate(column) for column in zip(*self._columns, strict=True))
        self._contents.clear()
        self._columns.clear()
        self.chunk_bytes = self.chunk_messages = 0
        offsets = len(declared) + np.cumsum(lengths) - lengths
        first, last = int(times.min()), int(times.max())
        compression, packed = _compressed(content)
        chunk = _record(
            _CHUNK,
            struct.pack("<QQQI", first, last, len(content), zlib.crc32(content)),
            _text(compression),
            struct.pack("<Q", len(packed)),
            packed,
        )
        begins = self.bytes_written
        at = begins + len(chunk)
        indexes, written = {}, []
        for channel, pairs in _by_channel(channels, times, offsets):
            record = _record(_MESSAGE_INDEX, struct.pack("<HI", channel, pairs.nbytes), pairs.tobytes())
            indexes[channel] = at
            at += len(record)
            written.append(record)
            self._counts[channel] += len(pairs)
        self._write(chunk + b"".join(written))
        self._stream.flush()
        length = sum(map(len, written))
        self._chunks.append(
            _ChunkIndex(first, last, begins, len(chunk), indexes, length, compression, len(packed), len(content))
        )
        self._times = (first, last) if self._times is None else (min(first, self._times[0]), max(last, self._times[1]))

    def finish(self) -> None:
        """Write the index for readers. The stream stays open."""
        if self._new:  # channels without messages
            self._write(b"".join(self._new))
            self._new.clear()
        self._write(_record(_DATA_END, struct.pack("<I", self._checksum)))
        start = self.bytes_written
        groups = (
            (_SCHEMA, self._schemas),
            (_CHANNEL, self._channels),
            (_STATISTICS, [self._statistics()]),
            (_CHUNK_INDEX, [_chunk_index(one) for one in self._chunks]),
            (
                _METADATA_INDEX,
                [
                    _record(_METADATA_INDEX, struct.pack("<QQ", at, length), _text(name))
                    for at, length, name in self._metadata
                ],
            ),
        )
        summary = bytearray()
        offsets = bytearray()
        for opcode, records in groups:
            if records:
                group = b"".join(records)
                offsets += _record(_SUMMARY_OFFSET, struct.pack("<BQQ", opcode, start + len(summary), len(group)))
                summary += group
        offsets_at = start + len(summary)
        summary += offsets
        head = struct.pack("<BQQQ", _FOOTER, 20, start, offsets_at)
        crc = zlib.crc32(head, zlib.crc32(summary))
        self._write(bytes(summary) + head + struct.pack("<I", crc) + MAGIC)
        self._stream.flush()

    def _statistics(self) -> bytes:
        first, last = self._times or (0, 0)
        counts = b"".join(struct.pack("<HQ", channel, count) for channel, count in self._counts.items() if count)
        return _record(
            _STATISTICS,
            struct.pack(
                "<QHIIIIQQ",
                sum(self._counts.values()),
                len(self._schemas),
                len(self._channels),
                0,
                len(self._metadata),
                len(self._chunks),
                first,
                last,
            ),
            _blob(counts),
        )

    def _write(self, data: bytes) -> None:
        self._stream.write(data)
        self._checksum = zlib.crc32(data, self._checksum)
        self.bytes_written += len(data)


def _by_channel(
    channels: npt.NDArray[Any], times: npt.NDArray[Any], offsets: npt.NDArray[Any]
) -> Iterator[tuple[int, npt.NDArray[np.uint64]]]:
    """Yield the channels of the messages of a chunk, each with the times and places of its messages, in order."""
    order = np.argsort(channels, kind="stable")
    pairs = np.empty((len(channels), 2), "<u8")
    pairs[:, 0], pairs[:, 1] = times[order], offsets[order]
    first = 0
    for channel, count in enumerate(np.bincount(channels).tolist()):
        if count:
            yield channel, pairs[first : first + count]
            first += count


def _compressed(content: bytes) -> tuple[str, bytes]:
    """Return the content compressed, unless it does not shrink, as pictures that are already compressed."""
    packed = lz4.frame.compress(content, store_size=True)
    if len(packed) < _WORTH_COMPRESSING * len(content):
        return "lz4", packed
    return "", content


def _chunk_index(chunk: _ChunkIndex) -> bytes:
    indexes = b"".join(struct.pack("<HQ", channel, at) for channel, at in chunk.indexes.items())
    return _record(
        _CHUNK_INDEX,
        struct.pack("<QQQQ", chunk.start_time, chunk.end_time, chunk.offset, chunk.length),
        _blob(indexes),
        struct.pack("<Q", chunk.indexes_length),
        _text(chunk.compression),
        struct.pack("<QQ", chunk.compressed, chunk.uncompressed),
    )


def _record(opcode: int, *parts: bytes) -> bytes:
    content = b"".join(parts)
    return struct.pack("<BQ", opcode, len(content)) + content


def _blob(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


def _text(text: str) -> bytes:
    return _blob(text.encode("utf-8", "replace"))


def _texts(items: Mapping[str, str] | Iterable[tuple[str, str]]) -> bytes:
    pairs: Any = items.items() if isinstance(items, Mapping) else items
    return _blob(b"".join(_text(key) + _text(value) for key, value in pairs))
