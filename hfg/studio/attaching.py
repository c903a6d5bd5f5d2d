"""The way from a page to a run in another process of this user: frames go through, unread. Depends on `local`."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from typing import Final

from hfg.base.logs import Log
from hfg.engine.face.watching import Question, run_sockets
from hfg.engine.observing.encoding import encode
from hfg.errors import TargetError, UsageError
from hfg.studio.local import FrameReader
from hfg.studio.messages import LONGEST, read
from hfg.studio.viewing import Frame
from hfg.studio.web import PageOutbox

__all__ = ["AttachedDoor", "connected_to"]

_LOGGER: Final = Log("hfg.studio")
_MOST_WAITING: Final = 2 * LONGEST


def connected_to(run: str) -> socket.socket:
    """Return a connection to the socket of a run.

    Raises:
      TargetError: no such run is there, or it is too busy.
    """
    with contextlib.closing(run_sockets()) as there:
        try:
            found = there.connect(run)
        except BlockingIOError:
            raise TargetError(f"process {run} does not answer: a node blocks its loop") from None
    if found is None:
        raise TargetError(f"the run in process {run} is over, or never was; hfg top shows those there are")
    return found


class _Visit:
    """One page, whose frames go to the run."""

    def __init__(self, writer: asyncio.StreamWriter, reading: asyncio.Task[None]) -> None:
        self._writer = writer
        self._reading = reading

    def say(self, data: str | bytes) -> None:
        read(data)  # a text that is not a message ends this page's connection, and not the run's
        if self._writer.transport.get_write_buffer_size() > _MOST_WAITING:
            raise UsageError("the run does not read what pages say")
        line = data.encode() if isinstance(data, str) else data
        self._writer.write(line.replace(b"\n", b" ") + b"\n")  # between two tokens, a line break is a space

    def leave(self) -> None:
        self._reading.cancel()
        self._writer.close()


class AttachedDoor:
    """Lets pages into the studio of a run in another process."""

    def __init__(self, run: str) -> None:
        self._run = run

    async def enter(self, outbox: PageOutbox) -> _Visit:
        """See `Door`; the page comes back by itself when the run is not there for a moment."""
        reader, writer = await asyncio.open_connection(sock=connected_to(self._run), limit=LONGEST)
        writer.write(encode(Question("studio")) + b"\n")
        await reader.readline()  # its name
        return _Visit(writer, asyncio.create_task(_pass_on(reader, outbox), name="hfg studio attached"))


async def _pass_on(reader: asyncio.StreamReader, outbox: PageOutbox) -> None:
    frames = FrameReader()
    try:
        while data := await reader.read(1 << 16):
            for frame, is_binary in frames.feed(data):
                outbox.put(Frame(frame, is_binary))
    except (OSError, UsageError) as error:
        _LOGGER.info("the run can no longer be followed: %s", error)
    outbox.close(1001, "the run is over")
