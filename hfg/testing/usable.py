"""Tries many node types, in processes of their own: `python -m hfg.testing.usable [MODULE or REFERENCE ...]`.

A type that ends its process, or never comes back, is named and the others go on in a new one. Memory is bounded, there
is no standard input, and what the nodes print goes nowhere.
Stands on `trying` and the catalogue.
"""

from __future__ import annotations

import argparse
import json
import os
import queue
import resource
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterable, Sequence
from typing import Any, Final

import msgspec

from hfg import catalogue
from hfg.testing.trying import NotUsable, Trial, try_type

__all__ = ["main", "try_all"]

_MEMORY_BYTES: Final = 12 << 30  # of addresses, most of which libraries only reserve
_FILE_BYTES: Final = 64 << 20


def try_all(
    references: Iterable[str], *, firings: int = 3, seed: int = 0, limit_s: float = 60.0, confirm: bool = True
) -> list[Trial]:
    """Try node types in processes of their own, and give what became of each, in their order.

    Args:
      references: "module:name" each.
      firings: as for `try_type`.
      seed: as for `try_type`.
      limit_s: for one type; one that takes longer is stopped and named.
      confirm: a type that ended its process is tried alone once more, for the one before it may have done the harm.
    """
    left = list(references)
    done: list[Trial] = []
    while left:
        trials, died = _process(left, firings, seed, limit_s)
        done += trials
        left = left[len(trials) :]
        if died and left:
            fault = died
            if confirm and len(trials) and not _process(left[:1], firings, seed, limit_s)[1]:
                before = ", ".join(trial.reference for trial in trials[-3:])
                fault = f"{died}, but not alone: those before it were {before}"
            done.append(Trial(left[0], fault=f"{left.pop(0)}: {fault}"))
    return done


def _process(references: Sequence[str], firings: int, seed: int, limit_s: float) -> tuple[list[Trial], str]:
    """Try types in one process; give those that came back, and how it died ("" if it did not)."""
    command = [sys.executable, "-m", "hfg.testing.usable", "--worker", "--firings", str(firings), "--seed", str(seed)]
    trials: list[Trial] = []
    with (
        tempfile.TemporaryDirectory(prefix="hfg-usable-") as folder,
        tempfile.TemporaryFile("w+") as told,
        subprocess.Popen(
            command,
            cwd=folder,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(one or os.getcwd() for one in sys.path)},  # noqa: PTH109
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
                line = lines.get(timeout=limit_s if trials else limit_s + 30)  # the first has to import all
            except queue.Empty:
                process.kill()
                return trials, f"did not come back within {limit_s:g} s"
            except KeyboardInterrupt:
                process.kill()
                raise
            if not line:
                told.seek(0)
                return trials, _death(process.wait(), told.read())
            trials.append(msgspec.json.decode(line, type=Trial))
        process.wait()
    return trials, ""


def _read(process: subprocess.Popen[str], lines: queue.Queue[str]) -> None:
    assert process.stdout is not None
    for line in process.stdout:
        lines.put(line)
    lines.put("")


def _death(code: int, told: str) -> str:
    last = next((line for line in reversed(told.splitlines()) if line.strip()), "")
    if code < 0:
        name = signal.Signals(-code).name if -code in {one.value for one in signal.Signals} else str(-code)
        return f"ended its process by {name}" + (f" ({last:.200})" if last else "")
    return f"ended its process with exit code {code}" + (f" ({last:.200})" if last else "")


def _work(firings: int, seed: int) -> None:
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
    for reference in references:
        try:
            trial = try_type(reference, firings=firings, seed=seed, shrink=False)
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
    parser.add_argument("--limit", type=float, default=60.0, help="seconds for one type (60)")
    parser.add_argument("--json", action="store_true", help="write what became of each type as JSON")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    if given.worker:
        _work(given.firings, given.seed)
        return 0
    references, problems = _references(given.what)
    trials = try_all(references, firings=given.firings, seed=given.seed, limit_s=given.limit)
    if given.json:
        sys.stdout.write(msgspec.json.format(msgspec.json.encode(trials), indent=2).decode() + "\n")
        return int(bool(problems) or any(trial.fault for trial in trials))
    for line in [*problems, *(trial.fault for trial in trials if trial.fault)]:
        sys.stdout.write(f"{line}\n")
    usable = sum(trial.usable for trial in trials)
    sys.stdout.write(f"{usable} of {len(trials)} node types are usable\n")
    return int(bool(problems) or usable < len(trials))


def _references(what: Sequence[str]) -> tuple[list[str], list[str]]:
    found = [catalogue.installed()] if not what else []
    found += [catalogue.types_of(one) for one in what if ":" not in one]
    references: dict[str, Any] = dict.fromkeys(one.reference for each in found for one in each.types)
    references.update(dict.fromkeys(one for one in what if ":" in one))
    return list(references), [problem for each in found for problem in each.problems]


if __name__ == "__main__":
    sys.exit(main())
