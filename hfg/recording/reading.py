"""Reading recordings, also those that were cut off: chunk by chunk, so that no file is too long.

A file that its writer has not finished has no summary; it is read up to the last chunk that is whole. Stands on the
package `mcap` for the format's records.
"""

from __future__ import annotations

import os
import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, Final

import msgspec
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, Metadata, Schema
from mcap.stream_reader import get_chunk_data_stream

from hfg.errors import UsageError
from hfg.recording.mcap import MAGIC
from hfg.recording.messages import EVENTS, MARKERS

__all__ = ["File", "PortInfo", "RawMessage", "RecordingInfo"]

_HEAD: Final = struct.Struct("<BQ")
_MESSAGE: Final = struct.Struct("<HIQQ")
_KEPT_CHUNKS: Final = 8
_LONGEST: Final = 4 * 2**30

RawMessage = tuple[int, int, bytes]
"""Channel, nanoseconds, data."""


class PortInfo(msgspec.Struct):
    """What is known of one recorded port.

    Attributes:
      path: of the port; of a file that hfg did not write, the topic.
      kind: "output", "event", ...
      type: of its values, in words.
      schema: the name of the schema of its messages.
      values: how many were recorded, without markers.
      rate_hz: of these, on the average.
    """

    path: str
    kind: str
    type: str
    schema: str
    values: int
    rate_hz: float


class RecordingInfo(msgspec.Struct):
    """What is known of a recording.

    Attributes:
      whole: its writer has finished it; else it was cut off, and ends with its last whole chunk.
      graph: the name of the graph; empty if hfg did not write it.
      clock: "real" or "virtual".
      began: of the run, on its clock.
      duration_s: from the first token to the last.
      outcome: of the run; empty if it is not known.
      markers: how many.
      left_out: tokens that there was no time for, by port.
      refused: values that are no data, by port.
      held_s: how long nodes waited for the recording.
      commands: the graph itself, as commands that make it (`hfg.commands.decode`).
    """

    path: str
    bytes: int
    whole: bool
    library: str
    graph: str
    clock: str
    began: float
    duration_s: float
    outcome: str
    chunks: int
    messages: int
    markers: int
    held_s: float
    left_out: dict[str, int]
    refused: dict[str, int]
    ports: list[PortInfo]
    commands: str


class File:
    """An MCAP file.

    Attributes:
      path: where it is.
      whole: whether its writer has finished it.
      channels: by number.
      schemas: by number.
      metadata: by name; of several of one name the last.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Open it.

        Raises:
          UsageError: there is no such file, or it is no MCAP file.
        """
        self.path = Path(path)
        self.whole = False
        self.library = ""
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self.metadata: dict[str, Mapping[str, str]] = {}
        self._chunks: list[tuple[int, int]] = []  # where each lies, and how long it is
        try:
            self._stream: BinaryIO = self.path.open("rb")
        except OSError as error:
            raise UsageError(f"the recording {path} cannot be opened: {error.strerror}") from None
        try:
            if self._stream.read(len(MAGIC)) != MAGIC:
                raise UsageError(f"{path} is no MCAP file: hfg record writes them, and so do many other programs")
            self._scan()
        except BaseException:
            self._stream.close()
            raise
        self._read_chunk = lru_cache(_KEPT_CHUNKS)(self._read_chunk_now)

    def close(self) -> None:
        """Read no more."""
        self._stream.close()

    def __enter__(self) -> File:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def messages(self, channels: frozenset[int] | None = None) -> Iterator[RawMessage]:
        """Go through all messages, or those of some channels, in the order in which they were written."""
        for number in range(len(self._chunks)):
            for message in self._read_chunk(number):
                if channels is None or message[0] in channels:
                    yield message

    def numbers_of(self, topic: str) -> frozenset[int]:
        """Give the channels of one topic."""
        return frozenset(number for number, one in self.channels.items() if one.topic == topic)

    def began(self) -> float:
        """When its graph began to move, on its clock; when the recording did if that was later."""
        for _, _, data in self.messages(self.numbers_of(EVENTS)):
            event = msgspec.json.decode(data)
            if event.get("type") == "RunStarted":
                return float(event["time"])
            break
        return float(self.metadata.get("hfg", {}).get("began", 0.0))

    def info(self) -> RecordingInfo:
        """Say what is known of it; all messages are counted."""
        counts: Counter[int] = Counter()
        first = last = None
        for number in range(len(self._chunks)):
            for channel, when, _ in self._read_chunk(number):
                counts[channel] += 1
                first = when if first is None else min(first, when)
                last = when if last is None else max(last, when)
        duration = ((last or 0) - (first or 0)) / 1e9
        about, ended = self.metadata.get("hfg", {}), self.metadata.get("hfg:end", {})
        return RecordingInfo(
            path=str(self.path),
            bytes=self.path.stat().st_size,
            whole=self.whole,
            library=self.library,
            graph=about.get("graph", ""),
            clock=about.get("clock", ""),
            began=self.began() if about else (first or 0) / 1e9,
            duration_s=duration,
            outcome=ended.get("outcome", ""),
            chunks=len(self._chunks),
            messages=sum(counts.values()),
            markers=sum(counts[number] for number, one in self.channels.items() if one.topic == MARKERS),
            held_s=float(ended.get("held_s", 0.0)),
            left_out=msgspec.json.decode(ended.get("left_out", "{}")),
            refused=msgspec.json.decode(ended.get("refused", "{}")),
            ports=[
                self._port(number, counts[number], duration)
                for number, one in self.channels.items()
                if one.topic not in (MARKERS, EVENTS)
            ],
            commands=about.get("commands", ""),
        )

    def _port(self, number: int, count: int, duration: float) -> PortInfo:
        channel = self.channels[number]
        schema = self.schemas.get(channel.schema_id)
        about = channel.metadata
        rate = count / duration if duration else 0.0
        name = schema.name if schema is not None else ""
        return PortInfo(channel.topic, about.get("kind", ""), about.get("type", ""), name, count, rate)

    # --- the format ---------------------------------------------------------------------------------------------------

    def _scan(self) -> None:
        """Find where everything lies; what is not whole at the end does not count."""
        stream, size = self._stream, self.path.stat().st_size
        at = len(MAGIC)
        while at + _HEAD.size <= size:
            stream.seek(at)
            opcode, length = _HEAD.unpack(stream.read(_HEAD.size))
            begin, at = at + _HEAD.size, at + _HEAD.size + length
            if at > size or length > _LONGEST:
                break
            if opcode == Opcode.CHUNK:
                self._chunks.append((begin, length))
            elif opcode in _DECLARE:
                self._declare(opcode, stream.read(length))
            elif opcode == Opcode.FOOTER:
                self.whole = stream.read(len(MAGIC) + length)[length:] == MAGIC
                break
        if not self.whole:
            self._use_whole_chunks()

    def _use_whole_chunks(self) -> None:
        """Without a summary, what chunks say themselves is to be read; behind the first that is damaged nothing is."""
        for number in range(len(self._chunks)):
            try:
                self._read_chunk_now(number)
            except Exception:  # whatever its bytes do to whom
                del self._chunks[number:]
                return

    def _declare(self, opcode: int, data: bytes) -> None:
        stream = ReadDataStream(BytesIO(data))
        try:
            if opcode == Opcode.HEADER:
                self.library = Header.read(stream).library
            elif opcode == Opcode.SCHEMA:
                schema = Schema.read(stream)
                self.schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                channel = Channel.read(stream)
                self.channels[channel.id] = channel
            else:
                found = Metadata.read(stream)
                self.metadata[found.name] = found.metadata
        except Exception as error:  # the package raises what its bytes lead it to
            raise UsageError(f"{self.path} is damaged: a record in it cannot be read ({error})") from None

    def _read_chunk_now(self, number: int) -> list[RawMessage]:
        begin, length = self._chunks[number]
        self._stream.seek(begin)
        chunk = Chunk.read(ReadDataStream(BytesIO(self._stream.read(length))))
        try:
            stream, _ = get_chunk_data_stream(chunk, validate_crc=True)
        except Exception as error:
            if not self.whole:
                raise
            raise UsageError(f"{self.path} is damaged: chunk {number + 1} cannot be read ({error})") from None
        content = stream._stream.getvalue()  # type: ignore[attr-defined]  # faster than record by record
        found: list[RawMessage] = []
        at, end = 0, len(content)
        while at < end:
            opcode, size = _HEAD.unpack_from(content, at)
            at += _HEAD.size
            if opcode == Opcode.MESSAGE:
                channel, _, when, _ = _MESSAGE.unpack_from(content, at)
                found.append((channel, when, content[at + _MESSAGE.size : at + size]))
            elif opcode in _DECLARE:
                self._declare(opcode, content[at : at + size])
            at += size
        return found


_DECLARE: Final = frozenset({Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA})
