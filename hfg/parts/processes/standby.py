"""A process that has imported hfg and waits for instructions, so that a part that dies is soon back.

Importing takes most of the time of a restart. Short runs have no spare process: it is started some seconds after the
last part, when time does not matter. No dependencies.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
from asyncio.subprocess import PIPE, STDOUT, Process
from pathlib import Path
from typing import Final

PROCESS: Final = "hfg.parts.processes.process"
"""The module that serves a part."""

STANDBY: Final = "spare"
"""Shown in process listings in place of the name of a group."""

AFTER_S = 2.0
"""Delay between the start of a part and that of a spare process."""


async def start(name: str, module: str = PROCESS, *, keeps_output: bool = False) -> Process:
    """Start a process, which waits for instructions on its standard input.

    Args:
      name: shown in process listings.
      module: the module that it runs.
      keeps_output: its output will be read; otherwise it goes where this process's output goes.

    Raises:
      OSError: it cannot be started.
    """
    return await asyncio.create_subprocess_exec(
        sys.executable,
        "-P",  # without the current folder, which may belong to another user; the program's own path is added later
        "-m",
        module,
        name,
        env=_environment(),
        stdin=PIPE,
        stdout=PIPE if keeps_output else None,
        stderr=STDOUT if keeps_output else None,
        process_group=0,  # Ctrl-C is for the main program, which ends this one
    )


class Standby:
    """Has one spare process at a time.

    Args:
      keeps_output: see `start`.
    """

    def __init__(self, *, keeps_output: bool = False) -> None:
        self._keeps_output = keeps_output
        self._spare: Process | None = None
        self._surroundings: object = None
        self._timer: asyncio.TimerHandle | None = None
        self._making: asyncio.Task[None] | None = None
        self._ending: set[asyncio.Task[int]] = set()

    def take(self) -> Process | None:
        """Return the spare process, if it fits; another one is started after a while."""
        if self._timer is not None:
            self._timer.cancel()
        self._timer = asyncio.get_running_loop().call_later(AFTER_S, self._begin)
        spare, self._spare = self._spare, None
        if spare is None or spare.returncode is not None:
            return None
        if self._surroundings != _surroundings():
            self._end(spare)
            return None
        return spare

    def _begin(self) -> None:
        if self._spare is None and (self._making is None or self._making.done()):
            self._making = asyncio.create_task(self._make(), name="hfg spare process")

    async def _make(self) -> None:
        surroundings = _surroundings()
        with contextlib.suppress(OSError):  # then there is none, and code that needs a process reports the reason
            self._spare = await start(STANDBY, keeps_output=self._keeps_output)
            self._surroundings = surroundings

    def _end(self, spare: Process) -> None:
        with contextlib.suppress(ProcessLookupError):
            spare.kill()
        ending = asyncio.create_task(spare.wait())
        self._ending.add(ending)
        ending.add_done_callback(self._ending.discard)

    async def close(self) -> None:
        """End the spare process."""
        if self._timer is not None:
            self._timer.cancel()
        if self._making is not None:
            await asyncio.wait({self._making})
        if self._spare is not None:
            self._end(self._spare)
            self._spare = None
        if self._ending:
            await asyncio.wait(self._ending)


def _environment() -> dict[str, str]:
    """Return this program's environment, with which hfg is found where this program has found it.

    An installed hfg is found by itself. Its folder must then not come before the standard library.
    """
    root = Path(__file__).absolute().parents[3]
    if root.name in ("site-packages", "dist-packages"):
        return dict(os.environ)
    paths = [str(root), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def _surroundings() -> object:
    """Return the settings that a process inherits from this one."""
    return dict(os.environ), Path.cwd()
