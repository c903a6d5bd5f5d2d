"""Recordings that mean harm, or were harmed."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Final

import lz4.frame  # type: ignore[import-untyped]
import pytest
import zstandard

import hfg
from hfg.recording import mcap, record, writing
from hfg.recording.mcap import MAGIC
from tests.recording.conftest import build

__all__ = ["HOSTILE", "chunked", "hostile", "with_message"]


def of_record(opcode: int, *parts: bytes) -> bytes:
    """A record of the format."""
    return mcap._record(opcode, *parts)


def chunk(size: int, compression: str, packed: bytes, *, says: int | None = None, checksum: int = 0) -> bytes:
    """A chunk that says this of itself."""
    length = struct.pack("<Q", len(packed) if says is None else says)
    return of_record(6, struct.pack("<QQQI", 0, 1, size, checksum), mcap._text(compression), length, packed)


def message(channel: int, data: bytes, *, says: int | None = None) -> bytes:
    """A message, or what says that it is one."""
    fields = struct.pack("<HIQQ", channel, 1, 5, 5)
    return struct.pack("<BQ", 5, len(fields + data) if says is None else says) + fields + data


def _bomb(compression: str, size: int) -> bytes:
    """Zeros, packed."""
    zeros = bytes(2**20)
    if compression == "zstd":
        packing = zstandard.ZstdCompressor(level=3).compressobj()
        return b"".join([*(packing.compress(zeros) for _ in range(size >> 20)), packing.flush()])
    lz4s = lz4.frame.LZ4FrameCompressor()
    return b"".join([lz4s.begin(), *(lz4s.compress(zeros) for _ in range(size >> 20)), lz4s.flush()])


_HEAD: Final = (
    MAGIC
    + of_record(1, mcap._text(""), mcap._text("x"))
    + of_record(3, struct.pack("<H", 1), mcap._text("s"), mcap._text("jsonschema"), mcap._blob(b"{}"))
    + of_record(4, struct.pack("<HH", 1, 1), mcap._text("a.out"), mcap._text("json"), mcap._texts({}))
)
_TAIL: Final = of_record(15, struct.pack("<I", 0)) + of_record(2, struct.pack("<QQI", 0, 0, 0)) + MAGIC
_VALUE: Final = b'{"value": 1, "activity": 0, "stamp": 0.0, "sequence": 1}'

HOSTILE: Final[dict[str, tuple[Callable[[], bytes], str]]] = {
    "would unpack to gigabytes": (lambda: chunk(6 * 2**30, "zstd", _bomb("zstd", 2**28)), "HFG_MOST_CHUNK"),
    "zstd that unpacks to more than it says": (
        lambda: chunk(1000, "zstd", _bomb("zstd", 2**28)),
        "more than the 1,000",
    ),
    "lz4 that unpacks to more than it says": (lambda: chunk(1000, "lz4", _bomb("lz4", 2**28)), "more than the 1,000"),
    "lz4 that says it is huge": (lambda: chunk(2**62, "lz4", lz4.frame.compress(b"hello")), "HFG_MOST_CHUNK"),
    "lz4 that is none": (lambda: chunk(40, "lz4", b"hello"), "it unpacks to 0 bytes"),
    "zstd that is none": (lambda: chunk(40, "zstd", b"hello"), "cannot be unpacked"),
    "zstd whose frame says that it is huge": (
        lambda: chunk(40, "zstd", b"\x28\xb5\x2f\xfd\xe0" + struct.pack("<Q", 2**50) + b"\x01\0\0"),
        "cannot be unpacked|unpacks to",
    ),
    "an unknown way to pack": (lambda: chunk(40, "rar", b"hello"), 'packed as "rar"'),
    "a name that is longer than the file": (
        lambda: of_record(6, struct.pack("<QQQII", 0, 1, 5, 0, 2**32 - 1), b"lz4"),
        "no name",
    ),
    "a packed length that lies": (lambda: chunk(5, "", b"hello", says=2**63), "but it has 5"),
    "a record longer than its chunk": (lambda: chunk(40, "", message(1, b"", says=2**40) + bytes(9)), "there are 31"),
    "a record of negative length": (lambda: chunk(31, "", message(1, b"", says=2**64 - 9)), "there are 22"),
    "a message shorter than its head": (lambda: chunk(18, "", struct.pack("<BQ", 5, 9) + bytes(9)), "too short"),
    "a chunk longer than the file": (lambda: struct.pack("<BQ", 6, 2**63) + b"x" * 10, "which are not there"),
    "a channel whose text is longer than it": (
        lambda: of_record(4, struct.pack("<HHI", 2, 1, 2**32 - 1), b"zz"),
        "a length in it is wrong",
    ),
    "metadata whose map never ends": (
        lambda: of_record(12, mcap._text("hfg"), struct.pack("<I", 2**32 - 1)),
        "cannot be read",
    ),
    "an attachment longer than the file": (lambda: struct.pack("<BQ", 9, 2**50) + bytes(40), "which are not there"),
    "a wrong checksum": (lambda: chunk(5, "", b"hello", checksum=7), "checksum"),
    "a message of a channel that nobody declared": (
        lambda: chunk(len(message(9, _VALUE)), "", message(9, _VALUE)),
        "descriptions of some ports",
    ),
}
"""What stands between the head and the tail of a file, and what is said of it."""


def hostile(name: str) -> bytes:
    """Give such a file; one good message stands before what is wrong."""
    good = message(1, _VALUE)
    return _HEAD + chunk(len(good), "", good) + HOSTILE[name][0]() + chunk(len(good), "", good) + _TAIL


def with_message(data: bytes) -> bytes:
    """A file that holds one message."""
    one = message(1, data)
    return _HEAD + chunk(len(one), "", one) + _TAIL


def chunked(file: Path, count: int = 40) -> bytes:
    """Record a run into a file of several small chunks."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(writing, "_CHUNK_MESSAGES", 10)
        patch.setattr(writing, "_BATCH", 10)
        hfg.run(build(count), clock="virtual", begin=lambda run: record(run, file, force=True))
    return file.read_bytes()
