"""Calls node types with hostile values: `python -m hfg.testing.enduring [MODULE or REFERENCE ...]`.

Each type has a process of its own, forked from one that has imported everything. A call is known by its number: what
ends the process, or does not return, is named with the arguments that caused it, and the calls after it continue in a
new process. Whatever a node raises is fine here; `usable` checks errors against what is declared.
Builds on `hostile`, `firing` and the catalogue.
"""

from __future__ import annotations

import argparse
import contextlib
import mmap
import os
import resource
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

import msgspec
import numpy as np

from hfg.ports.specs import REQUIRED
from hfg.registry import find
from hfg.testing.firing import fire
from hfg.testing.hostile import Hostile
from hfg.testing.samples import sample_folder
from hfg.testing.usable import HEAP, death, references_of
from hfg.types import describe_value

__all__ = ["Death", "Endured", "endure", "main"]

_MEMORY_BYTES: Final = 6 << 30
_FILE_BYTES: Final = 64 << 20
_STARTING_S: Final = 120.0
_IN_A_ROW: Final = 4
"""Firings of one node before the next is made: state of one call may harm a later one."""


class Death(msgspec.Struct, frozen=True):
    """A call that ended its process, or did not return.

    Attributes:
      call: its number; with the seed and the reference it is made again.
      how: "ended its process by SIGSEGV".
      what: the call, as a user would write it.
    """

    call: int
    how: str
    what: str


class Endured(msgspec.Struct, frozen=True):
    """The result for a type.

    Attributes:
      calls: how many were made.
      refused: how many of them raised.
      deaths: the first few.
      seconds: how long it took.
    """

    reference: str
    calls: int = 0
    refused: int = 0
    deaths: tuple[Death, ...] = ()
    seconds: float = 0.0


def endure(
    references: Iterable[str],
    *,
    calls: int = 100,
    seed: int = 0,
    limit_s: float = 20.0,
    most_deaths: int = 5,
    processes: int = 1,
    within_s: float = 3600.0,
    tell: Callable[[Endured], None] | None = None,
) -> list[Endured]:
    """Call node types with hostile values; return what became of each, in their order.

    Args:
      references: "module:name" each.
      calls: of each type.
      seed: other values with each.
      limit_s: of processor time for one call.
      most_deaths: of a type, before it is given up.
      processes: how many at once; each has its share of the types.
      within_s: of processor time for one type; a slow one is called less often, and `calls` says how often.
      tell: is called with each, as soon as it is done; from several threads if there are several processes.

    Raises:
      RuntimeError: the process that forks the others cannot be started; the message has what it wrote.
    """
    every = list(references)
    shares = [every[first::processes] for first in range(processes)]
    task = _Task([], calls, seed, limit_s, most_deaths, within_s)
    with ThreadPoolExecutor(processes) as pool:
        tasks = [msgspec.structs.replace(task, references=share) for share in shares]
        done = list(pool.map(lambda one: _share(one, tell), tasks))
    return [done[index % processes][index // processes] for index in range(len(every))]


class _Task(msgspec.Struct):
    """What a worker does."""

    references: list[str]
    calls: int
    seed: int
    limit_s: float
    most_deaths: int
    within_s: float


def _share(task: _Task, tell: Callable[[Endured], None] | None) -> list[Endured]:
    """Run a worker. It is a new program, because the C library's checks of the heap are chosen as a program starts."""
    found: list[Endured] = []
    with (
        tempfile.TemporaryFile("w+b") as told,
        subprocess.Popen(
            [sys.executable, "-m", "hfg.testing.enduring", "--worker"],
            env={**os.environ, **HEAP, "PYTHONPATH": os.pathsep.join(one or os.getcwd() for one in sys.path)},  # noqa: PTH109
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=told,
        ) as worker,
    ):
        assert worker.stdin is not None
        assert worker.stdout is not None
        worker.stdin.write(msgspec.json.encode(task))
        worker.stdin.close()
        for line in worker.stdout:
            found.append(msgspec.json.decode(line, type=Endured))
            if tell is not None:
                tell(found[-1])
        if worker.wait() != 0 or len(found) < len(task.references):
            told.seek(0)
            words = told.read().decode(errors="replace")[-2000:]
            raise RuntimeError(f"the process that calls node types failed after {len(found)} of them: {words}")
    return found


def _work() -> None:
    """Be the worker: fork a child for each type."""
    task = msgspec.json.decode(sys.stdin.buffer.read(), type=_Task)
    for reference in task.references:
        find(reference)
    with contextlib.suppress(ImportError):
        import cv2

        cv2.setNumThreads(1)  # threads do not survive a fork
    with sample_folder():
        pass  # what is in it is made once, and not by each child
    with os.fdopen(os.dup(1), "wb") as answers:
        for reference in task.references:
            answers.write(msgspec.json.encode(_Watch(reference, task).watch()) + b"\n")
            answers.flush()


class _Watch:
    """Runs the calls of one type in forked processes, one after another's death."""

    def __init__(self, reference: str, task: _Task) -> None:
        self._reference = reference
        self._task = task
        self._shared = mmap.mmap(-1, 16)
        self._deaths: list[Death] = []
        self._spent_s = 0.0

    def watch(self) -> Endured:
        start = 0
        while start < self._task.calls and self._spent_s < self._task.within_s:
            status, told = self._forked(start)
            call = max(start, self._shown()[0])
            if status == "":
                start = call
                break
            self._deaths.append(Death(call, status + told, self._arguments(call)))
            if len(self._deaths) >= self._task.most_deaths:
                start = call + 1
                break
            start = call + 1
        return Endured(self._reference, start, self._shown()[1], tuple(self._deaths), self._spent_s)

    def _shown(self) -> tuple[int, int]:
        call, refused = struct.unpack("qq", self._shared[:16])
        return call, refused

    def _forked(self, start: int) -> tuple[str, str]:
        """Run calls from `start` on in a child; return how it died, "" if it did not, and its last words."""
        began = time.monotonic()
        self._shared[:8] = struct.pack("q", start - 1)  # until the first call is made
        with tempfile.TemporaryFile() as told:
            pid = os.fork()
            if pid == 0:
                code = 1
                try:
                    self._child(start, told.fileno())
                    code = 0
                finally:
                    os._exit(code)
            status = self._waited(pid, start - 1)
            told.seek(0)
            words = told.read().decode(errors="replace")
        self._spent_s += time.monotonic() - began
        return (status, "") if not status or status.startswith("did not") else (death(int(status), words), "")

    def _waited(self, pid: int, before: int) -> str:
        """Wait for the child, and end it when one call takes too long; `before` is the number before its first."""
        last, since = -1, time.monotonic()
        pause_s = 0.001
        while True:
            done, status = os.waitpid(pid, os.WNOHANG)
            if done:
                code = os.waitstatus_to_exitcode(status)
                return "" if code == 0 else str(code)
            call = self._shown()[0]
            if call != last:
                last, since = call, time.monotonic()
            elif time.monotonic() - since > (4 * self._task.limit_s if call > before else _STARTING_S):
                os.kill(pid, signal.SIGKILL)
                os.waitpid(pid, 0)
                return f"did not return within {4 * self._task.limit_s:g} s"
            time.sleep(pause_s)
            pause_s = min(0.05, 2 * pause_s)

    def _child(self, start: int, errors: int) -> None:
        """Make the calls; the number of each is in shared memory before it starts."""
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1):
            os.dup2(nowhere, stream)
        os.dup2(errors, 2)
        for one in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1, signal.SIGUSR2):
            signal.signal(one, lambda *_: None)  # there are nodes that raise them
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
        resource.setrlimit(resource.RLIMIT_FSIZE, (_FILE_BYTES, _FILE_BYTES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        refused = self._shown()[1]
        until = time.process_time() + self._task.within_s - self._spent_s
        with sample_folder(), np.errstate(all="ignore"):
            calls = _Calls(self._reference, self._task.seed)
            number = start
            while number < self._task.calls and time.process_time() < until:
                self._shared[:16] = struct.pack("qq", number, refused)
                refused += not calls.call(number)
                number += 1
            calls.close()
            self._shared[:16] = struct.pack("qq", number, refused)

    def _arguments(self, call: int) -> str:
        return _Calls(self._reference, self._task.seed).shown(call)


class _Calls:
    """The calls of one type; each belongs to its number."""

    def __init__(self, reference: str, seed: int) -> None:
        self._reference = reference
        self._origin: Any = find(reference)
        self._type = self._origin._type
        self._seed = seed
        self._node: Any = None

    def _drawn(self, number: int) -> tuple[dict[str, Any], Hostile]:
        """Draw the parameters, which are shared by several calls, and return the generator of values."""
        row = Hostile(f"{self._reference} {self._seed} row {number // _IN_A_ROW}", guards=False)
        given = {name: spec for name, spec in self._type.parameters.items() if spec.is_given}
        parameters = {
            name: row.parameter(spec) for name, spec in given.items() if spec.default is REQUIRED or row.chance(60)
        }
        draw = Hostile(f"{self._reference} {self._seed} {number}")
        return parameters, draw

    def _values(self, own: Any, draw: Hostile) -> tuple[str | None, dict[str, Any]]:
        slots = [name for name, spec in own.slots.items() if spec.handler_name]
        if slots and (own.process_kind == "none" or draw.chance(30)):
            slot = slots[draw.number(len(slots))]
            spec = own.slots[slot]
            return slot, {"value": draw.value(spec.type)} if spec.takes_value else {}
        return None, {
            name: draw.value(spec.type) for name, spec in own.inputs.items() if not spec.optional or draw.chance(70)
        }

    def call(self, number: int) -> bool:
        """Make a call; say whether the node took it."""
        parameters, draw = self._drawn(number)
        try:
            if self._node is None or number % _IN_A_ROW == 0:
                self.close()
                self._node = self._origin(**parameters)
            slot, values = self._values(self._node._type, draw)
            fire(self._node, debug=False, slot=slot, **values)
        except Exception:
            self.close()
            return False
        return True

    def close(self) -> None:
        if self._node is not None:
            with contextlib.suppress(Exception):
                fire(self._node, hook="teardown")
            self._node = None

    def shown(self, number: int) -> str:
        """Write a call as a user would."""
        parameters, draw = self._drawn(number)
        title = self._reference.partition(":")[2]
        given = ", ".join(f"{name}={value!r:.80}" for name, value in parameters.items())
        try:
            own = self._origin(**parameters)._type
            slot, values = self._values(own, draw)
        except Exception as error:
            return f"{title}({given}), which raises {error}"
        said = [f"{title}({given})", *([f"slot={slot!r}"] if slot else [])]
        return f"fire({', '.join([*said, *(f'{name}={_short(value)}' for name, value in values.items())])})"


def _short(value: Any) -> str:
    if not isinstance(value, np.ndarray):
        return f"{value!r:.200}"
    said = describe_value(value)
    if value.dtype.kind == "f" and value.size:
        counts = {
            "NaN": int(np.isnan(value).sum()),
            "infinite": int(np.isinf(value).sum()),
            "denormal": int(((value != 0) & (np.abs(value) < np.finfo(value.dtype).tiny)).sum()),
        }
        said += "".join(f", {count} {name}" for name, count in counts.items() if count)
        finite = value[np.isfinite(value)]
        said += f", {finite.min():g} to {finite.max():g}" if finite.size else ""
    elif value.dtype.kind in "ui" and value.size:
        said += f", {value.min()} to {value.max()}"
    if not value.flags.c_contiguous:
        said += f", strides {value.strides}"
    return f"<{said}>"


def main(arguments: Sequence[str] | None = None) -> int:
    """Call what is named, else all that is installed; report deaths. Exit code 1 if there are any."""
    parser = argparse.ArgumentParser(prog="python -m hfg.testing.enduring", description=main.__doc__)
    parser.add_argument("what", nargs="*", help="a module, or a reference module:name; without it all there is")
    parser.add_argument("--calls", type=int, default=100, help="of each type (100)")
    parser.add_argument("--seed", type=int, default=0, help="other values with each (0)")
    parser.add_argument("--limit", type=float, default=20.0, help="seconds of processor time for one call (20)")
    parser.add_argument("--within", type=float, default=3600.0, help="seconds of processor time for one type (3600)")
    parser.add_argument("--deaths", type=int, default=5, help="of a type, before it is given up (5)")
    parser.add_argument("--processes", type=int, default=1, help="how many at once (1)")
    parser.add_argument("--verbose", "-v", action="store_true", help="write a line for each type as soon as it is done")
    parser.add_argument("--json", action="store_true", help="write what became of each type as JSON")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.worker:
        _work()
        return 0
    references, problems = references_of(given.what)
    found = endure(
        references,
        calls=given.calls,
        seed=given.seed,
        limit_s=given.limit,
        most_deaths=given.deaths,
        processes=given.processes,
        within_s=given.within,
        tell=None if given.json else _all_told if given.verbose else _told,
    )
    died = [one for one in found if one.deaths]
    if given.json:
        sys.stdout.write(msgspec.json.format(msgspec.json.encode(found), indent=2).decode() + "\n")
        return int(bool(problems or died))
    for line in problems:
        sys.stdout.write(f"{line}\n")
    least = min((one.calls for one in found), default=0)
    sys.stdout.write(
        f"{len(found) - len(died)} of {len(found)} node types endured {sum(one.calls for one in found)} calls, "
        f"at least {least} each; {sum(one.refused for one in found)} were refused\n"
    )
    return int(bool(problems or died))


def _told(endured: Endured) -> None:
    for each in endured.deaths:
        sys.stdout.write(f"{endured.reference}: call {each.call} {each.how}: {each.what}\n")
    sys.stdout.flush()


def _all_told(endured: Endured) -> None:
    _told(endured)
    sys.stdout.write(
        f"{endured.reference}: {endured.calls} calls in {endured.seconds:.1f} s, {endured.refused} refused\n"
    )
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
