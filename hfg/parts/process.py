"""The process of one part: `python -m hfg.parts.process`, begun by a launcher, which says on its input what to serve.

When its standard input ends, whoever began it is gone, and it goes too, whatever it does.
"""

from __future__ import annotations

import asyncio
import contextlib
import importlib.util
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

from hfg.engine import PunctualLoop
from hfg.errors import HfgError
from hfg.parts.launching import Begun, build_graph
from hfg.parts.transports import transport
from hfg.parts.worker import Worker

__all__ = ["main"]

_LONGEST: Final = 2**20
_PATIENCE_S: Final = 7.0


def main() -> None:
    """Serve a part, until the run is over or whoever began this is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the main part, which ends this one
    line = sys.stdin.buffer.readline(_LONGEST)
    try:
        begun = msgspec.json.decode(line, type=Begun)
    except msgspec.DecodeError:
        raise SystemExit("hfg.parts.process serves a part of a run and is begun by that; use hfg run") from None
    sys.path[:] = begun.path
    sys.argv[:] = begun.argv
    if begun.main:
        _be_like(begun.main)
    for name, file in begun.targets.items():
        _import_as(name, file)
    try:
        with asyncio.Runner(loop_factory=PunctualLoop) as runner:
            runner.run(_serve(begun))
    except HfgError as error:
        raise SystemExit(f'hfg: group "{begun.part}": {error}') from None
    except asyncio.CancelledError:
        raise SystemExit(1) from None


async def _serve(begun: Begun) -> None:
    task = asyncio.current_task()
    assert task is not None
    stop = partial(asyncio.get_running_loop().call_soon_threadsafe, task.cancel)
    threading.Thread(target=_watch, args=(stop,), daemon=True, name="hfg watch of the main part").start()
    session = await transport(begun.transport).open(**begun.settings)
    try:
        beside = Path(begun.main).parent if begun.main else None
        worker = Worker(
            session, begun.run, begun.part, begun.lives, lambda message: build_graph(message, beside=beside)
        )
        await worker.serve()
    finally:
        await session.close()


def _watch(stop: Callable[[], object]) -> None:
    """End the process when the input ends: at first as it should, with teardowns, and then in any case."""
    os.read(sys.stdin.fileno(), 1)
    with contextlib.suppress(RuntimeError):  # it ends already
        stop()
    time.sleep(_PATIENCE_S)
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
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is not None and spec.loader is not None:
        sys.modules[name] = module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)


if __name__ == "__main__":
    main()
