"""What a run has done, in numbers: frozen structs for people, tests and `--json`. Depends on `running_node`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol

import msgspec

from hfg.engine.model import Core
from hfg.engine.model.running_node import ENDED, RunningNode
from hfg.engine.observing.tables import seconds, table
from hfg.graph import Graph
from hfg.nodetypes.counting import Counting
from hfg.ports.edges import AnyEdge, EventEdge

__all__ = [
    "EdgeReport",
    "NodeReport",
    "Report",
    "RunPage",
    "RunRecording",
    "edge_report",
    "edge_reports",
    "node_report",
    "node_reports",
]


class NodeReport(msgspec.Struct, frozen=True):
    """One node.

    Attributes:
      firings: firings, silent ones and the one that ended it included.
      processed: firings in which the function ran.
      silent: firings without the function (F4).
      calls: slot calls.
      failed: failed firings and calls.
      retries: how often a firing was tried again (X1).
      restarts: how often X1 restarted it.
      most_under_way: how many of its firings were in progress at once, at most (F14).
      active: A(v).
      ended: whether it has sent END.
      own: what the node counts itself, such as messages that a connection has lost.
    """

    firings: int
    processed: int
    silent: int
    calls: int
    failed: int
    retries: int
    restarts: int
    most_under_way: int
    active: bool
    ended: bool
    own: dict[str, int] = {}


class EdgeReport(msgspec.Struct, frozen=True):
    """One edge.

    Attributes:
      sent: tokens put on it, markers and dropped ones included.
      dropped: discarded, for whatever reason.
      drained: processed without a firing because the consumer has ended (F12).
      untaken: what still lies on it.
      grown: places that F8 added.
      lost: gone with the process of a group that died (L2); what was put in their place is among the others.
    """

    sent: int
    dropped: int
    drained: int
    untaken: int
    grown: int
    lost: int = 0


class Report(msgspec.Struct, frozen=True):
    """How a run went.

    Attributes:
      outcome: "done", "stopped" (slot `stop`, or the block was left), "until", "cancelled", "failed", "stalled",
        "aborted".
      duration_s: on the run's clock.
      firings: all firings of all nodes.
      nodes: by path.
      edges: by label, "source -> target".
      outputs: values of the graph's own outputs that were not read.
      errors: failures that did not end the run (X1, X3), as sentences.
      lost_activity: how often activity was discarded and could not be returned (A8).
      clocks: by group on another machine, by how many seconds its clock may differ from the run's, at most (T5).
    """

    outcome: str
    duration_s: float
    firings: int
    nodes: dict[str, NodeReport]
    edges: dict[str, EdgeReport]
    outputs: dict[str, list[Any]]
    errors: list[str]
    lost_activity: int
    clocks: dict[str, float] = {}

    def __str__(self) -> str:
        """A table of the nodes, and one of the edges; empty columns are left out."""
        lines = [f"{self.outcome} after {seconds(self.duration_s)}, {self.firings} firings"]
        nodes = [
            (path, one.firings, one.silent, one.calls, one.failed, one.retries, one.restarts, one.active, one.ended)
            for path, one in self.nodes.items()
        ]
        lines += [
            "",
            *table(("node", "firings", "silent", "calls", "failed", "retries", "restarts", "active", "ended"), nodes),
        ]
        edges = [
            (label, one.sent, one.dropped, one.lost, one.drained, one.untaken, one.grown)
            for label, one in self.edges.items()
        ]
        if edges:
            lines += ["", *table(("edge", "sent", "dropped", "lost", "drained", "untaken", "grown"), edges)]
        for path, one in self.nodes.items():
            if one.own:
                lines += ["", f"{path}: {', '.join(f'{count} {what}' for what, count in one.own.items())}"]
        if self.clocks:
            lines += ["", *table(("group", "clock within"), [(one, seconds(at)) for one, at in self.clocks.items()])]
        if self.lost_activity:
            lines += ["", f"activity was lost {self.lost_activity} times"]
        return "\n".join([*lines, *([""] if self.errors else []), *self.errors])


class RunPage(Protocol):
    """What `run.report_page` gives: a page about a run, written when that is over. `hfg.reporting` has its class.

    Sections of one's own stand on top of the page in the order in which they are first named, and in each of them what
    was added to it, in order. What is added when the run is over needs another `write`.
    """

    @property
    def path(self) -> Path:
        """Of the file."""

    @property
    def error(self) -> OSError | None:
        """Why the file could not be written in the end; None if all is well."""

    def text(self) -> str:
        """Return the page as far as the run has come."""

    def write(self) -> None:
        """Write the file now, as far as the run has come; the end of the run does it again."""

    def add_text(self, section: str, text: str) -> None:
        """Add paragraphs, separated by empty lines, to the section of that title."""

    def add_table(self, section: str, heads: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
        """Add a table that its reader can sort by each of its columns.

        Raises:
          UsageError: a row has more or fewer cells than there are heads.
        """

    def add_picture(self, section: str, picture: object, *, caption: str = "", at_s: float | None = None) -> None:
        """Add a picture; those that follow one another stand side by side.

        Args:
          section: its title.
          picture: an image of 8 bits, gray or blue, green, red; the text of a drawing in SVG; or a file.
          caption: stands below it.
          at_s: when in the run that was; a click on the picture sets the clock of the page.

        Raises:
          UsageError: it is none of these, or the file cannot be read or is larger than 64 MB.
        """

    def add_video(
        self,
        section: str,
        file: str | os.PathLike[str],
        *,
        caption: str = "",
        starts_s: float = 0.0,
        speed: float = 1.0,
    ) -> None:
        """Add a video, which is copied into the page; playing it moves the clock of the page, and the other way round.

        Args:
          section: its title.
          file: WebM, MP4 or Ogg; which codecs are played is up to the browser: VP8 and VP9 are, everywhere.
          caption: stands below it.
          starts_s: which time of the run its beginning shows.
          speed: seconds of the run per second of the video.

        Raises:
          UsageError: it cannot be read, is larger than 64 MB, or a number is none.
        """

    def add_drawing(
        self, section: str, graph: Graph, *, caption: str = "", depth: int | None = None, fold: Iterable[str] = ()
    ) -> None:
        """Add the drawing of a graph, or of the inside of a subgraph, in which the page shows who is active.

        Args:
          section: its title.
          graph: the one that runs, or `subgraph.graph` of one in it.
          caption: stands below it.
          depth: how many levels of subgraphs are shown open; None shows all.
          fold: paths of subgraphs that are folded whatever the depth.
        """


class RunRecording(Protocol):
    """The result of `run.record`: a recording in progress, or its result. `hfg.recording` has its class."""

    @property
    def path(self) -> Path:
        """Of the file."""

    @property
    def ports(self) -> list[str]:
        """The paths of the ports that are recorded."""

    @property
    def error(self) -> BaseException | None:
        """Why nothing more is written; None if all is well."""

    @property
    def tokens(self) -> int:
        """How many tokens were written, markers too."""

    @property
    def bytes_written(self) -> int:
        """How long the file is by now."""

    @property
    def left_out(self) -> dict[str, int]:
        """Tokens for which there was no time, or no way to write them, by port."""

    @property
    def held_s(self) -> float:
        """For how long nodes had to wait for the recording."""

    def stop(self) -> None:
        """Record nothing more; what has passed is still written. Does nothing the second time."""

    async def close(self) -> None:
        """Record nothing more, and wait until the file is whole."""

    async def __aenter__(self) -> RunRecording: ...
    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None: ...


def node_report(worker: RunningNode) -> NodeReport:
    """Return the counts of one node, which report and statistics share."""
    counts = worker.counts
    return NodeReport(
        firings=counts.firings,
        processed=counts.processed,
        silent=counts.silent,
        calls=counts.calls,
        failed=counts.failed,
        retries=counts.retries,
        restarts=counts.restarts,
        most_under_way=min(1, counts.firings) if worker.concurrent is None else worker.concurrent.most,
        active=worker.active,
        ended=bool(worker.blocked & ENDED),
        own=dict(worker.node.statistics()) if isinstance(worker.node, Counting) else {},
    )


def edge_report(edge: AnyEdge) -> EdgeReport:
    """Return the counts of one edge, which report and statistics share."""
    return EdgeReport(
        sent=edge.sent,
        dropped=edge.dropped,
        drained=edge.drained,
        untaken=edge.untaken,
        grown=edge.grown if isinstance(edge, EventEdge) else 0,
        lost=edge.lost,
    )


def node_reports(core: Core) -> dict[str, NodeReport]:
    """Count what every running node has done so far."""
    core.settle_counts()
    nodes = [worker for worker in core.workers if worker.node is not None and worker.scope is None]
    return {worker.path: node_report(worker) for worker in nodes}


def edge_reports(core: Core) -> dict[str, EdgeReport]:
    """Count what every edge has carried so far."""
    core.settle_counts()
    return {edge.label: edge_report(edge) for edge in core.edges}
