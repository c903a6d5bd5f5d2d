"""`hfg agent`: lets this host run parts of graphs, until it is ended.

Depends on `hfg.parts.hosts.agent` and `hosting`.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from hfg.cli import show
from hfg.cli.options import SettingsOption
from hfg.errors import TargetError
from hfg.parts.hosts.agent import Agent
from hfg.parts.hosts.hosting import Journal, ThisComputer, logs_folder
from hfg.parts.running.rings import sweep_runs
from hfg.parts.transports import open_session

_ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


def session_settings(settings: str | None) -> dict[str, Any]:
    """Return the settings of a session in the realm of a settings file, or in the default realm."""
    return {"settings": str(Path(settings).resolve())} if settings else {}


def agent(
    settings: SettingsOption = None,
    insecure: Annotated[
        bool,
        typer.Option("--insecure", help="Allow tcp/ addresses in the settings, which do not authenticate anyone."),
    ] = False,
    verbose: Annotated[int, typer.Option("-v", "--verbose", count=True, help="Report each process.")] = 0,
) -> int:
    """Let this host run parts of graphs until Ctrl-C. Modules are searched for from the working directory."""
    show.Records(max(verbose, 0), debug=False).loaded()
    said = session_settings(settings)
    if insecure and not said:
        raise TargetError("--insecure is for addresses, and without --settings there are none; leave it out")
    return asyncio.run(_serve(said | ({"insecure": True} if insecure else {}), Path.cwd()))


async def _serve(settings: dict[str, Any], folder: Path) -> int:
    sweep_runs()
    session = await open_session("", **({"mode": "router"} | settings if settings else {}))
    try:
        journal = Journal(logs_folder(), session.host)
        journal.open()
        one = Agent(session, ThisComputer(session, settings, journal, folder))
        with ending() as ended:
            try:
                await one.open()
                show.write(f'agent of host "{session.host}" is ready, process {os.getpid()}\n')
                sys.stdout.flush()
                await ended.wait()
            finally:
                await one.close()
    finally:
        await session.close()
    return 0


@contextmanager
def ending() -> Iterator[asyncio.Event]:
    """Be told by Ctrl-C and its like; the second one leaves at once, and what was begun ends by itself."""
    loop, ended = asyncio.get_running_loop(), asyncio.Event()

    def press() -> None:
        if ended.is_set():
            os._exit(1)
        ended.set()

    taken = []
    for one in _ENDING:
        if signal.getsignal(one) is not signal.SIG_IGN:  # as nohup has it
            with contextlib.suppress(NotImplementedError, RuntimeError):
                loop.add_signal_handler(one, press)
                taken.append(one)
    try:
        yield ended
    finally:
        for one in taken:
            loop.remove_signal_handler(one)
