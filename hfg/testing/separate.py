"""Runs node types in processes of their own, so that one that crashes or hangs is named and the others still run.

A worker is a new program, because the C library's checks of the heap are chosen as a program starts. It imports
everything once and forks a process for each type, or for a few. Memory and the size of files are limited, there is no
standard input, and the output of nodes is discarded. Depends on the catalogue.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import os
import platform
import resource
import selectors
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from typing import Any, Final, TypeVar

import msgspec

from hfg import catalogue
from hfg.testing.samples import sample_folder

__all__ = ["STOPPED", "common_arguments", "forked", "in_processes", "references_of", "serve"]

STOPPED: Final = "did not return within"
"""The first words about a process that was stopped because it took too long."""

_HEAP: Final = (
    {"MALLOC_CHECK_": "3", "LD_PRELOAD": "libc_malloc_debug.so.0"} if platform.libc_ver()[0] == "glibc" else {}
)
"""Makes glibc check each freed block, so that code which writes beyond one is stopped at once."""

_FILE_BYTES: Final = 64 << 20
_IMPORT_S: Final = 120.0
_LOOKS_S: Final = 0.05
_WITH_PARENT: Final = 1  # PR_SET_PDEATHSIG of Linux

T = TypeVar("T", bound=msgspec.Struct)


class _Task(msgspec.Struct):
    references: list[str]
    how: msgspec.Raw


# --- in the program that asks ---


def in_processes(
    module: str,
    references: Iterable[str],
    how: msgspec.Struct,
    result: type[T],
    *,
    processes: int = 1,
    tell: Callable[[T], None] | None = None,
) -> list[T]:
    """Have workers run node types. Return the results in the order of the types.

    Args:
      module: the module that the workers run; its `main` calls `serve`.
      references: "module:name" each.
      how: the settings of the module.
      result: the type of the results.
      processes: number of workers; each has its share of the types.
      tell: called with each result, from several threads if there are several workers.

    Raises:
      RuntimeError: a worker has failed; the message has what it wrote.
    """
    every = list(references)
    tasks = [_Task(every[first::processes], msgspec.Raw(msgspec.json.encode(how))) for first in range(processes)]
    with ThreadPoolExecutor(processes) as pool:
        found = list(pool.map(lambda task: _share(module, task, result, tell), tasks))
    return [found[index % processes][index // processes] for index in range(len(every))]


def _share(module: str, task: _Task, result: type[T], tell: Callable[[T], None] | None) -> list[T]:
    found: list[T] = []
    path = os.pathsep.join(one or os.getcwd() for one in sys.path)  # noqa: PTH109
    with (
        tempfile.TemporaryDirectory(prefix="hfg-separate-") as folder,
        tempfile.TemporaryFile("w+b") as told,
        subprocess.Popen(
            [sys.executable, "-m", module, "--worker"],
            cwd=folder,
            env={
                **os.environ,
                **_HEAP,
                "PYTHONPATH": path,
                "TMPDIR": folder,
            },  # what a killed process leaves goes with it
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=told,
        ) as worker,
    ):
        assert worker.stdin is not None
        assert worker.stdout is not None
        try:
            worker.stdin.write(msgspec.json.encode(task))
            worker.stdin.close()
            for line in worker.stdout:
                found.append(msgspec.json.decode(line, type=result))
                if tell is not None:
                    tell(found[-1])
        except BaseException:
            worker.kill()
            raise
        if worker.wait() != 0 or len(found) < len(task.references):
            told.seek(0)
            words = told.read().decode(errors="replace")[-2000:]
            raise RuntimeError(f"the process that runs node types failed after {len(found)} of them: {words}")
    return found


# --- in the worker ---


def serve(settings: type[T], work: Callable[[list[str], T], Iterable[msgspec.Struct]]) -> None:
    """Be a worker: call `work` with the references and the settings, and write its results."""
    task = msgspec.json.decode(sys.stdin.buffer.read(), type=_Task)
    how = msgspec.json.decode(task.how, type=settings)
    for module in dict.fromkeys(one.partition(":")[0] for one in task.references):
        if not forked(lambda module=module: import_module(module), lambda _: _IMPORT_S):  # type: ignore[misc]
            import_module(module)  # any other module fails in the process of its types, which is named
    with contextlib.suppress(ImportError):
        import cv2

        cv2.setNumThreads(1)  # threads do not survive a fork
    with sample_folder():
        pass  # its contents are made once, and not by each process
    with os.fdopen(os.dup(1), "wb") as answers:
        for result in work(task.references, how):
            answers.write(msgspec.json.encode(result) + b"\n")
            answers.flush()


def forked(
    run: Callable[[], object],
    patience_s: Callable[[int], float],
    progress: Callable[[], int] = lambda: 0,
    *,
    memory_bytes: int = 6 << 30,
) -> str:
    """Call a function in a forked process. Return how the process died; "" if the function returned.

    Args:
      run: the function.
      patience_s: returns for how long progress may stay the same before the process is stopped.
      progress: returns a number that the process changes in shared memory.
      memory_bytes: limit of addresses, most of which libraries only reserve.
    """
    with tempfile.TemporaryFile() as told:
        process = os.fork()
        if process == 0:
            code = 1
            try:
                _confine(told.fileno(), memory_bytes)
                run()
                code = 0
            except BaseException:
                traceback.print_exc()
            finally:
                sys.stderr.flush()
                os._exit(code)
        code_or_limit = _waited(process, patience_s, progress)
        if isinstance(code_or_limit, float):
            return f"{STOPPED} {code_or_limit:g} s"
        told.seek(0)
        return _death(code_or_limit, told.read().decode(errors="replace")) if code_or_limit else ""


def _waited(process: int, patience_s: Callable[[int], float], progress: Callable[[], int]) -> int | float:
    """Wait for a process. Return its exit code, or as a float the patience after which it was stopped."""
    last, since = -1, time.monotonic()
    with _ends_of(process) as ended:
        while True:
            done, status = os.waitpid(process, os.WNOHANG)
            if done:
                return os.waitstatus_to_exitcode(status)
            now = progress()
            if now != last:
                last, since = now, time.monotonic()
            elif time.monotonic() - since > patience_s(now):
                os.kill(process, signal.SIGKILL)
                os.waitpid(process, 0)
                return float(patience_s(now))
            ended.select(_LOOKS_S)


@contextlib.contextmanager
def _ends_of(process: int) -> Iterator[selectors.BaseSelector]:
    """Yield a selector that is ready as soon as a process has ended, where the system can tell; else after its time."""
    with selectors.DefaultSelector() as selector, contextlib.ExitStack() as stack:
        if hasattr(os, "pidfd_open"):
            handle = os.pidfd_open(process)
            stack.callback(os.close, handle)
            selector.register(handle, selectors.EVENT_READ)
        yield selector


def _confine(errors: int, memory_bytes: int) -> None:
    """Limit what a forked process can do, and see to it that it does not outlive the worker."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_WITH_PARENT, signal.SIGKILL)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(nowhere, stream)
    os.dup2(errors, 2)
    for one in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1, signal.SIGUSR2):
        signal.signal(one, lambda *_: None)  # some nodes raise them, which is not a crash
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
    resource.setrlimit(resource.RLIMIT_FSIZE, (_FILE_BYTES, _FILE_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _death(code: int, told: str) -> str:
    """Return how a process ended, from its exit code and the last line that it wrote."""
    last = next((line for line in reversed(told.splitlines()) if line.strip()), "")
    how = f"with exit code {code}"
    if code < 0:
        how = f"by {signal.Signals(-code).name if -code in {one.value for one in signal.Signals} else -code}"
    return f"ended its process {how}" + (f" ({last:.200})" if last else "")


# --- the command ---


def common_arguments(module: str, description: str | None) -> argparse.ArgumentParser:
    """Return a parser for the arguments that all such commands have."""
    parser = argparse.ArgumentParser(prog=f"python -m {module}", description=description)
    parser.add_argument("what", nargs="*", help="a module, or a reference module:name; default: all installed types")
    parser.add_argument("--seed", type=int, default=0, help="each seed gives other values (0)")
    parser.add_argument("--processes", type=int, default=1, help="number of processes at a time (1)")
    parser.add_argument("--json", action="store_true", help="write the result for each type as JSON")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    return parser


def references_of(what: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the references of the named modules and types, by default of all installed ones, and all problems."""
    found = [catalogue.installed()] if not what else []
    found += [catalogue.types_of(one) for one in what if ":" not in one]
    references: dict[str, Any] = dict.fromkeys(one.reference for each in found for one in each.types)
    references.update(dict.fromkeys(one for one in what if ":" in one))
    return list(references), [problem for each in found for problem in each.problems]
