"""The studio of a run for other programs of the same user, through the run's local socket (rule L5).

A message is a line of JSON; a binary frame follows a line with "!" and its length. Depends on `studio`.
"""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any, Final

from hfg.base.logs import Log
from hfg.errors import UsageError
from hfg.studio.messages import LONGEST, read
from hfg.studio.project import Project
from hfg.studio.studio import Studio
from hfg.studio.viewing import Frame

__all__ = ["FrameReader", "framed", "visit"]

_LOGGER: Final = Log("hfg.studio")
_MOST_BYTES: Final = 8 << 20


def framed(data: bytes, *, is_binary: bool) -> bytes:
    """Return a frame as it goes over the socket."""
    return b"!%d\n%b" % (len(data), data) if is_binary else data + b"\n"


class FrameReader:
    """Takes frames out of the bytes of a socket, as they come."""

    def __init__(self) -> None:
        self._bytes = bytearray()
        self._binary = -1

    def feed(self, data: bytes) -> list[tuple[bytes, bool]]:
        """Return the frames that are complete now, and whether each is binary.

        Raises:
          UsageError: a frame is longer than the protocol allows, or its length is not a number.
        """
        self._bytes += data
        found: list[tuple[bytes, bool]] = []
        while True:
            if self._binary >= 0:
                if len(self._bytes) < self._binary:
                    break
                found.append((bytes(self._bytes[: self._binary]), True))
                del self._bytes[: self._binary]
                self._binary = -1
                continue
            end = self._bytes.find(b"\n")
            if end < 0:
                break
            line = bytes(self._bytes[:end])
            del self._bytes[: end + 1]
            if line.startswith(b"!"):
                self._binary = _length(line)
            else:
                found.append((line, False))
        if len(self._bytes) > 2 * _MOST_BYTES:
            raise UsageError(f"a frame has {2 * _MOST_BYTES} bytes at most")
        return found


def _length(line: bytes) -> int:
    if not line[1:].isdigit() or len(line) > 12 or int(line[1:]) > 2 * _MOST_BYTES:
        raise UsageError(f"a binary frame begins with its length, got {line[:20]!r}")
    return int(line[1:])


class _SocketOutbox:
    """Frames to one program."""

    def __init__(self, transport: asyncio.Transport) -> None:
        self._transport = transport

    def put(self, frame: Frame) -> None:
        data = frame.data() if callable(frame.data) else frame.data
        if self._transport.get_write_buffer_size() > _MOST_BYTES:
            self._transport.abort()  # it takes nothing
            return
        self._transport.write(framed(data, is_binary=frame.is_binary))

    def close(self, code: int, reason: str) -> None:
        self._transport.close()


class _Visit:
    """One program."""

    def __init__(self, studio: Studio, transport: asyncio.Transport) -> None:
        self._studio = studio
        self._transport = transport
        self._viewer = studio.enter(_SocketOutbox(transport))
        self._asked = bytearray()

    def data_received(self, data: bytes) -> None:
        """Take what it says."""
        self._asked += data
        *lines, self._asked = self._asked.split(b"\n")
        try:
            if len(self._asked) > LONGEST:
                raise UsageError(f"a message has {LONGEST} bytes at most")
            for line in lines:
                self._studio.receive(self._viewer, read(bytes(line)))
        except UsageError as error:
            _LOGGER.info("a program that steers the run is sent away: %s", error)
            self._transport.abort()

    def leave(self) -> None:
        """It is gone."""
        self._studio.leave(self._viewer)


def visit(door: Any, transport: asyncio.Transport) -> _Visit:
    """Let a program steer the run of a door; all such programs share one studio."""
    if door.studio is None:
        graph = door.run.graph
        door.studio = Studio(Project(graph, Path.cwd(), keep=False), run=door.run)
    return _Visit(door.studio, transport)
