"""How other processes look at a run: a Unix domain socket for each, in a folder that only the user can enter.

`<folder>/<process id>.sock` is there while the run is; a second run of a process has `<process id>-2.sock`. One line
of JSON asks and one answers: {"want": "name"} or {"want": "glance"}; {"want": "tap", "path": ...} is answered by a
line, and then a line for each token. {"want": "studio"} is answered by a line, and from then on both sides speak the
protocol of the studio, by which the same user steers and edits the run (`hfg.studio.messages`): a message per line, and
a binary frame after a line with "!" and its length. There is a limit to each line and to how many may ask. While nobody
asks nothing is done. Depends on `run`.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import socket
import sys
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from typing import Any, Final, Literal

import msgspec

from hfg.base.hooks import hooks
from hfg.base.logs import Log
from hfg.base.private import MACHINE, is_of_this_user, state_folder
from hfg.base.sockets import SocketFolder
from hfg.engine.face.run import Run
from hfg.engine.observing.encoding import encode, line_of
from hfg.engine.observing.glance import Glance
from hfg.engine.observing.taps import Tap
from hfg.errors import HfgError, TargetError, TransportError

__all__ = ["Answer", "Door", "Question", "run_names", "run_sockets", "watched"]

_LOGGER = Log("hfg.engine")
_LONGEST_QUESTION: Final = 1024
_MOST_GUESTS: Final = 8
_ID: Final = re.compile(r"[0-9]+(-[0-9]+)?")
_KEPT: Final = 10_000  # tokens, for a tap: more than a graph sends between two turns of the loop


class Question(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is asked.

    Attributes:
      path: of a tap: a port or an edge.
      max_rate_hz: of a tap: at most this many tokens per second.
      json: of a tap: tokens as JSON, not for people.
    """

    want: Literal["name", "glance", "tap", "studio"]
    path: str = ""
    max_rate_hz: float | None = None
    json: bool = False


class Answer(msgspec.Struct, frozen=True, omit_defaults=True):
    """What is answered.

    Attributes:
      pid: the process that answers.
      graph: the name of the graph that runs there.
      target: as `hfg run` was given it, or the program that runs it.
      glance: if it was asked for.
      error: why there is no answer.
      name: of the socket, without its ending: the process, and which of its runs if it has several.
    """

    pid: int = 0
    graph: str = ""
    target: str = ""
    glance: Glance | None = None
    error: str = ""
    name: str = ""


def run_sockets() -> SocketFolder:
    """Open the folder with the sockets of this user's runs; it is created if needed.

    Raises:
      TargetError: it is not a folder that only this user can enter.
    """
    try:
        return SocketFolder(state_folder() / f"runs-{MACHINE}", "in which hfg top and hfg tap find runs")
    except TransportError as error:
        raise TargetError(f"runs of other processes cannot be found here: {error}") from None


def run_names(there: SocketFolder) -> list[str]:
    """Return the name of each run that has a socket in a folder, in order of process ids."""
    found = [name for name in there.names() if _ID.fullmatch(name)]
    return sorted(found, key=lambda name: [int(part) for part in name.split("-")])


class Door:
    """Lets other processes look at a run: nothing is done until one asks."""

    def __init__(self, run: Run, target: str, name: str) -> None:
        self.run = run
        self.guests: set[_Guest] = set()  # from when they knock until they are gone
        self.closed = False
        self.studio: Any = None  # from the first guest on that wants to steer
        self._empty = asyncio.Event()
        self.name = Answer(os.getpid(), run.graph.name, target, name=name)

    def answer(self, line: bytes) -> Answer | Question:
        """Answer one question. Return that of a tap, which goes on being answered."""
        try:
            question = msgspec.json.decode(line, type=Question)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
            return Answer(error=f"the question cannot be understood: {error}")
        if question.want == "name":
            return self.name
        if question.want in ("tap", "studio"):
            return question
        return msgspec.structs.replace(self.name, glance=self.run.glance())

    async def close(self) -> None:
        """Close all connections and wait until they are gone: a loop that ends earlier leaves their sockets open."""
        self.closed = True
        await asyncio.sleep(0)  # who was let in at this very moment knocks in the loop's next pass
        if self.studio is not None:
            await self.studio.close()
        for guest in self.guests:
            guest.send_away()
        if self.guests:
            await self._empty.wait()

    def leave(self, guest: _Guest) -> None:
        """One is gone."""
        self.guests.discard(guest)
        if self.closed and not self.guests:
            self._empty.set()


@asynccontextmanager
async def watched(run: Run, watch: bool | str) -> AsyncIterator[None]:
    """Let others watch the run inside the block, if allowed. If that fails, only a log record says why.

    Args:
      run: what they see.
      watch: whether they may, or the name of the program that they see.
    """
    if not watch:
        yield
        return
    async with AsyncExitStack() as stack:
        try:
            there = stack.enter_context(contextlib.closing(run_sockets()))
            name, listening = _listen(there)
            door = Door(run, sys.argv[0] if watch is True else watch, name)
            server = await asyncio.get_running_loop().create_unix_server(lambda: _Guest(door), sock=listening)
            stack.push_async_callback(_close, server, listening, door)
            stack.callback(there.remove, name)
        except (HfgError, OSError) as error:
            _LOGGER.info("hfg top cannot look at this run: %s", error)
        yield


async def _close(server: asyncio.Server, listening: socket.socket, door: Door) -> None:
    # First nobody more is let in: a server that is closed loses whom it has let in but not made a connection
    # of yet (asyncio asserts that it is open), and the door would wait for that guest forever.
    asyncio.get_running_loop().remove_reader(listening)
    await door.close()
    server.close()


def _listen(there: SocketFolder) -> tuple[str, socket.socket]:
    """Return the name of a run of this process, and a socket that listens under it; removes those of dead processes."""
    for other in run_names(there):
        with contextlib.suppress(BlockingIOError):  # it is alive and busy
            if connected := there.connect(other):
                connected.close()
    own, number, taken = str(os.getpid()), 1, set(there.names())
    while (name := own if number == 1 else f"{own}-{number}") in taken:
        number += 1
    return name, there.listen(name, _MOST_GUESTS)


class _Guest(asyncio.Protocol):
    """One connection: a question, its answer, the next question; a tap has no next."""

    def __init__(self, door: Door) -> None:
        self._door = door
        self._asked = b""
        self._transport: asyncio.Transport | None = None
        self._tapping: asyncio.Task[None] | None = None
        self._visit: Any = None
        self._may_write = asyncio.Event()
        self._may_write.set()
        self.is_let_in = False
        door.guests.add(self)

    def send_away(self) -> None:
        """End the connection; one that is not made yet ends when it is."""
        if self._transport is not None:
            self._transport.abort()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        if not is_of_this_user(transport.get_extra_info("socket")):
            transport.abort()
            return
        if self._door.closed or sum(guest.is_let_in for guest in self._door.guests) >= _MOST_GUESTS:
            transport.abort()
            return
        self.is_let_in = True
        transport.set_write_buffer_limits(0)  # one answer at a time: whoever does not read is not heard

    def connection_lost(self, exc: Exception | None) -> None:
        self._door.leave(self)
        if self._visit is not None:
            self._visit.leave()
        if self._tapping is not None:
            self._tapping.cancel()

    @property
    def _way(self) -> asyncio.Transport:
        assert self._transport is not None
        return self._transport

    def pause_writing(self) -> None:
        if self._visit is not None:
            return
        self._way.pause_reading()
        self._may_write.clear()

    def resume_writing(self) -> None:
        self._way.resume_reading()
        self._may_write.set()

    def data_received(self, data: bytes) -> None:
        if self._visit is not None:
            self._visit.data_received(data)
            return
        self._asked += data
        line, newline, rest = self._asked.partition(b"\n")
        if (
            rest or len(line) > _LONGEST_QUESTION or self._tapping is not None
        ):  # nobody who keeps to the rules does that
            self._way.abort()
        elif newline:
            self._asked = b""
            answer = self._door.answer(line)
            if not isinstance(answer, Question):
                self._say(answer)
            elif answer.want == "tap":
                self._say(self._tap(answer))
            else:
                self._say(self._door.name)
                self._way.set_write_buffer_limits()  # its frames are bounded by the credits of the protocol
                self._visit = hooks.visit_studio(self._door, self._way)

    def _say(self, answer: Answer) -> None:
        self._way.write(encode(answer) + b"\n")

    def _tap(self, question: Question) -> Answer:
        size = _KEPT if question.max_rate_hz is None else None
        try:
            looking = self._door.run.tap(question.path, size=size, max_rate_hz=question.max_rate_hz)
        except HfgError as error:
            return Answer(error=str(error))
        self._tapping = asyncio.get_running_loop().create_task(self._tell(looking, json=question.json))
        return self._door.name

    async def _tell(self, looking: Tap, *, json: bool) -> None:
        with looking:
            async for token in looking:
                await self._may_write.wait()
                self._way.write(line_of(token, looking.passed_s, json=json).encode())
        self._way.close()
