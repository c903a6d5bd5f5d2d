"""How one process looks at a run in another: a Unix domain socket each, in a folder that belongs to the user alone.

`<folder>/<process id>.sock` is there while the run is. One line of JSON asks, one answers: {"want": "name"} or
{"want": "glance"}. Nothing that comes in is ever executed, and there is a limit to each line and to how many may ask.
While nobody asks nothing is done. Stands on glances of the engine; knows no verbs.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import stat
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Final, Literal

import msgspec

from hfg.cli.encoding import encode
from hfg.engine import Glance, Run
from hfg.errors import TargetError
from hfg.logs import Log

__all__ = ["Answer", "Door", "Line", "Question", "folder", "open_door", "runs"]

_LOGGER = Log("hfg.cli")
_LONGEST_QUESTION: Final = 1024
_LONGEST_ANSWER: Final = 64_000_000
_MOST_GUESTS: Final = 8
_PATIENCE_S: Final = 2.0


class Question(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What is asked."""

    want: Literal["name", "glance"]


class Answer(msgspec.Struct, frozen=True, omit_defaults=True):
    """What is answered.

    Attributes:
      pid: the process that answers.
      graph: the name of the graph that runs there.
      target: as `hfg run` was given it.
      glance: if it was asked for.
      error: why there is no answer.
    """

    pid: int = 0
    graph: str = ""
    target: str = ""
    glance: Glance | None = None
    error: str = ""


def folder() -> Path:
    """Where the sockets of this user are; made if need be.

    Raises:
      TargetError: there is none that belongs to this user alone.
    """
    if not hasattr(socket, "AF_UNIX") or not hasattr(os, "geteuid"):
        raise TargetError("runs cannot be looked at from other processes here: that needs Unix domain sockets")
    own = os.environ.get("XDG_RUNTIME_DIR")
    place = Path(own, "hfg") if own and Path(own).is_dir() else Path(tempfile.gettempdir(), f"hfg-{os.geteuid()}")
    try:
        with contextlib.suppress(FileExistsError):
            place.mkdir(mode=0o700)
        found = place.lstat()  # not what a link leads to: somebody else may have put it there
    except OSError as error:
        raise TargetError(f"{place}, the folder for sockets of runs, cannot be used: {error.strerror}") from None
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid() or found.st_mode & 0o077:
        raise TargetError(
            f"{place}, the folder for sockets of runs, must be a folder of yours that others cannot enter: "
            f"remove it, or write chmod 700 {place}"
        )
    return place


class Line:
    """A connection to the run of another process; use it in a `with` block.

    Raises:
      TargetError: no graph runs there.
    """

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.settimeout(_PATIENCE_S)
        file = folder() / f"{pid}.sock"
        try:
            self._socket.connect(str(file))
        except OSError as error:
            self._socket.close()
            if isinstance(error, TimeoutError):
                raise TargetError(f"process {pid} does not answer: a node blocks its loop") from None
            if isinstance(error, ConnectionRefusedError):
                file.unlink(missing_ok=True)  # its process died without taking it away
            raise TargetError(_nothing_runs(pid)) from None
        self._heard = b""
        self._asked = False

    def ask(self, want: Literal["name", "glance"]) -> Answer | None:
        """Ask and wait for the answer; None if there is none within two seconds: a node blocks the loop over there.

        The next call then waits for that answer on.

        Raises:
          TargetError: the run is over, or what comes back makes no sense.
        """
        try:
            if not self._asked:
                self._socket.sendall(encode(Question(want)) + b"\n")
                self._asked = True
            while not self._heard.endswith(b"\n"):
                more = self._socket.recv(1 << 20)
                if not more or len(self._heard) > _LONGEST_ANSWER:
                    raise TargetError(f"the run in process {self._pid} is over")
                self._heard += more
        except TimeoutError:
            return None
        except OSError:
            raise TargetError(f"the run in process {self._pid} is over") from None
        heard, self._heard, self._asked = self._heard, b"", False
        try:
            answer = msgspec.json.decode(heard, type=Answer)
        except msgspec.MsgspecError as error:
            raise TargetError(f"process {self._pid} answers what this version of hfg cannot read: {error}") from None
        if answer.error:
            raise TargetError(f"process {self._pid}: {answer.error}")
        return answer

    def __enter__(self) -> Line:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self._socket.close()


def runs() -> list[Answer]:
    """The runs that can be looked at, in order of process ids; one too busy to answer has no name.

    Sockets that dead processes have left are removed.
    """
    found = []
    for pid in sorted(_sockets(folder())):
        with contextlib.suppress(TargetError), Line(pid) as line:
            answer = line.ask("name") or Answer(graph="(does not answer)")
            found.append(msgspec.structs.replace(answer, pid=pid))
    return found


def _sockets(place: Path) -> dict[int, Path]:
    """What lies there for each process; nothing else in the folder is ours."""
    return {int(file.stem): file for file in place.glob("*.sock") if file.stem.isdecimal() and file.is_socket()}


class Door:
    """Lets other processes look at a run: nothing is done until one asks.

    Attributes:
      run: what they see; None before it begins.
    """

    def __init__(self, graph: str, target: str) -> None:
        self._name = Answer(os.getpid(), graph, target)
        self.run: Run | None = None
        self.guests: set[asyncio.Transport] = set()

    def answer(self, line: bytes) -> Answer:
        """Answer one question."""
        try:
            question = msgspec.json.decode(line, type=Question)
        except msgspec.MsgspecError as error:
            return Answer(error=f"the question cannot be understood: {error}")
        if question.want == "name":
            return self._name
        if self.run is None:
            return Answer(error="the run has not begun")
        return msgspec.structs.replace(self._name, glance=self.run.glance())


@asynccontextmanager
async def open_door(graph: str, target: str) -> AsyncIterator[Door]:
    """Listen inside the block. If that cannot be, the block goes on all the same, and a log record says why."""
    door = Door(graph, target)
    server: asyncio.Server | None = None
    file: Path | None = None
    try:
        file, listening = _listen()
        server = await asyncio.get_running_loop().create_unix_server(lambda: _Guest(door), sock=listening)
    except (TargetError, OSError) as error:
        _LOGGER.info("hfg top cannot look at this run: %s", error)
    try:
        yield door
    finally:
        if file is not None:
            file.unlink(missing_ok=True)
        if server is not None:
            server.close()
        for guest in door.guests:
            guest.abort()


def _listen() -> tuple[Path, socket.socket]:
    """A socket that listens, under its name only when it does: so who is refused there can be removed."""
    runs_here = folder()
    for other in _sockets(runs_here).values():
        _remove_if_dead(other)
    file = runs_here / f"{os.getpid()}.sock"
    new = file.with_suffix(".new")
    new.unlink(missing_ok=True)
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        listening.bind(str(new))
        listening.listen(_MOST_GUESTS)
        new.rename(file)
    except OSError:
        listening.close()
        new.unlink(missing_ok=True)
        raise
    return file, listening


def _remove_if_dead(file: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as knocking:
        knocking.setblocking(False)
        try:
            knocking.connect(str(file))
        except ConnectionRefusedError:
            file.unlink(missing_ok=True)
        except OSError:
            pass  # alive and busy, or gone by now


class _Guest(asyncio.Protocol):
    """One connection: a question, its answer, the next question."""

    def __init__(self, door: Door) -> None:
        self._door = door
        self._asked = b""
        self._transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        if len(self._door.guests) >= _MOST_GUESTS:
            transport.abort()
            return
        self._door.guests.add(transport)
        transport.set_write_buffer_limits(0)  # one answer at a time: whoever does not read is not heard

    def connection_lost(self, exc: Exception | None) -> None:
        self._door.guests.discard(self._transport)

    def pause_writing(self) -> None:
        self._transport.pause_reading()

    def resume_writing(self) -> None:
        self._transport.resume_reading()

    def data_received(self, data: bytes) -> None:
        self._asked += data
        line, newline, rest = self._asked.partition(b"\n")
        if rest or len(line) > _LONGEST_QUESTION:  # nobody who keeps to the rules does that
            self._transport.abort()
        elif newline:
            self._asked = b""
            self._transport.write(encode(self._door.answer(line)) + b"\n")


def _nothing_runs(pid: int) -> str:
    return f"no graph that could be looked at runs in process {pid}; hfg top, without a number, finds those there are"
