"""A file with a line for each run of a search, so that one that was killed continues where it was.

The optimiser is not in it: a search that continues asks a new one with the same seed, and the journal answers for what
was run before. Lines are JSON of a declared type, read within bounds (rule L4). Depends on `evaluating`.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from hfg.base.bounds import JOURNAL_BYTES
from hfg.base.places import Place, need_own
from hfg.encoding.plain import need_few_values
from hfg.errors import UsageError
from hfg.tuning.evaluating import Outcome


class Header(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The first line: which search it is. All of it must be the same when the search continues.

    Attributes:
      journal: the version of the form.
      graph: the name of the graph.
      parameters: as users wrote them.
      scores: likewise, each after "minimize" or "maximize".
      seeds: of each candidate's runs.
      constraints: the names of the monitors.
      happenings: what happens in each run.
      method: of the search.
      seed: of the method.
      batch: candidates of a generation, if the user chose it.
      until_s: when each run ends.
    """

    journal: int
    graph: str
    parameters: list[str]
    scores: list[str]
    seeds: list[int | None]
    constraints: list[str]
    happenings: list[str]
    method: str
    seed: int
    batch: int | None
    until_s: float | None


class Line(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One run.

    Attributes:
      candidate: its number.
      seed: of the run.
      at: the candidate, a number from 0 to 1 for each cell.
      outcome: how it went.
      scores: what it gave.
      why: a sentence, if it went wrong.
      simulated_s: how long the run lasted on its own clock.
      values: for readers, in JSON; the search does not use them.
    """

    candidate: int
    seed: int | None
    at: list[float]
    outcome: Outcome
    scores: list[float]
    why: str
    simulated_s: float
    values: msgspec.Raw = msgspec.Raw(b"{}")


class Journal:
    """The journal of one search; without a path it is kept in memory only."""

    def __init__(self, path: Path | None, header: Header) -> None:
        """Open it, and read what is there.

        Raises:
          UsageError: it is the journal of another search, or no journal.
          OSError: it cannot be read or written.
        """
        self._known: dict[tuple[int, int | None], Line] = {}
        self._file: Any = None
        self._path = path
        if path is None:
            return
        self._file = _opened(path)
        try:
            self._lock()
            kept = self._read(path, header)
            self._file.truncate(kept)  # a line may be torn as the process died
            self._file.seek(kept)
            if not kept:
                self._write(header)
        except BaseException:
            self._file.close()
            raise

    def find(self, candidate: int, seed: int | None, at: Sequence[float]) -> Line | None:
        """Return the line of a run; None if it is not there.

        Raises:
          UsageError: the line is of another candidate.
        """
        line = self._known.get((candidate, seed))
        if line is not None and line.at != list(at):
            raise UsageError(
                f'the journal "{self._path}" does not fit: candidate {candidate} was another one, so the method or its '
                "package has changed; name another file"
            )
        return line

    def add(self, line: Line) -> None:
        """Append a line, and pass it to the system."""
        if self._file is not None:
            self._write(line)

    @property
    def files(self) -> list[int]:
        """The open file. Forked processes close it, because its lock lasts as long as a process has it open."""
        return [] if self._file is None else [self._file.fileno()]

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            os.fsync(self._file.fileno())
            self._file.close()

    def _write(self, what: msgspec.Struct) -> None:
        left = memoryview(msgspec.json.encode(what) + b"\n")
        while left:
            left = left[self._file.write(left) :]

    def _lock(self) -> None:
        try:
            import fcntl

            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except ImportError:
            pass
        except OSError:
            raise UsageError(
                f'another process writes the journal "{self._path}" now, or a user who can read it has locked it; '
                "wait for it, or name another file"
            ) from None

    def _read(self, path: Path, header: Header) -> int:
        """Read the lines. Return how many bytes whole lines have."""
        pieces, left = [], JOURNAL_BYTES.most + 1
        while left and (piece := self._file.read(left)):
            pieces.append(piece)
            left -= len(piece)
        data = b"".join(pieces)
        if len(data) > JOURNAL_BYTES.most:
            raise UsageError(f'the journal "{path}" is too large; {JOURNAL_BYTES.remedy}')
        whole = data.rfind(b"\n") + 1
        lines = data[:whole].splitlines()
        if not lines:
            return 0
        try:
            need_few_values(data)
            there = msgspec.json.decode(lines[0], type=Header)
            found = [msgspec.json.decode(line, type=Line) for line in lines[1:]]
            _need_scores(found, len(there.scores))
        except (ValueError, RecursionError) as error:
            raise UsageError(f'"{path}" is not the journal of a search: {error}; name another file') from None
        for name in header.__struct_fields__:
            mine, its = getattr(header, name), getattr(there, name)
            if mine != its:
                raise UsageError(
                    f'the journal "{path}" is of another search: its {name} is {its!r:.80}, not {mine!r:.80}; name '
                    "another file, or remove it"
                )
        self._known = {(line.candidate, line.seed): line for line in found}
        return whole


def _need_scores(lines: Sequence[Line], count: int) -> None:
    """Check that each run that went well has all scores.

    Raises:
      ValueError: one has not.
    """
    for line in lines:
        if line.outcome == "ok" and len(line.scores) != count:
            raise ValueError(f"candidate {line.candidate} has {len(line.scores)} scores, not {count}")


def _opened(path: Path) -> Any:
    """Open a plain file for reading and writing; one that is made can be read, and so locked, by this user only."""
    with Place(path) as place:
        number = place.open(os.O_RDWR | os.O_CREAT | getattr(os, "O_NONBLOCK", 0), mode=0o600)
        try:
            there = os.fstat(number)
            if not stat.S_ISREG(there.st_mode):
                raise OSError(errno.EINVAL, "it is not a plain file", str(path))
            if hasattr(os, "geteuid"):
                need_own(place, there)
        except BaseException:
            os.close(number)
            raise
    return os.fdopen(number, "r+b", buffering=0)
