"""Processes that evaluate: each run has a fork of its own, so that it sees no other run, and a crash is reported.

A worker is forked once and forks a process for each task. Nothing of a task's memory returns but bytes. Of the program
a fork has only the thread that forks, so a worker first gives up what belongs to the others. Only systems with `fork`
have workers. Depends on the errors only.
"""

from __future__ import annotations

import asyncio
import contextlib
import contextvars
import ctypes
import gc
import logging
import os
import select
import signal
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from multiprocessing.connection import Connection, Pipe, wait
from types import TracebackType
from typing import Any, Final

from hfg.errors import HfgError, UsageError

_WITH_PARENT: Final = 1  # PR_SET_PDEATHSIG of Linux
_DONE, _DIED, _LATE = b"d", b"x", b"l"
_PIECE: Final = 1 << 16
_FORKING: Final = threading.Lock()
"""Held while a pipe is made and a process forked, so that no other process gets the end that is written to."""


class Died(HfgError):
    """The process of a task has died.

    Attributes:
      late: it was ended because it took too long.
    """

    def __init__(self, how: str, *, late: bool = False) -> None:
        self.late = late
        super().__init__(how)


def usual_processes() -> int:
    """Return how many processes this one may use at a time."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity is not None else os.cpu_count() or 1


class Workers:
    """A number of processes; use it in a `with` block."""

    def __init__(
        self,
        work: Callable[[bytes], bytes],
        processes: int,
        patience_s: float | None = None,
        *,
        apart: Sequence[int] = (),
    ) -> None:
        """Prepare them.

        Args:
          work: called in a process of its own for each task.
          processes: how many, at least 1.
          patience_s: a task that takes longer is ended; None: it takes what it takes.
          apart: open files that only the program uses.

        Raises:
          UsageError: the system has no fork.
        """
        _need_fork()
        if type(processes) is not int or processes < 1:
            raise UsageError(f"processes= is how many run at a time, 1 at least, got {processes!r}")
        self._work, self._count, self._patience_s, self._apart = work, processes, patience_s, apart
        self._links: list[Connection[Any, Any]] = []
        self._pids: list[int] = []

    def __enter__(self) -> Workers:
        for _ in range(self._count):
            self._fork()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for link in self._links:
            link.close()
        for pid in self._pids:
            with contextlib.suppress(OSError):
                os.killpg(pid, signal.SIGKILL)
            with contextlib.suppress(OSError):
                os.waitpid(pid, 0)
        self._links, self._pids = [], []

    def in_order(self, tasks: Iterable[bytes]) -> Iterator[bytes | Died]:
        """Carry out tasks, as many at a time as there are processes. Yield the results in the order of the tasks."""
        left = enumerate(tasks)
        busy: dict[Any, int] = {}
        done: dict[int, bytes | Died] = {}
        idle: list[Any] = list(reversed(self._links))
        turn, more = 0, True
        while True:
            while idle and more:
                number, task = next(left, (-1, b""))
                more = number >= 0
                if more:
                    link = idle.pop()
                    link.send_bytes(task)
                    busy[link] = number
            while turn in done:
                yield done.pop(turn)
                turn += 1
            if not busy:
                return
            for link in wait(list(busy)):
                done[busy.pop(link)] = _answer(link)
                idle.append(link)

    def _fork(self) -> None:
        program = os.getpid()
        with _FORKING:
            here, there = Pipe()
            pid = _fork()
        if pid == 0:
            try:
                here.close()
                for link in self._links:
                    link.close()
                for file in self._apart:
                    os.close(file)
                _leave(program)
                _serve(self._work, there, self._patience_s)
            finally:
                os._exit(0)
        there.close()
        self._links.append(here)
        self._pids.append(pid)


def in_process(work: Callable[[bytes], bytes], task: bytes, patience_s: float | None = None) -> bytes | Died:
    """Carry out one task in a process of its own, and wait for it. Can be called from any thread.

    Raises:
      UsageError: the system has no fork.
    """
    _need_fork()
    return _read_answer(_carried_out(work, task, patience_s, _leave))


def _need_fork() -> None:
    if not hasattr(os, "fork"):
        raise UsageError("tuning and sweeps run in forked processes, which this system does not have")


def _fork() -> int:
    with warnings.catch_warnings(), _one_thread_of_opencv():
        warnings.simplefilter("ignore", DeprecationWarning)  # threads: the fork uses none of their locks
        return os.fork()


@contextlib.contextmanager
def _one_thread_of_opencv() -> Iterator[None]:
    """End the threads of OpenCV: a fork that has none of them waits for them, or crashes as it ends them.

    They start again in the program when they are needed. A forked process uses one thread.
    """
    opencv: Any = sys.modules.get("cv2")
    threads = opencv.getNumThreads() if hasattr(opencv, "getNumThreads") else 1
    if threads == 1:
        yield
        return
    program = os.getpid()
    opencv.setNumThreads(1)
    try:
        yield
    finally:
        if os.getpid() == program:
            opencv.setNumThreads(threads)


def _answer(link: Any) -> bytes | Died:
    try:
        said: bytes = link.recv_bytes()
    except (EOFError, OSError):
        raise HfgError("a process that evaluates has ended, and nothing says why; start again to continue") from None
    return _read_answer(said)


def _read_answer(said: bytes) -> bytes | Died:
    kind, rest = said[:1], said[1:]
    return rest if kind == _DONE else Died(rest.decode(errors="replace"), late=kind == _LATE)


# --- in the worker ----------------------------------------------------------------------------------------------------


def _leave(program: int) -> None:
    """Leave the program: its garbage, its loop, its streams, its handlers of signals, its logs."""
    gc.freeze()  # garbage may have finalizers that wait for threads of the program
    with contextlib.suppress(OSError):
        os.setpgid(0, 0)  # Ctrl-C is for the program that asks, which ends this group
    _die_with_parent(program)
    asyncio.events._set_running_loop(None)
    signal.set_wakeup_fd(-1)  # else a signal to this process wakes the loop of the program
    for number in signal.valid_signals():
        if callable(signal.getsignal(number)):
            signal.signal(number, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(nowhere, stream)
    # Another thread may just have written to the old ones and hold their locks, and handlers of logs write to them.
    logging.disable(sys.maxsize)
    sys.stdin, sys.stdout, sys.stderr = (open(nowhere, mode, closefd=False) for mode in "rww")  # noqa: SIM115


def _serve(work: Callable[[bytes], bytes], link: Any, patience_s: float | None) -> None:
    """Fork a process for each task, until there are no more."""
    while True:
        try:
            task = link.recv_bytes()
        except (EOFError, OSError):
            return
        link.send_bytes(_carried_out(work, task, patience_s, lambda worker: _leave_worker(link, worker)))


def _leave_worker(link: Any, worker: int) -> None:
    link.close()  # who asks sees it closed as soon as the worker is gone
    _die_with_parent(worker)


def _carried_out(
    work: Callable[[bytes], bytes], task: bytes, patience_s: float | None, leave: Callable[[int], None]
) -> bytes:
    """Fork a process, let it leave this one, whose number it gets, and do the work in it."""
    parent = os.getpid()
    with _FORKING:
        reader, writer = os.pipe()
        pid = _fork()
        if pid:
            os.close(writer)
    if pid == 0:
        code = 1
        try:
            os.close(reader)
            leave(parent)
            _write(writer, _DONE + contextvars.Context().run(work, task))
            code = 0
        except BaseException:
            _write(writer, _DIED + traceback.format_exc().strip().rpartition("\n")[2].encode())
        finally:
            os._exit(code)
    said, late = _read(reader, patience_s)
    os.close(reader)
    if late:
        os.kill(pid, signal.SIGKILL)
    _, status = os.waitpid(pid, 0)
    if late:
        return _LATE + f"it took longer than {patience_s:g} s".encode()
    code = os.waitstatus_to_exitcode(status)
    if code == 0 and said[:1] == _DONE:
        return said
    if said[:1] == _DIED and code == 1:
        return said
    how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
    return _DIED + f"its process ended by {how}".encode()


def _read(reader: int, patience_s: float | None) -> tuple[bytes, bool]:
    """Read until the other end is closed. Return what came, and whether that took too long."""
    pieces: list[bytes] = []
    ends_at = None if patience_s is None else time.monotonic() + patience_s
    while True:
        left = None if ends_at is None else max(ends_at - time.monotonic(), 0.0)
        if not select.select((reader,), (), (), left)[0]:
            return b"", True
        piece = os.read(reader, _PIECE)
        if not piece:
            return b"".join(pieces), False
        pieces.append(piece)


def _write(writer: int, data: bytes) -> None:
    left = memoryview(data)
    while left:
        left = left[os.write(writer, left) :]


def _die_with_parent(parent: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_WITH_PARENT, signal.SIGKILL)
    if os.getppid() != parent:  # it was faster
        os._exit(1)
