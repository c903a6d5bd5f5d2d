"""The agent's resources on its computer: processes for parts, the modules that these can import, and their output.

Depends on `launching` and `realm`.
"""

from __future__ import annotations

import asyncio
import importlib
import importlib.machinery
import os
import re
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import msgspec

from hfg.base.private import open_private, state_folder
from hfg.errors import TransportError
from hfg.parts.hosts import requests
from hfg.parts.hosts.realm import run_id
from hfg.parts.processes.launching import Instructions, PartProcess, beat_of
from hfg.parts.processes.rendezvous import Rendezvous
from hfg.parts.processes.standby import Standby
from hfg.parts.running.rings import sweep_run
from hfg.transport import Session

_LONGEST_LINE: Final = 64 * 1024
_LONGEST_LOG: Final = 16 * 2**20
_LONGEST_CHUNK: Final = 256 * 1024
_MOST_LOGS: Final = 100


class Deployed(msgspec.Struct, frozen=True):
    """The message on the standard input of a deployed run's process.

    Attributes:
      run: its name.
      arguments: arguments of `hfg run`, the target first.
      settings: the file of the agent; "" for none.
      folder: the folder of the target.
    """

    run: str
    arguments: list[str]
    settings: str
    folder: str


class ThisComputer:
    """This computer, for its agent.

    Args:
      session: session of the agent.
      settings: the settings with which parts open theirs.
      journal: stores the output of processes.
      folder: folder whose modules parts can import, in addition to installed ones.
      is_apart: other programs serve the other parts on this host; so they share neither folder nor memory with these.
    """

    def __init__(
        self, session: Session, settings: dict[str, Any], journal: Journal, folder: Path, *, is_apart: bool = False
    ) -> None:
        self._session = session
        self._settings = settings
        self._journal = journal
        self._folder = folder
        self._path = [str(folder), *(one for one in sys.path if one)]
        self._standby = Standby(keeps_output=True)
        self._is_apart = is_apart
        self._places: dict[str, Rendezvous] = {}  # of the parts of each run that are here

    async def part(self, order: requests.Start) -> PartProcess:
        """See `Computer`."""
        incarnation = order.incarnations[0]
        begun = Instructions(
            order.run,
            order.part,
            order.incarnations,
            self._settings,
            order.argv,
            main="",
            targets={},
            path=self._path,
            parent=os.getpid(),
            folder="" if self._is_apart else str(self._place(order.run).folder),
            beat=beat_of(order.run, order.part, incarnation),
            level=order.level,
        )
        process = await PartProcess.begin(order.part, begun, keeps_output=True, standby=self._standby)
        process.watch(self._session, begun.beat)
        self._journal.keep(order.run, order.part, process)
        return process

    def _place(self, run: str) -> Rendezvous:
        if run not in self._places:
            self._places[run] = Rendezvous()
        return self._places[run]

    async def main(self, order: requests.Deploy) -> PartProcess:
        """See `Computer`."""
        folder = order.folder or str(self._folder)
        if not _is_folder(folder):
            raise TransportError(f'host "{self._session.host}" has no folder {folder}, from which it was to run')
        told = Deployed(run_id(order.run), [order.target, *order.arguments], self._settings.get("settings", ""), folder)
        process = await PartProcess.begin("main", told, module="hfg.cli.deployed", keeps_output=True)
        self._journal.keep(order.run, "main", process)
        return process

    def missing(self, modules: list[str]) -> requests.Missing:
        """See `Computer`."""
        return requests.Missing([one for one in modules if not is_importable(one, self._path)], str(self._folder))

    def read_log(self, run: str, offset: int) -> requests.Chunk:
        """See `Computer`."""
        return self._journal.read(run, offset)

    def forget(self, run: str) -> None:
        """See `Computer`."""
        sweep_run(run)
        place = self._places.pop(run, None)
        if place is not None:
            place.leave()

    async def close(self) -> None:
        """See `Computer`."""
        await self._standby.close()
        for run in tuple(self._places):
            self.forget(run)


def _is_folder(path: str) -> bool:
    return Path(path).is_dir()


def is_importable(module: str, path: Sequence[str]) -> bool:
    """Say whether a module can be found on a path; nothing is imported, and what is new there is seen."""
    importlib.invalidate_caches()
    name, where = "", list(path)
    for chunk in module.split("."):
        name = f"{name}.{chunk}" if name else chunk
        spec = _find(name, where, is_top=name == chunk)
        if spec is None:
            return module in sys.modules and module.startswith("hfg.")  # made while hfg was imported
        where = list(spec.submodule_search_locations or [])
    return True


def _find(name: str, where: list[str], *, is_top: bool) -> importlib.machinery.ModuleSpec | None:
    for finder in sys.meta_path:
        is_usual = finder is importlib.machinery.PathFinder
        find = getattr(finder, "find_spec", None)
        try:
            spec = None if find is None else find(name, where if is_usual or not is_top else None)
        except Exception:
            spec = None  # a user's finder that fails finds nothing
        if spec is not None:
            return spec  # type: ignore[no-any-return]
    return None


# --- what they write ---


def logs_folder() -> Path:
    """Return the folder in which the agents of this user store the output of parts."""
    return state_folder() / "logs"


class Journal:
    """Stores the output of parts on this host, one file per run, with the time and the group of each line.

    Args:
      folder: folder of the files.
      host: name of the host, because two agents may share a folder.
    """

    def __init__(self, folder: Path, host: str) -> None:
        self._folder = folder
        self._host = re.sub(r"[^A-Za-z0-9_.-]", "_", host)
        self._pumps: set[asyncio.Task[None]] = set()

    def open(self) -> None:
        """Make the folder, and let go of what is old.

        Raises:
          TransportError: it cannot be made, or other users can enter or replace it.
        """
        os.close(open_private(self._folder, "in which an agent keeps the output of parts"))
        try:
            old = sorted(self._folder.glob("*.log*"), key=lambda file: file.stat().st_mtime)[:-_MOST_LOGS]
            for file in old:
                file.unlink(missing_ok=True)
        except OSError as error:
            raise TransportError(
                f"{self._folder}, where an agent keeps what its parts write, cannot be used ({error.strerror}): set "
                "XDG_STATE_HOME to a folder that you may write to"
            ) from None

    def _file(self, run: str) -> Path:
        return self._folder / f"{re.sub('[^A-Za-z0-9]', '_', run_id(run))}@{self._host}.log"

    def keep(self, run: str, part: str, process: PartProcess) -> None:
        """Write down all that a process writes, and how it ends."""
        pump = asyncio.create_task(self._pump(self._file(run), part, process), name=f"hfg log of {part}")
        self._pumps.add(pump)
        pump.add_done_callback(self._pumps.discard)

    async def _pump(self, file: Path, part: str, process: PartProcess) -> None:
        assert process.output is not None
        rest = b""
        while data := await process.output.read(_LONGEST_LINE):
            *lines, rest = (rest + data).split(b"\n")
            if len(rest) > _LONGEST_LINE:
                lines, rest = [*lines, rest], b""
            self._write(file, part, lines)
        ended = f"hfg: {await process.wait()}".encode()
        self._write(file, part, [rest, ended] if rest else [ended])

    def _write(self, file: Path, part: str, lines: list[bytes]) -> None:
        head = f"{time.strftime('%Y-%m-%d %H:%M:%S')} {part}: ".encode()
        try:
            if file.exists() and file.stat().st_size > _LONGEST_LOG:
                file.replace(file.with_suffix(".log.1"))
            with file.open("ab") as stream:
                stream.write(b"".join(head + line + b"\n" for line in lines))
        except OSError:
            pass  # the disk is full: the run continues

    def read(self, run: str, offset: int) -> requests.Chunk:
        """Return part of it, from a byte on; from the start, if the file has been started over."""
        file = self._file(run)
        if not file.exists():
            return requests.Chunk("", 0)
        with file.open("rb") as stream:
            stream.seek(offset if 0 <= offset <= file.stat().st_size else 0)
            begin = stream.tell()
            data = stream.read(_LONGEST_CHUNK)
        data = data[: data.rfind(b"\n") + 1]
        return requests.Chunk(data.decode(errors="replace"), begin + len(data))


class Passing(Journal):
    """Passes the output of parts on to this program's own, which its supervisor keeps."""

    def __init__(self) -> None:
        super().__init__(Path(), "")

    def open(self) -> None:
        """See `Journal`: there is nothing to be made."""

    def _write(self, file: Path, part: str, lines: list[bytes]) -> None:
        try:
            sys.stdout.buffer.write(b"".join(line + b"\n" for line in lines))
            sys.stdout.buffer.flush()
        except OSError:
            pass  # its reader is gone: the run continues

    def read(self, run: str, offset: int) -> requests.Chunk:
        """See `Journal`: it is elsewhere."""
        return requests.Chunk("", 0)
