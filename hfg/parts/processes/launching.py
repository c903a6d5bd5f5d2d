"""Starts the other parts of a run: in processes of this host, or, in virtual time, on the same loop.

A process gets its instructions on its standard input, which stays open. When it closes, the process that started it is
gone, so it exits, too. Depends on `worker` and `transports`.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import signal
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import msgspec

from hfg.errors import HfgError, TransportError, UsageError, in_words
from hfg.graph import Graph
from hfg.parts.model.messages import Open
from hfg.parts.processes.rendezvous import Rendezvous
from hfg.parts.processes.standby import PROCESS, Standby, start
from hfg.parts.processes.worker import Worker
from hfg.parts.running.channels import name_of
from hfg.parts.transports import open_sessions, transport
from hfg.transport import Buffer, Session

BEAT_S: Final = 0.5
"""How often a process reports that its event loop is running."""

STARTS_S: Final = 60.0
"""How long it may take until its first message."""

_ENDS_S: Final = 2.0  # how long a process may take to exit by itself, once it was told to


class Instructions(msgspec.Struct, frozen=True):
    """The instructions for a process on its standard input, as one line of JSON.

    Attributes:
      run: the name by which all parts know the run.
      part: name of the part that it should serve.
      incarnations: its incarnation, and that of the main part.
      settings: settings of the network; None if all parts are on this host.
      argv: arguments of the program, which its main file may read when it is imported.
      main: the file of the program, for node types in it; "" if there is none.
      targets: other files that hfg itself has imported, by the name of the module.
      path: search path for modules.
      parent: the process that has started it; when it is gone, the folder is no longer needed.
      folder: the folder in which the parts on this host connect; "" if they share neither folder nor memory.
      beat: the key on which the process reports that its event loop is running.
      level: level of the log records that the main program wants.
    """

    run: str
    part: str
    incarnations: tuple[int, int]
    settings: dict[str, Any] | None
    argv: list[str]
    main: str
    targets: dict[str, str]
    path: list[str]
    parent: int
    folder: str
    beat: str
    level: int


def build_graph(message: Open, *, beside: Path | None = None) -> Graph:
    """Make the graph from the received text.

    Raises:
      FileError: it does not describe a graph, or names something that does not exist here.
    """
    from hfg.files import building
    from hfg.files.findings import Findings
    from hfg.files.reading import read_bytes

    findings = Findings()
    read = read_bytes(message.graph.encode(), "the graph that was sent", findings)
    findings.reject("the graph that was sent cannot be read")
    assert read is not None
    place = (beside or Path.cwd()) / "graph.hfg.yaml"
    return building.build(read.document, place, message.allow)


# --- on the same loop ---


class LoopLauncher:
    """Begins parts on the running loop, over the transport in memory: in virtual time, and to look at."""

    shares_memory = False
    is_in_realm = False
    near = None

    def __init__(self, **settings: Any) -> None:
        """Begin nothing yet.

        Args:
          **settings: of the transport "memory".
        """
        self._transport = transport("memory")
        self._settings = settings or {"network": f"hfg {id(self)}"}
        self._session: Session | None = None

    async def open(self) -> Session:
        """See `Launcher`."""
        self._session = await self._transport.open(**self._settings)
        return self._session

    async def prepare(self, hosts: Mapping[str, str], modules: Mapping[str, str]) -> None:
        """See `Launcher`: all of it is here."""

    async def launch(self, run: str, part: str, host: str, incarnations: tuple[int, int]) -> _Task:
        """See `Launcher`."""
        session = await self._transport.open(**self._settings)
        return _Task(session, Worker(session, run, part, incarnations, build_graph), part)

    async def close(self) -> None:
        """See `Launcher`."""
        if self._session is not None:
            await self._session.close()


class _Task:
    """A part on the same loop; it has no process."""

    def __init__(self, session: Session, worker: Worker, part: str) -> None:
        self.process = 0
        self._session = session
        self._task = asyncio.create_task(worker.serve(), name=f"hfg part {part}")
        self._killed = asyncio.Event()

    async def wait(self) -> str:
        """See `Launched`."""
        killed = asyncio.ensure_future(self._killed.wait())
        await asyncio.wait({self._task, killed}, return_when=asyncio.FIRST_COMPLETED)
        killed.cancel()
        if self._killed.is_set():
            return "its task was killed"
        if self._task.cancelled():
            return "its task was cancelled"
        error = self._task.exception()
        return "its task is over" if error is None else f"its task failed: {in_words(error)}"

    def begins(self) -> None:
        """See `Launched`: who shares the loop needs no heartbeat."""

    def kill(self) -> None:
        """End it at once and without a word, as a process that is killed; but for the teardowns of its nodes."""
        die = getattr(self._session, "die", None)
        if die is not None:
            die()
        self._task.cancel()
        self._killed.set()

    async def end(self) -> None:
        """See `Launched`; who was killed is waited for no more than a process that was."""
        self._task.cancel()
        if not self._killed.is_set():
            await asyncio.wait({self._task})
            await self._session.close()


# --- in processes ---


class ProcessLauncher:
    """Begins parts as processes of this host.

    Args:
      settings: of the network, if there are parts on other hosts; None if there are not.

    Attributes:
      near: the session that reaches the parts on this host.
    """

    shares_memory = True
    is_in_realm = False

    def __init__(self, settings: dict[str, Any] | None = None) -> None:
        self.near: Session | None = None
        self._settings = settings
        self._place: Rendezvous | None = None
        self._session: Session | None = None
        self._opening: asyncio.Future[tuple[Session, Session]] | None = None
        self._standby = Standby()

    async def open(self) -> Session:
        """See `Launcher`."""
        self._place = Rendezvous()
        self._opening = asyncio.ensure_future(open_sessions(self._settings, str(self._place.folder)))
        session, self.near = await asyncio.shield(self._opening)
        self._session = session
        return session

    async def prepare(self, hosts: Mapping[str, str], modules: Mapping[str, str]) -> None:
        """See `Launcher`: what is here can be imported here."""

    async def launch(self, run: str, part: str, host: str, incarnations: tuple[int, int]) -> PartProcess:
        """See `Launcher`."""
        assert self._session is not None
        assert self._place is not None
        begun = Instructions(
            run,
            part,
            incarnations,
            self._settings,
            sys.argv,
            _main_program(),
            _targets(),
            sys.path,
            parent=os.getpid(),
            folder=str(self._place.folder),
            beat=beat_of(run, part, incarnations[0]),
            level=logging.getLogger("hfg").getEffectiveLevel(),
        )
        process = await PartProcess.begin(part, begun, standby=self._standby)
        process.watch(self._session, begun.beat)
        return process

    async def close(self) -> None:
        """See `Launcher`."""
        await self._standby.close()
        if self._opening is not None:  # an interruption during it would leave its files in the folder
            with contextlib.suppress(HfgError):
                for session in set(await self._opening):
                    await session.close()
        if self._place is not None:
            self._place.leave()


def beat_of(run: str, part: str, incarnation: int) -> str:
    """Return the key on which a process reports that its event loop is running."""
    return f"{run}/beat/{name_of(part)}/{incarnation}"


def _patience_s() -> float:
    """Return how long the event loop of a process may block; 0 means forever."""
    said = os.environ.get("HFG_PROCESS_SILENCE_S", "5")
    try:
        return max(float(said), 0.0)
    except ValueError:
        raise UsageError(f"HFG_PROCESS_SILENCE_S must be a number of seconds, 0 for no limit, got {said!r}") from None


def _main_program() -> str:
    """Return the file of the program, whose node types may be in the graph, unless it is a command without any."""
    main = sys.modules.get("__main__")
    if main is None or getattr(main, "__spec__", None) is not None:
        return ""
    file = getattr(main, "__file__", None)
    return "" if file is None else str(Path(file).resolve())


def _targets() -> dict[str, str]:
    """Return the files that the command line has imported under names of its own."""
    found = {name: module for name, module in list(sys.modules.items()) if name.startswith("hfg_target_")}
    return {name: module.__file__ for name, module in found.items() if module.__file__ is not None}


class PartProcess:
    """A part in a process of its own, including the main part when an agent runs it.

    Attributes:
      process: its id.
      output: its output, if requested.
    """

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.process = process.pid
        self.output = process.stdout
        self._process = process
        self._ended = asyncio.ensure_future(process.wait())
        self._patience_s = STARTS_S
        self._silent_s = 0.0
        self._listening: asyncio.Task[None] | None = None
        self._why_killed = ""

    def watch(self, session: Session, beat: str) -> None:
        """End it when its event loop does not go round any more."""
        hearing = session.subscribe(beat, self._hear)
        self._listening = asyncio.create_task(self._listen(), name="hfg heartbeats")
        self._listening.add_done_callback(lambda _: hearing.close())

    def begins(self) -> None:
        """See `Launched`."""
        self._patience_s = _patience_s() or float("inf")
        self._silent_s = 0.0

    def _hear(self, beats: list[tuple[Buffer, Buffer]]) -> None:
        del beats  # only their arrival matters
        self._silent_s = 0.0
        if self._patience_s == STARTS_S:
            self._patience_s = float("inf")  # a setup may take as long as it likes

    async def _listen(self) -> None:
        """Count silence by what this loop has itself been awake for."""
        while not self._ended.done():
            await asyncio.sleep(BEAT_S)
            self._silent_s += BEAT_S
            if self._silent_s > self._patience_s:
                self._why_killed = f" because its event loop has been blocked for {self._silent_s:g} s"
                with contextlib.suppress(ProcessLookupError):
                    self._process.kill()
                return

    @classmethod
    async def begin(
        cls,
        part: str,
        begun: msgspec.Struct,
        *,
        module: str = PROCESS,
        keeps_output: bool = False,
        standby: Standby | None = None,
    ) -> PartProcess:
        """Start the process.

        Args:
          part: the name of its group, shown in process listings.
          begun: the instructions on its standard input, which stays open.
          module: the module that it runs.
          keeps_output: its output can be read from `output`; otherwise it goes where this process's output goes.
          standby: provides a spare process, if there is one, with the same `module` and `keeps_output`.

        Raises:
          TransportError: it cannot be started.
        """
        process = None if standby is None else standby.take()
        try:
            process = process or await start(part, module, keeps_output=keeps_output)
        except OSError as error:
            raise TransportError(f'cannot start a process for group "{part}": {error}') from error
        assert process.stdin is not None
        with contextlib.suppress(ConnectionError):  # it is already gone, which the code that waits for it reports
            process.stdin.write(msgspec.json.encode(begun) + b"\n")
            await process.stdin.drain()
        return cls(process)

    async def wait(self) -> str:
        """See `Launched`."""
        code = await asyncio.shield(self._ended)
        if code < 0:
            with contextlib.suppress(ValueError):
                return f"process {self.process} was ended by {signal.Signals(-code).name}{self._why_killed}"
        return f"process {self.process} has ended with code {code}"

    async def end(self) -> None:
        """See `Launched`: it goes by itself, or is made to."""
        assert self._process.stdin is not None
        if self._listening is not None:
            self._listening.cancel()
        self._process.stdin.close()
        for how in (None, self._process.terminate, self._process.kill):
            if how is not None and not self._ended.done():
                with contextlib.suppress(ProcessLookupError):
                    how()
            try:
                async with asyncio.timeout(_ENDS_S):
                    await asyncio.shield(self._ended)
                return
            except TimeoutError:
                continue
        await self._ended
