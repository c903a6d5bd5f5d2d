"""The process of one part: `python -m hfg.parts.processes.process`, started by a launcher.

The launcher sends instructions on its standard input. When its standard input closes, the process that started it is
gone, so it exits, too, whatever it is doing.
"""

from __future__ import annotations

import asyncio
import contextlib
import importlib.util
import io
import logging
import os
import runpy
import signal
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

import msgspec

from hfg.base.sources import spec_of_file
from hfg.engine import PunctualLoop
from hfg.errors import HfgError, RunError, TransportError, in_words
from hfg.graph import Graph
from hfg.parts.model.messages import Logged, Open
from hfg.parts.processes import rendezvous
from hfg.parts.processes.launching import BEAT_S, Instructions, build_graph
from hfg.parts.processes.standby import STANDBY
from hfg.parts.processes.worker import Worker
from hfg.parts.transports import open_sessions
from hfg.transport import Session, Traffic

_LONGEST: Final = 2**20
_PATIENCE_S: Final = 7.0


def main() -> None:
    """Serve a part, until the run is over or the process that started this one is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the main part, which ends this one
    line = sys.stdin.buffer.readline(_LONGEST)
    if not line and sys.argv[1:] == [STANDBY]:
        return  # it was not needed
    try:
        begun = msgspec.json.decode(line, type=Instructions)
    except msgspec.DecodeError:
        raise SystemExit("this process serves a part of a run, which starts it; use hfg run") from None
    _be_called(begun.part)
    sys.path[:] = begun.path
    sys.argv[:] = begun.argv
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)  # what nodes print is seen, however this ends
    problem = _import(begun)
    try:
        with asyncio.Runner(loop_factory=PunctualLoop) as runner:
            runner.run(_serve(begun, problem))
    except HfgError as error:
        raise SystemExit(f'hfg: group "{begun.part}": {error}') from None
    except asyncio.CancelledError:
        raise SystemExit(1) from None
    finally:
        _sweep(begun)


def _be_called(part: str) -> None:
    """Show the part's name in process listings, even if this was a spare process; where the system supports it."""
    with contextlib.suppress(OSError):
        Path("/proc/self/comm").write_text(f"hfg {part}"[:15])


def _sweep(begun: Instructions) -> None:
    """Remove files left by a main part that was killed; a living one does so itself."""
    if begun.folder and os.getppid() != begun.parent:
        rendezvous.remove(Path(begun.folder))


def _import(begun: Instructions) -> RunError | None:
    """Import the modules of the main program, for node types in them. Return what went wrong."""
    file = begun.main
    try:
        if begun.main:
            _be_like(begun.main)
        for name, file in begun.targets.items():
            _import_as(name, file)
    except (Exception, SystemExit) as error:
        problem = RunError(
            f'the process of group "{begun.part}" cannot import "{file}" ({in_words(error)}): it needs the '
            'node types in it; put the code that runs the graph below `if __name__ == "__main__":`, or the '
            "node types into a module"
        )
        problem.__cause__ = error
        return problem
    return None


async def _beat(session: Session, begun: Instructions) -> None:
    """Say again and again that this loop goes round."""
    publisher = session.publisher(begun.beat, Traffic.ACKNOWLEDGEMENTS)  # one left out could cost this process its life
    with contextlib.suppress(TransportError):
        while True:
            publisher.put(b"beat")
            await asyncio.sleep(BEAT_S)


class _ToMain(logging.Handler):
    """Takes log records to the main part, from any thread."""

    def __init__(self, loop: asyncio.AbstractEventLoop, log: Callable[[Logged], None], level: int) -> None:
        super().__init__(level)
        self._loop = loop
        self._log = log

    def emit(self, record: logging.LogRecord) -> None:
        """Turn it into text, which is all that can be sent."""
        try:
            logged = Logged(
                record.name,
                record.levelno,
                self.format(record),
                str(getattr(record, "path", "")),
                record.created,
                record.pathname,
                record.lineno,
                record.funcName or "",
            )
            self._loop.call_soon_threadsafe(self._log, logged)
        except Exception:
            self.handleError(record)


async def _serve(begun: Instructions, problem: RunError | None) -> None:
    task = asyncio.current_task()
    assert task is not None
    stop = partial(asyncio.get_running_loop().call_soon_threadsafe, task.cancel)
    threading.Thread(target=_watch, args=(stop, begun), daemon=True, name="hfg watch of the main part").start()
    session, near = await open_sessions(begun.settings, begun.folder)
    try:
        beside = Path(begun.main).parent if begun.main else None

        def build(message: Open) -> Graph:
            if problem is not None:
                raise problem
            return build_graph(message, beside=beside)

        is_apart = not begun.folder
        worker = Worker(session, begun.run, begun.part, begun.incarnations, build, near=near, is_apart=is_apart)
        handler = _ToMain(asyncio.get_running_loop(), worker.log, begun.level)
        logging.getLogger().addHandler(handler)
        logging.getLogger().setLevel(begun.level)
        beating = asyncio.create_task(_beat(session, begun), name="hfg heartbeats")
        try:
            await worker.serve()
        finally:
            beating.cancel()
            logging.getLogger().removeHandler(handler)
    finally:
        for one in {session, near}:
            await one.close()


def _watch(stop: Callable[[], object], begun: Instructions) -> None:
    """End the process when the input ends: at first as it should, with teardowns, and then in any case."""
    os.read(sys.stdin.fileno(), 1)
    with contextlib.suppress(RuntimeError):  # it ends already
        stop()
    time.sleep(_PATIENCE_S)
    _sweep(begun)
    os._exit(1)


def _be_like(main: str) -> None:
    """Have the types of the main program, as `multiprocessing` does: it runs, but not as the main program."""
    found = runpy.run_path(main, run_name="__hfg_main__")
    module = type(sys)("__main__")
    module.__dict__.update(found)
    module.__dict__["__name__"] = "__main__"
    sys.modules["__main__"] = sys.modules["__hfg_main__"] = module


def _import_as(name: str, file: str) -> None:
    """Import a file under the name that it has in the main part."""
    spec = spec_of_file(name, file)
    assert spec.loader is not None
    sys.modules[name] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)


if __name__ == "__main__":
    main()
