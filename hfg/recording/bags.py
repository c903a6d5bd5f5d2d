"""Bags of ROS 2 as recordings: a folder with MCAP or SQLite files, or one of its files.

One MCAP file is read as it is. Several files, and databases, are copied into one temporary MCAP file when the bag is
opened for the first time, so that all readers have one format; see https://github.com/ros2/rosbag2. Depends on `mcap`.
"""

from __future__ import annotations

import io
import os
import re
import sqlite3
import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

import msgspec
import numpy as np

from hfg.base.bounds import CHUNK_BYTES
from hfg.errors import UsageError
from hfg.recording.mcap import Writer

RECOVERED: Final = "hfg:recovered"
"""The metadata in which a file lists what its source had lost."""

_CHUNK: Final = 4 * 2**20
_MOST_KEPT: Final = 4
_MOST_FILES: Final = 10_000
_TABLES: Final = ("topics", "messages", "message_definitions")
_MESSAGES: Final = "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp, id"
_DEFINITIONS: Final = (
    "SELECT topic_type, encoded_message_definition FROM message_definitions WHERE encoding = 'ros2msg'"
)
_copies: dict[tuple[Any, ...], Any] = {}


class _Message(NamedTuple):
    topic: str
    type: str
    definition: str
    encoding: str
    when: int
    data: bytes


def opened(path: Path, read: Callable[[Path], Any]) -> BinaryIO:
    """Open a recording, as an MCAP file.

    Args:
      path: the file, or the folder of a bag.
      read: opens an MCAP file as a `File`.

    Raises:
      OSError: it cannot be read.
      UsageError: the folder is not a bag, or its files are compressed.
    """
    files = _files(path) if path.is_dir() else [path]
    if len(files) == 1 and files[0].suffix != ".db3":
        return files[0].open("rb")
    key = tuple((str(one.resolve()), one.stat().st_mtime_ns, one.stat().st_size) for one in files)
    if key not in _copies:
        while len(_copies) >= _MOST_KEPT:
            _copies.pop(next(iter(_copies))).close()
        _copies[key] = _copied(files, read)
    return io.BufferedReader(_View(_copies[key].fileno()))


def _files(folder: Path) -> list[Path]:
    """Return the files of a bag in the order in which they were written: their names end in numbers."""
    known = [one for one in folder.iterdir() if one.suffix in (".mcap", ".db3", ".zstd")][: _MOST_FILES + 1]
    if any(one.suffix == ".zstd" for one in known):
        raise UsageError(f"the files in {folder} are compressed as a whole: unpack them first, as in unzstd FILE")
    bases = {re.sub(r"(_\d+)?\.\w+$", "", one.name) for one in known}
    if len(bases) > 1 and not (folder / "metadata.yaml").exists():
        raise UsageError(f"{folder} is not a bag of ROS 2: its files belong to several; name one of the files")
    if not known or len(known) > _MOST_FILES:
        raise UsageError(f"{folder} is not a bag of ROS 2: it has {len(known):,} files .mcap or .db3")
    return sorted(known, key=lambda one: [(len(part), part) for part in re.split(r"(\d+)", one.name)])


def _copied(files: list[Path], read: Callable[[Path], Any]) -> Any:
    into: Any = tempfile.TemporaryFile()  # noqa: SIM115 - kept open; it has no name, so nothing remains of it
    try:
        losses: list[dict[str, Any]] = []
        writer = Writer(into, library="rosbag2", profile="ros2")
        copy = _Copy(writer)
        for file in files:
            for one in _rows(file, losses) if file.suffix == ".db3" else _records(read(file), losses):
                copy.add(one)
        writer.end_chunk()
        if losses:
            writer.add_metadata(RECOVERED, {"losses": msgspec.json.encode(losses).decode()})
        writer.finish()
        into.flush()
    except BaseException:
        into.close()
        raise
    return into


class _View(io.RawIOBase):
    """A file that is read from a place of its own."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = os.dup(descriptor)
        self._at = 0

    def fileno(self) -> int:
        return self._descriptor

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        begin = (0, self._at, os.fstat(self._descriptor).st_size)[whence]
        self._at = begin + offset
        return self._at

    def readinto(self, buffer: Any) -> int:
        data = os.pread(self._descriptor, len(buffer), self._at)
        buffer[: len(data)] = data
        self._at += len(data)
        return len(data)

    def close(self) -> None:
        if not self.closed:
            os.close(self._descriptor)
        super().close()


class _Copy:
    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._schemas: dict[tuple[str, str], int] = {}
        self._channels: dict[tuple[str, str], int] = {}

    def add(self, one: _Message) -> None:
        channel = self._channels.get((one.topic, one.type))
        if channel is None:
            key = one.type, one.definition
            if key not in self._schemas:
                self._schemas[key] = self._writer.add_schema(one.type, "ros2msg", one.definition.encode())
            channel = self._writer.add_channel(one.topic, self._schemas[key], one.encoding, {})
            self._channels[one.topic, one.type] = channel
        when = np.array([one.when], np.uint64)
        self._writer.add_messages([channel], [0], when, when, [one.data])
        if self._writer.chunk_bytes >= _CHUNK:
            self._writer.end_chunk()


def _records(file: Any, losses: list[dict[str, Any]]) -> Iterator[_Message]:
    with file as recording:
        for number, when, data in recording.messages():
            channel = recording.channels[number]
            schema = recording.schemas.get(channel.schema_id)
            name, text = ("", b"") if schema is None else (schema.name, schema.data)
            yield _Message(channel.topic, name, text.decode("utf-8", "replace"), channel.message_encoding, when, data)
        losses += [msgspec.to_builtins(loss) for loss in recording.losses_met()]


def _rows(file: Path, losses: list[dict[str, Any]]) -> Iterator[_Message]:
    """Yield the messages of a database, in the order of time; a damaged part ends them and becomes a loss."""
    last = None
    try:
        with closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro&immutable=1", uri=True)) as base:
            base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(CHUNK_BYTES.most, 2**31 - 1))
            topics = _topics(base, file)
            for topic, when, data in base.execute(_MESSAGES):
                if topic in topics and isinstance(data, bytes) and isinstance(when, int) and when >= 0:
                    yield _Message(*topics[topic], when, data)
                    last = when / 1e9
                else:
                    losses.append({"what": f"a message in {file.name} has no topic, time or data", "messages": 1})
    except (sqlite3.Error, OverflowError, UnicodeDecodeError) as error:
        if last is None:
            raise UsageError(f"{file} is not a bag of ROS 2: {error}") from None
        losses.append({"what": f"{file.name} cannot be read after {last:.3f} s: {error}", "messages": None})


def _topics(base: sqlite3.Connection, file: Path) -> dict[int, tuple[str, str, str, str]]:
    """Return name, type, definition and encoding of each topic."""
    kinds = dict(base.execute("SELECT name, type FROM sqlite_master WHERE name IN (?, ?, ?)", _TABLES))
    if any(kinds.get(name) != "table" for name in _TABLES[:2]) or kinds.get(_TABLES[2], "table") != "table":
        raise UsageError(f"{file} is not a bag of ROS 2: it has no tables of topics and messages")
    texts: dict[str, str] = {}
    if _TABLES[2] in kinds:
        found = base.execute(_DEFINITIONS)
        texts = {str(name): str(text) for name, text in found}
    rows = base.execute("SELECT id, name, type, serialization_format FROM topics")
    return {int(key): (str(name), str(kind), texts.get(kind, ""), str(how)) for key, name, kind, how in rows}
