"""What happened in a recorded run besides tokens: activity, parameters, edits and errors, by time.

It is read in the background, chunk by chunk, and kept within bounds; what is not read yet is not known. All methods can
be called from any thread. Depends on `seeking`.
"""

from __future__ import annotations

import threading
from array import array
from bisect import bisect_right
from collections.abc import Iterator
from contextlib import suppress
from typing import Any, Final

import numpy as np

from hfg.errors import UsageError
from hfg.recording.messages import EVENTS
from hfg.recording.reading import nanoseconds_in
from hfg.recording.seeking import Seeking

_MOST_SPANS: Final = 500_000
_MOST_SETTINGS: Final = 200_000
_MOST_BYTES: Final = 64 * 2**20  # of the texts of settings and edits
_MOST_EDITS: Final = 10_000
_MOST_ERRORS: Final = 200
_MOST_SHOWN: Final = 4000
_OPEN: Final = 2**63 - 1

Span = tuple[str, int, int | None]
"""A node, when it became active, and when it no longer was, in nanoseconds; None: it still is at the end."""

Failed = tuple[int, str, str, str]
"""When, in nanoseconds; the node; what failed; with which error."""


class _Values:
    """Values of one thing, by time."""

    def __init__(self) -> None:
        self.times = array("q")
        self.values: list[Any] = []

    def put(self, at: int, value: Any) -> None:
        self.times.append(at)
        self.values.append(value)

    def at(self, time: int) -> int:
        return bisect_right(self.times, time) - 1


class Course:
    """The course of a recorded run.

    Attributes:
      turn: counts what has been read, so that others see that there is more.
      is_complete: all of it has been read.
      errors: what has failed.
      edits: times and contents of the changes of the graph.
      unknown_after: time from which changes are not known because there are too many; None: all are known.
    """

    def __init__(self, seeking: Seeking) -> None:
        self._seeking = seeking
        self._lock = threading.Lock()
        self._names: list[str] = []
        self._numbers: dict[str, int] = {}
        self._nodes = array("i")
        self._begins = array("q")
        self._ends = array("q")
        self._open: dict[int, int] = {}
        self._settings: dict[tuple[str, str], _Values] = {}
        self._kept = self._bytes = 0
        self.turn = 0
        self.is_complete = False
        self.errors: list[Failed] = []
        self.edits: list[tuple[int, str]] = []
        self.unknown_after: int | None = None

    # --- reading ------------------------------------------------------------------------------------------------------

    def read(self) -> Iterator[None]:
        """Read the recording; each step is one chunk."""
        file = self._seeking.file
        channel = min(file.numbers_of(EVENTS), default=0)
        for _, messages in self._seeking.parts(channel):
            events: list[tuple[dict[str, Any], int]] = []
            for data in messages:
                with suppress(UsageError):  # the rest is worth looking at even if one event is not
                    events.append((file.object_in(data), len(data)))
            with self._lock:
                for event, size in events:
                    self._take(event, size)
                self.turn += bool(events)
            yield
        with self._lock:
            self.is_complete = True
            self.turn += 1

    def _take(self, event: dict[str, Any], size: int) -> None:
        at = nanoseconds_in(event.get("time"))
        node = str(event.get("node"))
        match event.get("type"):
            case "ActivityChanged":
                self._moved(at, node, bool(event.get("active")))
            case "ParameterSet":
                self._set(at, node, str(event.get("parameter")), event.get("value"), size)
            case "NodeEnabled":
                self._set(at, node, "", bool(event.get("enabled")), size)
            case "StructureChanged":
                if len(self.edits) < _MOST_EDITS and self._fits(size):
                    self.edits.append((at, str(event.get("change"))))
                else:
                    self._overflows(at)
            case "ErrorRaised":
                if len(self.errors) < _MOST_ERRORS:
                    self.errors.append((at, node, str(event.get("what")), str(event.get("error"))))
            case "RunEnded":
                for number in list(self._open):
                    self._ends[self._open.pop(number)] = at

    def _moved(self, at: int, node: str, active: bool) -> None:
        number = self._numbers.setdefault(node, len(self._names))
        if number == len(self._names):
            self._names.append(node)
        known = self._open.pop(number, None)
        if known is not None:
            self._ends[known] = at
        if not active:
            return
        if len(self._begins) >= _MOST_SPANS:
            self._overflows(at)
            return
        self._open[number] = len(self._begins)
        self._nodes.append(number)
        self._begins.append(at)
        self._ends.append(_OPEN)

    def _set(self, at: int, node: str, name: str, value: Any, size: int) -> None:
        if self._kept >= _MOST_SETTINGS or not self._fits(size):
            self._overflows(at)
            return
        self._kept += 1
        self._settings.setdefault((node, name), _Values()).put(at, value)

    def _fits(self, size: int) -> bool:
        self._bytes += size
        return self._bytes <= _MOST_BYTES

    def _overflows(self, at: int) -> None:
        if self.unknown_after is None:
            self.unknown_after = at

    # --- what was when ------------------------------------------------------------------------------------------------

    def active(self, at: int) -> dict[str, int]:
        """Return the active nodes at a time, with the time of their activation."""
        with self._lock:
            count = bisect_right(self._begins, at)
            ends = np.frombuffer(self._ends, np.int64, count) if count else np.empty(0, np.int64)
            inside = np.flatnonzero(ends > at).tolist()
            del ends  # while there is a view of it, the array cannot grow
            return {self._names[self._nodes[one]]: self._begins[one] for one in inside}

    def moves(self, begin: int, end: int, most: int) -> list[tuple[int, str, bool]]:
        """Return the changes of activity after a time, up to another: time, node, whether it became active."""
        with self._lock:
            last = bisect_right(self._begins, end)
            first = max(bisect_right(self._begins, begin), last - most)
            found = [(self._begins[one], self._names[self._nodes[one]], True) for one in range(first, last)]
            if last:
                ends = np.frombuffer(self._ends, np.int64, last)
                over = np.flatnonzero((ends > begin) & (ends <= end)).tolist()[-most:]
                del ends
                found += [(self._ends[one], self._names[self._nodes[one]], False) for one in over]
        return sorted(found, key=lambda move: (move[0], move[2]))[-most:]

    def spans(self) -> list[Span]:
        """Return the times for which nodes were active; of very many, the longest."""
        with self._lock:
            count = len(self._begins)
            chosen: Any = range(count)
            if count > _MOST_SHOWN:
                lengths = np.array(self._ends) - np.array(self._begins)
                chosen = np.sort(np.argpartition(lengths, -_MOST_SHOWN)[-_MOST_SHOWN:]).tolist()
            return [
                (
                    self._names[self._nodes[one]],
                    self._begins[one],
                    None if self._ends[one] == _OPEN else self._ends[one],
                )
                for one in chosen
            ]

    def settings(self, at: int) -> dict[tuple[str, str], Any]:
        """Return the parameters that were set up to a time, by node and name; without a name: whether it is enabled."""
        with self._lock:
            found = {}
            for key, values in self._settings.items():
                number = values.at(at)
                if number >= 0:
                    found[key] = values.values[number]
            return found

    def edits_until(self, at: int) -> int:
        """Return how many edits had been made at a time."""
        with self._lock:
            return bisect_right(self.edits, at, key=lambda edit: edit[0])
