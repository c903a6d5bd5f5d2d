"""Tries many node types, in processes of their own: `python -m hfg.testing.usable [MODULE or REFERENCE ...]`.

A type that ends its process, or never comes back, is named and the others go on in a new one. Memory is bounded, the
heap is checked where the C library can, there is no standard input, and what the nodes print goes nowhere. Depends on
`trying` and the catalogue.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import queue
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final, NamedTuple

import msgspec

from hfg import catalogue
from hfg.testing.trying import NotUsable, Trial, try_type

__all__ = ["HEAP", "death", "main", "references_of", "try_all"]

_MEMORY_BYTES: Final = 12 << 30  # of addresses, most of which libraries only reserve
_FILE_BYTES: Final = 64 << 20
_SUSPECTS: Final = 20
_STOPPED: Final = "did not come back within"
HEAP: Final = (
    {"MALLOC_CHECK_": "3", "LD_PRELOAD": "libc_malloc_debug.so.0"} if platform.libc_ver()[0] == "glibc" else {}
)
"""Lets glibc look after each block that is given back, so that who writes beyond one is stopped while it does it."""


def try_all(
    references: Iterable[str],
    *,
    firings: int = 3,
    seed: int = 0,
    limit_s: float = 60.0,
    confirm: bool = True,
    processes: int = 1,
) -> list[Trial]:
    """Try node types in processes of their own, and give what became of each, in their order.

    Args:
      references: "module:name" each.
      firings: as for `try_type`.
      seed: as for `try_type`.
      limit_s: of processor time for one type, and four times as long by the clock, for one that waits; a type that
        takes longer is stopped and named.
      confirm: a type that ended its process, or was stopped, is tried once more by itself. If it is well then, so it is
        called if it was stopped; if it had ended its process, those before it are tried alone too, to find who did the
        harm.
      processes: how many at once; each has its share of the types.
    """
    every = list(references)
    how = _How(firings, seed, limit_s)
    shares = [every[first::processes] for first in range(processes)]
    with ThreadPoolExecutor(processes) as pool:
        found = list(pool.map(lambda share: _share(share, how, confirm), shares))
    return [found[index % processes][index // processes] for index in range(len(every))]


class _How(NamedTuple):
    """How each process tries what it is given."""

    firings: int
    seed: int
    limit_s: float


def _share(references: Sequence[str], how: _How, confirm: bool) -> list[Trial]:
    """Try types one after the other; after a death the next one is in a new process."""
    left = list(references)
    done: list[Trial] = []
    while left:
        trials, died = _process(left, how)
        done += trials
        left = left[len(trials) :]
        if died and left:
            culprit = left.pop(0)
            before = [trial.reference for trial in trials]
            done.append(_confirmed(culprit, died, before, how) if confirm else _dead(culprit, died))
    return done


def _dead(reference: str, died: str) -> Trial:
    return Trial(reference, fault=f"{reference}: {died}")


def _confirmed(reference: str, died: str, before: Sequence[str], how: _How) -> Trial:
    """Retry a type that died by itself; if it survives, retry those before it, too.

    The effect of one type on the heap may end another.
    """
    alone, again = _process([reference], how)
    if again:
        return _dead(reference, again)
    if died.startswith(_STOPPED):
        return alone[0]  # it was the load of the machine, or what the others had left behind
    suspects = list(reversed(before))[:_SUSPECTS]
    found = [f"{one} alone {death}" for one in suspects for death in [_process([one], how)[1]] if death]
    if found:
        return _dead(reference, f"{died}, but not alone; of those before it, {'; '.join(found)}")
    said = f", and none of these does alone: {', '.join(reversed(suspects))}" if suspects else ""
    return _dead(reference, f"{died}, but not alone{said}")


def _process(references: Sequence[str], how: _How) -> tuple[list[Trial], str]:
    """Try types in one process; give those that came back, and how it died ("" if it did not)."""
    settings = {"--firings": how.firings, "--seed": how.seed, "--limit": how.limit_s}
    command = [sys.executable, "-m", "hfg.testing.usable", "--worker"]
    command += [str(word) for setting in settings.items() for word in setting]
    patience_s = 4 * how.limit_s
    trials: list[Trial] = []
    with (
        tempfile.TemporaryDirectory(prefix="hfg-usable-") as folder,
        tempfile.TemporaryFile("w+") as told,
        subprocess.Popen(
            command,
            cwd=folder,
            env={**os.environ, **HEAP, "PYTHONPATH": os.pathsep.join(one or os.getcwd() for one in sys.path)},  # noqa: PTH109
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=told,
            text=True,
        ) as process,
    ):
        lines: queue.Queue[str] = queue.Queue()
        reader = threading.Thread(target=_read, args=(process, lines), daemon=True)
        reader.start()
        assert process.stdin is not None
        process.stdin.write(json.dumps(list(references)))
        process.stdin.close()
        while len(trials) < len(references):
            try:
                line = lines.get(timeout=patience_s if trials else patience_s + 30)  # the first has to import all
            except queue.Empty:
                process.kill()
                return trials, f"{_STOPPED} {patience_s:g} s"
            except KeyboardInterrupt:
                process.kill()
                raise
            if not line:
                told.seek(0)
                return trials, _end(process.wait(), told.read(), how)
            trials.append(msgspec.json.decode(line, type=Trial))
        process.wait()
    return trials, ""


def _end(code: int, told: str, how: _How) -> str:
    if code == -signal.SIGXCPU:
        return f"{_STOPPED} {how.limit_s:g} s of processor time"
    return death(code, told)


def _read(process: subprocess.Popen[str], lines: queue.Queue[str]) -> None:
    assert process.stdout is not None
    for line in process.stdout:
        lines.put(line)
    lines.put("")


def death(code: int, told: str) -> str:
    """Say how a process ended, by its exit code and the last line that it wrote."""
    last = next((line for line in reversed(told.splitlines()) if line.strip()), "")
    if code < 0:
        name = signal.Signals(-code).name if -code in {one.value for one in signal.Signals} else str(-code)
        return f"ended its process by {name}" + (f" ({last:.200})" if last else "")
    return f"ended its process with exit code {code}" + (f" ({last:.200})" if last else "")


def _work(how: _How) -> None:
    """Be the process: take references from standard input, write a line for each type that came back."""
    references = json.load(sys.stdin)
    answers = os.fdopen(os.dup(1), "w")
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1):
        os.dup2(nowhere, stream)
    for one in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1, signal.SIGUSR2):
        signal.signal(one, lambda *_: None)  # there are nodes that raise them, and that is no crash
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_FSIZE, (_FILE_BYTES, _FILE_BYTES))
    hardest = resource.getrlimit(resource.RLIMIT_CPU)[1]
    for reference in references:
        # The kernel ends it by SIGXCPU: a loop inside of C code sees no other signal's handler.
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(time.process_time() + how.limit_s), hardest))
        try:
            trial = try_type(reference, firings=how.firings, seed=how.seed, shrink=False)
        except NotUsable as error:
            trial = Trial(reference, fault=str(error))
        except BaseException as error:  # also what leaves the program
            trial = Trial(reference, fault=f"{reference}: {type(error).__name__}: {error}")
        answers.write(msgspec.json.encode(trial).decode() + "\n")
        answers.flush()


def main(arguments: Sequence[str] | None = None) -> int:
    """Try what is named, else all that is installed; tell what is not usable. Exit code 1 if there is any."""
    parser = argparse.ArgumentParser(prog="python -m hfg.testing.usable", description=main.__doc__)
    parser.add_argument("what", nargs="*", help="a module, or a reference module:name; without it all there is")
    parser.add_argument("--firings", type=int, default=3, help="of each node (3)")
    parser.add_argument("--seed", type=int, default=0, help="other values with each (0)")
    parser.add_argument("--limit", type=float, default=60.0, help="seconds of processor time for one type (60)")
    parser.add_argument("--processes", type=int, default=1, help="how many at once (1)")
    parser.add_argument("--json", action="store_true", help="write what became of each type as JSON")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.worker:
        _work(_How(given.firings, given.seed, given.limit))
        return 0
    references, problems = references_of(given.what)
    trials = try_all(references, firings=given.firings, seed=given.seed, limit_s=given.limit, processes=given.processes)
    if given.json:
        sys.stdout.write(msgspec.json.format(msgspec.json.encode(trials), indent=2).decode() + "\n")
        return int(bool(problems) or any(trial.fault for trial in trials))
    for line in [*problems, *(trial.fault for trial in trials if trial.fault)]:
        sys.stdout.write(f"{line}\n")
    usable = sum(trial.usable for trial in trials)
    sys.stdout.write(f"{usable} of {len(trials)} node types are usable\n")
    return int(bool(problems) or usable < len(trials))


def references_of(what: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the references of what is named, else of all that is installed; and a sentence for each broken place."""
    found = [catalogue.installed()] if not what else []
    found += [catalogue.types_of(one) for one in what if ":" not in one]
    references: dict[str, Any] = dict.fromkeys(one.reference for each in found for one in each.types)
    references.update(dict.fromkeys(one for one in what if ":" in one))
    return list(references), [problem for each in found for problem in each.problems]


if __name__ == "__main__":
    sys.exit(main())
