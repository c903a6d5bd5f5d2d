"""Tries many node types in processes of their own: `python -m hfg.testing.usable [MODULE or REFERENCE ...]`.

A process tries a few types, because a fork takes as long as trying one. A type that is not usable there, and all types
of a process that died, are tried again, each in a process of its own.

Depends on `trying` and `separate`.
"""

from __future__ import annotations

import math
import os
import resource
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from typing import BinaryIO, Final

import msgspec

from hfg.testing.separate import STOPPED, common_arguments, forked, in_processes, references_of, serve
from hfg.testing.trying import NotUsable, Trial, try_type

__all__ = ["main", "try_all"]

_MEMORY_BYTES: Final = 12 << 30
_TOO_LONG: Final = "ended its process by SIGXCPU"
_TOGETHER: Final = 16
"""Types that one process tries at first."""


class _How(msgspec.Struct):
    """See `try_all`."""

    firings: int
    seed: int
    limit_s: float
    confirm: bool


def try_all(
    references: Iterable[str],
    *,
    firings: int = 3,
    seed: int = 0,
    limit_s: float = 60.0,
    confirm: bool = True,
    processes: int = 1,
) -> list[Trial]:
    """Try node types in processes of their own. Return the results in their order.

    Args:
      references: "module:name" each.
      firings: as for `try_type`.
      seed: as for `try_type`.
      limit_s: seconds of CPU time for one type, and four times as many by the clock; then the type is stopped.
      confirm: a type that was stopped is tried once more, in case the load of the machine was the reason.
      processes: number of types at a time.

    Raises:
      RuntimeError: a worker has failed; the message has what it wrote.
    """
    how = _How(firings, seed, limit_s, confirm)
    return in_processes("hfg.testing.usable", references, how, Trial, processes=processes)


def _all_tried(references: list[str], how: _How) -> Iterator[Trial]:
    for first in range(0, len(references), _TOGETHER):
        some = references[first : first + _TOGETHER]
        usable = {trial.reference: trial for trial in _tried_together(some, how) if trial.usable}
        yield from (usable.get(one) or _tried(one, how) for one in some)


def _tried_together(references: list[str], how: _How) -> list[Trial]:
    """Try types one after the other in a forked process; return nothing if it dies, whichever type is the reason."""
    with tempfile.TemporaryFile() as answers:

        def try_them() -> None:
            for reference in references:
                _try(reference, how, answers)

        def done() -> int:
            return os.fstat(answers.fileno()).st_size

        if forked(try_them, lambda _: 4 * how.limit_s, done, memory_bytes=_MEMORY_BYTES):
            return []
        answers.seek(0)
        return [msgspec.json.decode(line, type=Trial) for line in answers]


def _tried(reference: str, how: _How) -> Trial:
    """Try a type in a forked process of its own."""
    for _ in range(1 + how.confirm):
        with tempfile.TemporaryFile() as answer:
            died = forked(
                lambda answer=answer: _try(reference, how, answer),  # type: ignore[misc]
                lambda _: 4 * how.limit_s,
                memory_bytes=_MEMORY_BYTES,
            )
            if not died:
                answer.seek(0)
                return msgspec.json.decode(answer.read(), type=Trial)
        if died.startswith(_TOO_LONG):
            died = f"{STOPPED} {how.limit_s:g} s of CPU time"
        if not died.startswith(STOPPED):
            break
    return Trial(reference, fault=f"{reference}: {died}")


def _try(reference: str, how: _How, answer: BinaryIO) -> None:
    """Try a type in this process, and write its trial."""
    hardest = resource.getrlimit(resource.RLIMIT_CPU)[1]
    # The kernel ends it by SIGXCPU, because a loop in C code never runs the handler of another signal.
    resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(time.process_time() + how.limit_s), hardest))
    try:
        trial = try_type(reference, firings=how.firings, seed=how.seed, shrink=False)
    except NotUsable as error:
        trial = Trial(reference, fault=str(error))
    except BaseException as error:  # including those that leave the program
        trial = Trial(reference, fault=f"{reference}: {type(error).__name__}: {error}")
    os.write(answer.fileno(), msgspec.json.encode(trial) + b"\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Try node types, and report those that are not usable. The exit code is 1 if there are any."""
    parser = common_arguments("hfg.testing.usable", main.__doc__)
    parser.add_argument("--firings", type=int, default=3, help="firings of each node (3)")
    parser.add_argument("--limit", type=float, default=60.0, help="seconds of CPU time for one type (60)")
    given = parser.parse_args(arguments)
    if given.worker:
        try_type("hfg.testing.nodes:double")  # the first trial of a process takes a second, a later one 30 ms
        serve(_How, _all_tried)
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


if __name__ == "__main__":
    sys.exit(main())
