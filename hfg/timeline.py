"""A run as a timeline: a consumer of the trace that writes the format of Perfetto and chrome://tracing.

Each group is a row with its firings and slot calls as boxes. Code that waits lets other calls start meanwhile; these
are drawn on further rows of the group. Each node that was ever active has a row with its active times. A signal is an
arrow from the box that sent it to the box that took it; errors and dropped tokens are marks.

The file is the JSON array form of the Trace Event Format, with one event per line, written while the graph runs, so
that the file can be opened even after a crash. Depends on `trace` and `graph`, not on the engine.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from io import BufferedIOBase
from pathlib import Path
from typing import Any, Literal

import msgspec

from hfg.base.whole import GrowingFile
from hfg.errors import UsageError
from hfg.graph import Graph
from hfg.graph.flat import FlatGraph, FlatNode, flatten
from hfg.trace import (
    ActivityChanged,
    CallEnded,
    CallStarted,
    DoEnded,
    DoStarted,
    ErrorRaised,
    EventTriggered,
    FiringEnded,
    FiringStarted,
    QueueGrown,
    RunEnded,
    StructureChanged,
    TokenDrained,
    TokenDropped,
    TokenSent,
    TokenTaken,
    TraceEvent,
)

__all__ = ["Timeline"]

_GROUPS, _ACTIVITY = 1, 2  # the format's "processes"
_ROWS = 1000  # numbers for the rows of a group
# two events never have the same time, so that events of one instant stay in order, and arrows in their boxes
_APART_US = 0.001


class _Box:
    """A firing or call in progress, and the arrows that start or end at it."""

    __slots__ = ("args", "arrows", "began", "category", "group", "name", "row")

    def __init__(self, name: str, category: str, began: float, group: str, row: int, args: dict[str, Any]) -> None:
        self.name = name
        self.group = group
        self.category = category
        self.began = began
        self.row = row
        self.args = args
        self.arrows: list[dict[str, Any]] = []


class Timeline:
    """Writes a run as a timeline; pass it to a run as its `trace`. The file is complete when the run is over.

    Examples:
      >>> import hfg, json, tempfile, pathlib
      >>> from hfg.testing.nodes import script, sink
      >>> graph = hfg.Graph()
      >>> _ = graph.add(script()) >> graph.add(sink())
      >>> file = pathlib.Path(tempfile.mkdtemp(), "run.json")
      >>> report = hfg.run(graph, clock="virtual", trace=Timeline(file, graph))
      >>> sorted({event["name"] for event in json.loads(file.read_text()) if event["ph"] == "X"})
      ['script', 'sink']
    """

    def __init__(self, file: str | os.PathLike[str] | BufferedIOBase, graph: Graph) -> None:
        """Open the file before the run starts.

        Args:
          file: where to write; a path, or a binary stream that is left open.
          graph: the graph to be run; its groups become rows.

        Raises:
          UsageError: the file cannot be written.
        """
        if isinstance(file, str | os.PathLike):
            try:
                self._stream: Any = GrowingFile(Path(file), append=False, at_once=False)
            except OSError as error:
                raise UsageError(f"cannot write the timeline to {file}: {error.strerror}") from None
            self._ours = True
        else:
            self._stream, self._ours = file, False
        self._graph = graph
        self._nodes = {node.path: node for node in _nodes(flatten(graph))}
        self._first = True
        self._closed = False
        self._origin: float | None = None
        self._now = 0.0
        self._open: dict[str, dict[int, _Box]] = {}  # by node, then by number of the firing; 0: a call, -1: do()
        self._rows: dict[str, list[str | None]] = {}  # per group: the node on each of its rows
        self._row_ids: dict[tuple[str, int], int] = {}
        self._group_order = list(dict.fromkeys(_group(node) for node in self._nodes.values()))
        self._last_row: dict[str, int] = {}
        self._active: dict[str, float] = {}
        self._activity_rows: dict[str, int] = {}
        self._events: set[str] = set()
        self._flying: dict[tuple[str, int], int] = {}  # signals in flight, by edge and number
        self._arrows = 0
        self._stream.write(b"[\n")
        self._name("process_name", _GROUPS, 0, f'groups of "{graph.name}"')
        self._name("process_name", _ACTIVITY, 0, "activity")

    def __call__(self, event: TraceEvent) -> None:
        """Process one event of the run."""
        if self._closed:
            return
        if self._origin is None:
            self._origin = event.time
        self._now = max(self._now + _APART_US, (event.time - self._origin) * 1e6)
        match event:
            case FiringStarted(node=node, number=number, kind=kind):
                self._begin(node, number, node, "silent" if kind == "silent" else "firing", {"firing": number})
            case CallStarted(node=node, number=number, slot=slot, edge=edge):
                self._begin(node, 0, f"{node}.{slot}", "call", {"call": number, "edge": edge})
            case FiringEnded(node=node, number=number, outcome=outcome):
                self._end(node, number, outcome)
            case CallEnded(node=node, outcome=outcome):
                self._end(node, 0, outcome)
            case DoStarted(node=node):
                self._begin(node, -1, f"{node}.do", "do", {})
            case DoEnded(node=node, outcome=outcome):
                self._end(node, -1, outcome)
            case EventTriggered(event=label):
                self._events.add(label)
            case TokenSent(edge=edge, token=token):
                self._sent(edge, token.sequence)
            case TokenTaken(edge=edge, token=token):
                self._taken(edge, token.sequence)
            case ActivityChanged(node=node, active=active):
                self._activity(node, active)
            case ErrorRaised(node=node, what=what, error=error):
                self._mark(node, f"error in {node}", {"what": what, "error": _plain(error)})
            case TokenDropped(edge=edge, token=token, reason=reason):
                self._flying.pop((edge, token.sequence), None)
                self._mark(_source(edge)[0], f"dropped: {reason}", {"edge": edge})
            case TokenDrained(edge=edge, token=token):
                self._flying.pop((edge, token.sequence), None)
            case QueueGrown(edge=edge, capacity=capacity):
                self._mark(_source(edge)[0], "queue grown", {"edge": edge, "capacity": capacity})
            case StructureChanged():
                self._edited()
            case RunEnded(outcome=outcome):
                self.close(outcome)

    def close(self, outcome: str = "cut off") -> None:
        """Close open boxes and the file. Called at the end of the run; a second call does nothing."""
        if self._closed:
            return
        for node, boxes in self._open.items():
            for number in list(boxes):
                self._end(node, number, f"in progress at the end: {outcome}")
        for node in list(self._active):
            self._activity(node, False)
        self._closed = True
        self._stream.write(b"\n]\n")
        if self._ours:
            self._stream.complete()
        else:
            self._stream.flush()

    def __enter__(self) -> Timeline:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def __del__(self) -> None:
        if not getattr(self, "_closed", True):
            with contextlib.suppress(OSError, ValueError):  # the disk is full, or the stream was closed
                self.close()

    # --- boxes ------------------------------------------------------------------------------------------------------

    def _begin(self, node: str, number: int, name: str, category: str, args: dict[str, Any]) -> None:
        group = self._group_of(node)
        rows = self._rows.setdefault(group, [])
        row = self._last_row.get(node, 0)
        if row >= len(rows) or rows[row] is not None:
            row = next((free for free, who in enumerate(rows) if who is None), len(rows))
        if row == len(rows):
            rows.append(None)
        rows[row] = node
        self._last_row[node] = row
        self._open.setdefault(node, {})[number] = _Box(name, category, self._now, group, row, args)

    def _newest(self, node: str) -> _Box | None:
        """Return the latest box in progress of a node (F14)."""
        boxes = self._open.get(node)
        return boxes[next(reversed(boxes))] if boxes else None

    def _end(self, node: str, number: int, outcome: str) -> None:
        box = self._open.get(node, {}).pop(number, None)
        if box is None:
            return  # it had started before the timeline was attached
        self._rows[box.group][box.row] = None
        self._write(
            ph="X",
            name=box.name,
            cat=box.category,
            pid=_GROUPS,
            tid=self._row(box.group, box.row),
            ts=box.began,
            dur=self._now - box.began,
            args={**box.args, "outcome": outcome},
        )
        for arrow in box.arrows:  # after the box that they belong to
            self._write(**arrow)

    def _row(self, group: str, row: int) -> int:
        key = (group, row)
        number = self._row_ids.get(key)
        if number is None:
            if group not in self._group_order:
                self._group_order.append(group)
            number = self._row_ids[key] = (self._group_order.index(group) + 1) * _ROWS + row
            self._name("thread_name", _GROUPS, number, group if not row else f"{group} ({row + 1})")
            self._name("thread_sort_index", _GROUPS, number, number)
        return number

    # --- arrows -----------------------------------------------------------------------------------------------------

    def _sent(self, edge: str, sequence: int) -> None:
        node, event = _source(edge)
        box = self._newest(node)
        if event in self._events and box is not None:
            self._arrows += 1
            self._flying[edge, sequence] = self._arrows
            box.arrows.append(self._arrow("s", event, self._arrows, box))

    def _taken(self, edge: str, sequence: int) -> None:
        number = self._flying.pop((edge, sequence), None)
        node = edge.partition(" -> ")[2].rpartition(".")[0]
        box = self._newest(node)
        if number is not None and box is not None:
            box.arrows.append({**self._arrow("f", _source(edge)[1], number, box), "bp": "e"})

    def _arrow(self, phase: Literal["s", "f"], name: str, number: int, box: _Box) -> dict[str, Any]:
        row = self._row(box.group, box.row)
        return {"ph": phase, "name": name, "cat": "event", "id": number, "pid": _GROUPS, "tid": row, "ts": self._now}

    # --- activity and marks -----------------------------------------------------------------------------------------

    def _activity(self, node: str, active: bool) -> None:
        if active:
            self._active.setdefault(node, self._now)
            return
        began = self._active.pop(node, None)
        if began is None:
            return
        row = self._activity_rows.get(node)
        if row is None:
            row = self._activity_rows[node] = len(self._activity_rows) + _ROWS
            self._name("thread_name", _ACTIVITY, row, node)
            self._name("thread_sort_index", _ACTIVITY, row, row)
        self._write(
            ph="X", name="active", cat="activity", pid=_ACTIVITY, tid=row, ts=began, dur=self._now - began, args={}
        )

    def _mark(self, node: str, name: str, args: dict[str, Any]) -> None:
        box = self._newest(node)
        row = self._row(self._group_of(node), 0 if box is None else box.row)
        self._write(ph="i", s="t", name=name, cat="mark", pid=_GROUPS, tid=row, ts=self._now, args=args)

    def _edited(self) -> None:
        """Handle an edit: nodes may be renamed or gone, so the active times of each end under its old name."""
        before, self._nodes = self._nodes, {node.path: node for node in _nodes(flatten(self._graph))}
        path_of = {node.node: path for path, node in self._nodes.items()}
        stays = {path for path in self._nodes if path in before and before[path].node not in path_of}  # replaced
        moved = {}
        for path in self._active:
            here = path if path in stays or path not in before else path_of.get(before[path].node)
            if here != path:
                moved[path] = here
        for path in moved:
            self._activity(path, False)
        for here in moved.values():
            if here is not None:
                self._activity(here, True)

    def _group_of(self, node: str) -> str:
        return _group(self._nodes[node]) if node in self._nodes else "loop"

    # --- the file ---------------------------------------------------------------------------------------------------

    def _name(self, what: str, pid: int, tid: int, value: str | int) -> None:
        key = "sort_index" if what == "thread_sort_index" else "name"
        self._write(ph="M", name=what, pid=pid, tid=tid, args={key: value})

    def _write(self, **fields: Any) -> None:
        for key in ("ts", "dur"):
            if key in fields:
                fields[key] = round(fields[key], 3)
        self._stream.write(b"" if self._first else b",\n")
        self._first = False
        self._stream.write(msgspec.json.encode(fields))


def _plain(text: str) -> str:
    """Return a text without lone surrogates: texts of errors may have some, JSON may not."""
    return text.encode("utf-8", "replace").decode()


def _source(edge: str) -> tuple[str, str]:
    """Return the node at the start of the edge, and the port."""
    port = edge.partition(" -> ")[0]
    return port.rpartition(".")[0], port


def _nodes(flat: FlatGraph) -> Iterator[FlatNode]:
    return (node for one in flat.walk() for node in one.nodes)


def _group(node: FlatNode) -> str:
    return node.options.group or "loop"
