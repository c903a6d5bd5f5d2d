"""Collects data about a run for a report, within bounds, however long the run is.

Firings are counted in a few hundred time spans, which grow with the run. When there are too many times of activity or
pictures, they are thinned out evenly; only the first errors are kept. Omissions are counted and reported. Depends on
`trace`.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from hfg.reporting.pictures import is_picture, smaller
from hfg.trace import (
    ActivityChanged,
    CallStarted,
    ErrorRaised,
    FiringStarted,
    RunEnded,
    RunStarted,
    StructureChanged,
    TokenDropped,
    TokenSent,
    TraceEvent,
)

SPANS: Final = 240  # time spans for counting firings; at most twice as many
MOST_TIMES: Final = 1000  # times of activity per node
MOST_NODES: Final = 2000  # nodes whose times are kept: a graph that is edited while it runs can have any number
MOST_ERRORS: Final = 100
LONGEST_ERROR: Final = 2000  # characters
_FIRST_SPAN_S: Final = 0.001


class Times:
    """When a node was active.

    Attributes:
      spans: start and end of each time.
      joined: how many were merged with the preceding one because there were too many.
      total_s: its exact total time of activity, in seconds.
    """

    __slots__ = ("_since", "joined", "spans", "total_s")

    def __init__(self) -> None:
        self.spans: list[tuple[float, float]] = []
        self.joined = 0
        self.total_s = 0.0
        self._since: float | None = None

    def begin(self, now: float) -> None:
        """The node becomes active."""
        if self._since is None:
            self._since = now

    def end(self, now: float) -> None:
        """The node becomes inactive."""
        if self._since is None:
            return
        self.spans.append((self._since, now))
        self.total_s += now - self._since
        self._since = None
        if len(self.spans) > MOST_TIMES:
            self._join()

    def until(self, now: float) -> list[tuple[float, float]]:
        """Return the times up to now."""
        return self.spans if self._since is None else [*self.spans, (self._since, now)]

    def total_until(self, now: float) -> float:
        """Return the total time of activity up to now."""
        return self.total_s + (0.0 if self._since is None else now - self._since)

    def _join(self) -> None:
        """Merge the times that are nearest to each other, until half of them are left."""
        gaps = sorted(after[0] - before[1] for before, after in zip(self.spans, self.spans[1:], strict=False))
        widest = gaps[len(gaps) // 2]
        found = [self.spans[0]]
        spare = len(self.spans) // 2  # of equally long gaps, close no more than necessary
        for begin, end in self.spans[1:]:
            if spare and begin - found[-1][1] <= widest:
                found[-1] = (found[-1][0], end)
                spare -= 1
                self.joined += 1
            else:
                found.append((begin, end))
        self.spans = found


class Rows:
    """How often nodes fired, in time spans of equal length from the start.

    Attributes:
      span_s: length of each; doubled whenever the run has become twice as long.
    """

    def __init__(self) -> None:
        self.span_s = _FIRST_SPAN_S
        self.counts: dict[str, array[int]] = {}

    def add(self, node: str, since_start: float) -> None:
        """Count one more firing or call."""
        index = int(since_start / self.span_s)
        while index >= 2 * SPANS:
            self._double()
            index = int(since_start / self.span_s)
        row = self.counts.get(node)
        if row is None:
            if len(self.counts) >= MOST_NODES:
                return
            row = self.counts[node] = array("Q", bytes(16 * SPANS))
        row[max(index, 0)] += 1

    def _double(self) -> None:
        self.span_s *= 2
        for node, row in self.counts.items():
            pairs = [row[index] + row[index + 1] for index in range(0, 2 * SPANS, 2)]
            self.counts[node] = array("Q", [*pairs, *([0] * SPANS)])


class Gallery:
    """A few of the pictures that were sent, evenly spread over the run.

    Attributes:
      by_port: path of the port, then time and pixels of each that is kept.
      seen: number of pictures per port.
      left_out: ports without any kept picture.
    """

    def __init__(self, most: int, longest: int) -> None:
        self._most = most
        self._longest = longest
        self._edge_of: dict[str, str] = {}  # pictures of a port are counted on one of its edges
        self._every: dict[str, int] = {}
        self.by_port: dict[str, list[tuple[float, np.ndarray[Any, Any]]]] = {}
        self.seen: dict[str, int] = {}
        self.left_out: set[str] = set()

    def take(self, edge: str, value: object, now: float) -> None:
        """Look at a value that was sent."""
        if not is_picture(value):
            return
        assert isinstance(value, np.ndarray)
        port = edge.partition(" -> ")[0]
        if self._edge_of.setdefault(port, edge) != edge:
            return
        if port not in self.by_port:
            if len(self.by_port) >= self._most:
                self.left_out.add(port)
                return
            self.by_port[port], self._every[port], self.seen[port] = [], 1, 0
            self._thin_out()
        number = self.seen[port]
        self.seen[port] = number + 1
        if number % self._every[port] == 0:
            self.by_port[port].append((now, smaller(value, self._longest)))
            self._thin_out()

    def _thin_out(self) -> None:
        room = max(self._most // len(self.by_port), 1)
        for port, kept in self.by_port.items():
            while len(kept) > room:
                del kept[1::2]
                self._every[port] *= 2


class Observed:
    """A consumer of the trace that collects the data of a report.

    Attributes:
      begun_at: start, on the run's clock.
      errors: time, node and message of each.
      more_errors: number of errors after those.
      dropped: number of dropped tokens, by reason.
      edits: number of changes of the graph.
    """

    def __init__(self, pictures: int, longest: int) -> None:
        self.begun_at: float | None = None
        self.times: dict[str, Times] = {}
        self.rows = Rows()
        self.gallery = Gallery(pictures, longest) if pictures else None
        self.errors: list[tuple[float, str, str]] = []
        self.more_errors = 0
        self.dropped: dict[str, int] = {}
        self.edits = 0
        self.now = 0.0
        self._takes: Mapping[type, Callable[[Any], None]] = {
            ActivityChanged: self._activity,
            FiringStarted: self._firing,
            CallStarted: self._call,
            ErrorRaised: self._error,
            TokenDropped: self._drop,
            StructureChanged: self._edit,
            RunStarted: self._begin,
            RunEnded: lambda _event: None,  # its time is the end
            **({TokenSent: self._sent} if pictures else {}),
        }

    def __call__(self, event: TraceEvent) -> None:
        """Process one event of the run."""
        take = self._takes.get(type(event))
        if take is None:
            return
        if self.begun_at is None:
            self.begun_at = event.time
        self.now = event.time
        take(event)

    def _begin(self, event: RunStarted) -> None:
        self.begun_at = event.time

    def _activity(self, event: ActivityChanged) -> None:
        times = self.times.get(event.node)
        if times is None:
            if len(self.times) >= MOST_NODES:
                return
            times = self.times[event.node] = Times()
        if event.active:
            times.begin(event.time)
        else:
            times.end(event.time)

    def _firing(self, event: FiringStarted) -> None:
        if event.kind != "silent":
            self.rows.add(event.node, event.time - (self.begun_at or 0.0))

    def _call(self, event: CallStarted) -> None:
        self.rows.add(event.node, event.time - (self.begun_at or 0.0))

    def _error(self, event: ErrorRaised) -> None:
        if len(self.errors) < MOST_ERRORS:
            said = f"{event.what}: {event.error}"
            self.errors.append((event.time, event.node, said[:LONGEST_ERROR]))
        else:
            self.more_errors += 1

    def _drop(self, event: TokenDropped) -> None:
        self.dropped[event.reason] = self.dropped.get(event.reason, 0) + 1

    def _edit(self, _event: StructureChanged) -> None:
        self.edits += 1

    def _sent(self, event: TokenSent) -> None:
        if self.gallery is not None:
            self.gallery.take(event.edge, event.token.value, event.time)
