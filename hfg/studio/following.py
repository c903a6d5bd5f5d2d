"""Keeps the tables as the graph and its run are, and tells every page what has changed.

Whatever an edit was, the records are made again and compared; for parameters and notes, which change thirty times a
second during a drag, only those of the nodes concerned. Depends on `describing`, `tables` and `layouts`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from typing import Any, Final

from hfg.errors import HfgError
from hfg.graph import Graph
from hfg.graph.editing.changes import Change, NotesChange, ParameterChange
from hfg.nodetypes.node import Node
from hfg.studio.annotating import annotations_of
from hfg.studio.describing import changed_record, describe_graph
from hfg.studio.failing import problem_of_run, problems_of_check
from hfg.studio.history import Attribution
from hfg.studio.layouts import Layouts
from hfg.studio.project import Project
from hfg.studio.records import ProblemRecord, ViewersRecord
from hfg.studio.spans import Spans
from hfg.studio.steering import Steering
from hfg.studio.tables import Tables
from hfg.studio.viewing import Viewer
from hfg.trace import ActivityChanged, ErrorRaised, NodeEnabled, ParameterSet, StructureChanged, TraceEvent

__all__ = ["Following"]

_SOON_S: Final = 0.1
_CHECK_S: Final = 0.3
_MOST_PROBLEMS: Final = 200


class Following:
    """The tables of one studio.

    Attributes:
      read_only: why nothing can be changed; "" if it can.
      turn: held during an edit, so that edits of pages, files and runs come one after the other.
      listeners: called with each event of the run; by topics.
      spans: when nodes were active.
      is_described: the tables hold the graph, as they do from the first page that joins.
    """

    def __init__(self, project: Project, steering: Steering) -> None:
        self.project = project
        self.steering = steering
        self.read_only = ""
        self.tables = Tables()
        self.viewers: dict[int, Viewer] = {}
        self.turn = asyncio.Lock()
        self.attribution = Attribution()
        self.listeners: set[Any] = set()
        self.spans = Spans()
        self.is_described = False
        self._layouts = Layouts(self)
        self._dirty: set[str] = set()
        self._is_stale = False
        self._soon: asyncio.TimerHandle | None = None
        self._check: asyncio.TimerHandle | None = None
        self._problems: dict[str, ProblemRecord] = {}

    @property
    def graph(self) -> Graph:
        """The graph, which is another one when a file is opened."""
        return self.project.graph

    def take_graph(self, by: int, text: str) -> None:
        """A file was opened: its graph takes the place of the one before."""
        self.steering.graph = self.project.graph
        self.forget_problems()
        self.refresh_all(by, text)

    def start_over(self, project: Project, steering: Steering) -> None:
        """Something else takes the place of graph and run: no table has anything of them any more."""
        self.stop_following()
        self.project, self.steering = project, steering
        self.tables, self.attribution, self.spans = Tables(), Attribution(), Spans()
        self._layouts = Layouts(self)
        self._problems.clear()
        self._dirty.clear()
        self._is_stale = self.is_described = False
        self._soon = self._check = None

    def tell(self, patch: bytes | None) -> None:
        """Send a patch to all that have the tables."""
        if patch is not None:
            for viewer in self.viewers.values():
                if viewer.joined:
                    viewer.send(patch)

    # --- the graph ---

    def refresh_all(self, by: int = 0, text: str = "") -> None:
        """The graph may be another one: make all its records again."""
        self.is_described = True
        self._is_stale = False
        self._dirty.clear()
        tables = describe_graph(self.graph)
        tables["nodes"] = self.steering.shown(tables["nodes"])
        tables["studio"] = self._singles()
        tables["breakpoints"] = self.steering.breakpoints()
        self.tell(self.tables.replace(tables, by, text))
        self.layouts_wanted()
        self.check_soon()

    def refresh(self, changes: Iterable[Change], by: int = 0, text: str = "") -> None:
        """These changes were made to the graph."""
        nodes: dict[Node, None] = {}
        for change in changes:
            if isinstance(change, ParameterChange) or (isinstance(change, NotesChange) and change.node is not None):
                nodes[change.node] = None  # type: ignore[index]
            else:
                self.refresh_all(by, text)
                return
        self._refresh_nodes([node.place.path for node in nodes if node._place is not None], by, text)

    def _refresh_nodes(self, paths: Iterable[str], by: int = 0, text: str = "") -> None:
        before = self.tables.of["nodes"]
        nodes = dict(before)
        for path in paths:
            if path in before:
                nodes[path] = changed_record(self.graph, before[path])
        nodes = self.steering.shown(nodes)
        noted = annotations_of(self.graph)
        self.tell(self.tables.replace({"nodes": nodes, "annotations": noted, "studio": self._singles()}, by, text))
        self.layouts_wanted()

    def _singles(self) -> dict[str, Any]:
        history = self.attribution.record(self.graph)
        return {
            "run": self.steering.record,
            "history": history,
            "file": self.project.record(),
            "viewers": ViewersRecord(sum(viewer.joined for viewer in self.viewers.values())),
        }

    def singles_changed(self, by: int = 0, text: str = "") -> None:
        """The file or the history may be in another state."""
        self.tell(self.tables.replace({"studio": self._singles()}, by, text))

    def viewers_changed(self) -> None:
        """A page has joined or left."""
        count = sum(viewer.joined for viewer in self.viewers.values())
        self.tell(self.tables.put("studio", "viewers", ViewersRecord(count)))

    def layouts_wanted(self) -> None:
        """Draw what pages show, if it is not drawn like that already."""
        self._layouts.want({level for viewer in self.viewers.values() for level in viewer.levels})

    def take_layout(self, key: str, record: object) -> None:
        """The layout of a level is ready, or no page shows the level any more (None)."""
        self.tell(self.tables.put("layouts", key, record))

    # --- the run ---

    def run_changed(self) -> None:
        """See `Follower`."""
        if self.is_described:
            self.tell(self.tables.replace({"studio": self._singles(), "breakpoints": self.steering.breakpoints()}))

    def run_begins(self, active: Iterable[str], at: float) -> None:
        """See `Follower`."""
        self.spans.begin(active, at)

    def run_ends(self, at: float) -> None:
        """See `Follower`."""
        self.spans.end(at)

    def run_event(self, event: TraceEvent) -> None:
        """See `Follower`."""
        match event:
            case ParameterSet(node=path):
                self._dirty.add(path)
                self._refresh_soon()
            case StructureChanged() | NodeEnabled():
                self._is_stale = True
                self._refresh_soon()
            case ErrorRaised(node=path, what=what, error=message):
                self.problem(problem_of_run(path, what, message, self.steering.elapsed(), self._last_edit()))
        for listener in list(self.listeners):
            listener(event)
        if isinstance(event, ActivityChanged):  # after those who want to know who was active before
            self.spans.change(event.node, self.steering.since_begin(event.time), active=event.active)

    def settings_changed(self, paths: Iterable[str]) -> None:
        """See `Follower`."""
        self._refresh_nodes(paths)

    def graph_changed(self, graph: Graph, text: str) -> None:
        """See `Follower`."""
        self.project.graph = self.steering.graph = graph
        self.refresh_all(0, text)

    def cursor_moved(self) -> None:
        """See `Follower`."""
        now = asyncio.get_running_loop().time()
        for viewer in list(self.viewers.values()):
            viewer.hurry(now)

    def _last_edit(self) -> str:
        record = self.attribution.record(self.graph)
        return record.done[-1].text if record.done else ""

    def _refresh_soon(self) -> None:
        if self._soon is None and self.viewers:
            self._soon = asyncio.get_running_loop().call_later(_SOON_S, self._refresh_now)

    def _refresh_now(self) -> None:
        """Report changes by the run or by another program, at most ten times per second."""
        self._soon = None
        if self._is_stale and not self.turn.locked():
            self.refresh_all()
        elif self._is_stale:
            self._refresh_soon()
        elif self._dirty:
            dirty, self._dirty = self._dirty, set()
            self._refresh_nodes(dirty)

    # --- problems ---

    def problem(self, found: ProblemRecord) -> None:
        """Something has gone wrong in the run."""
        self._problems[f"{found.path}: {found.what}: {found.why}"[:1000]] = found
        while len(self._problems) > _MOST_PROBLEMS:
            self._problems.pop(next(iter(self._problems)))
        self.tell(self.tables.replace({"problems": {**self._checked(), **self._problems}}))

    def forget_problems(self) -> None:
        """A new run begins."""
        self._problems.clear()
        self.tell(self.tables.replace({"problems": self._checked()}))

    def _checked(self) -> dict[str, ProblemRecord]:
        return {key: one for key, one in self.tables.of["problems"].items() if one.source == "check"}

    def check_soon(self) -> None:
        """Look for mistakes after a short pause without edits."""
        if self.viewers and self.steering.is_live:
            if self._check is not None:
                self._check.cancel()
            self._check = asyncio.get_running_loop().call_later(_CHECK_S, self._check_now)

    def _check_now(self) -> None:
        self._check = None
        try:
            found = {str(one): ProblemRecord(*_fields(one), source="check") for one in self.graph.check()}
        except HfgError as error:  # a check that cannot look at this graph says so
            found = problems_of_check(error)
        self.tell(self.tables.replace({"problems": {**found, **self._problems}}))

    def stop_following(self) -> None:
        """Report nothing any more."""
        for timer in (self._soon, self._check):
            if timer is not None:
                timer.cancel()


def _fields(one: Any) -> tuple[str, str, str, str, str, str]:
    return one.path, one.severity, one.what, one.why, one.remedy, one.check
