"""Statistics of a run while it runs: frozen numbers per node, edge and group (rule R7)."""

from __future__ import annotations

import msgspec

from hfg.engine.observing.report import EdgeReport, NodeReport
from hfg.engine.observing.tables import seconds, table

__all__ = ["EdgeStatistics", "GroupStatistics", "NodeStatistics", "Statistics", "Times"]


class Times(msgspec.Struct, frozen=True):
    """Many durations, in seconds.

    Attributes:
      count: how many were measured. Of a node with more than some 600 firings and calls a second the others are only
        counted, and taken to be alike.
      total_s, mean_s: of all, measured or not.
      max_s: of those measured.
      p50_s, p99_s: the median and the 99th percentile, within 7 %.
      last_s: the newest 100 at most, oldest first.
    """

    count: int
    total_s: float
    mean_s: float
    max_s: float
    p50_s: float
    p99_s: float
    last_s: tuple[float, ...]


class NodeStatistics(NodeReport, frozen=True, kw_only=True):
    """One node: its counts, as in the report, and times.

    Attributes:
      group: where it runs.
      under_way: how many of its firings are in progress now; with concurrency those too that wait for their turn.
      rate_hz: firings and calls a second of the run's clock, over the last one to two seconds.
      busy: how long its firings and calls took on the machine's clock, what async code waited for included.
      busy_share: of the machine's time since measuring began, how much its code kept its group busy.
      latency: from the stamp of what it took to the end of its firing or call, on the run's clock; sources have none.
      doing: "working", or what it waits for now (see `waiting`).
      waiting: seconds of the run's clock by what it waited for: "turn" (others of its group are running), "input x"
        (a token there), "output x" (its token there is not processed yet), "rate", "queue" (one of its events' is
        full), "recorder" (without loss, of its ports), "gate", "ready", "restart", "signal" (it has slots only),
        "do" (its do-activity is in progress), "start", "unconnected", "disabled", "ended".
      active_share: of the time since measuring began, how much it was active.
      queued: untaken tokens in front of it.
      tasks: what its code has started by `start_soon` and is in progress, by name.
    """

    group: str
    under_way: int
    rate_hz: float
    busy: Times
    busy_share: float
    latency: Times
    doing: str
    waiting: dict[str, float]
    active_share: float
    queued: int
    tasks: tuple[str, ...] = ()


class EdgeStatistics(EdgeReport, frozen=True, kw_only=True):
    """One edge: its counts, as in the report, and rates.

    Attributes:
      rate_hz: of those, a second of the run's clock, over the last one to two seconds.
      deepest: the most that ever lay on it.
      capacity: places of its queue; None for an edge of data, which has one, unless a buffer or a delay adds to that.
    """

    rate_hz: float
    deepest: int
    capacity: int | None


class GroupStatistics(msgspec.Struct, frozen=True):
    """One group.

    Attributes:
      nodes: how many it has.
      firings: of all of them; calls likewise.
      calls: slot calls of all of them.
      rate_hz: firings and calls a second of the run's clock, over the last one to two seconds.
      busy_s: for how long their code kept it busy, on the machine's clock; async code that waits does not.
      busy_share: the same, of the time since measuring began.
      queued: nodes that wait for their turn now.
    """

    nodes: int
    firings: int
    calls: int
    rate_hz: float
    busy_s: float
    busy_share: float
    queued: int


class Statistics(msgspec.Struct, frozen=True):
    """Figures of a run so far: counts since its start, times since they are measured.

    Attributes:
      outcome: "running", or how it ended.
      time: now, on the run's clock.
      duration_s: since the run began, on its clock.
      measured_s: since times are measured, on its clock.
      machine_s: the same on the machine's clock, which differs under a virtual one.
      firings: all firings of all nodes.
      nodes: by path, those inside iterating subgraphs too.
      edges: by label, "source -> target".
      groups: by name.
      lost_activity: how often activity was discarded and could not be returned (A8).
      errors: failures that did not end the run (X1).
      ages_s: how old that is which was said by each group with a process of its own (see `Run.refresh`), by its name.
    """

    outcome: str
    time: float
    duration_s: float
    measured_s: float
    machine_s: float
    firings: int
    nodes: dict[str, NodeStatistics]
    edges: dict[str, EdgeStatistics]
    groups: dict[str, GroupStatistics]
    lost_activity: int
    errors: list[str]
    ages_s: dict[str, float] = {}

    def __str__(self) -> str:
        """A table of the nodes, and one of the edges; empty columns are left out."""
        nodes = [
            (
                path,
                one.group,
                one.firings,
                one.calls,
                one.failed,
                one.rate_hz,
                f"{one.busy_share:.0%}",
                seconds(one.busy.mean_s),
                seconds(one.latency.p99_s) if one.latency.count else "",
                one.queued,
                one.active,
                one.doing,
            )
            for path, one in self.nodes.items()
        ]
        columns = ("node", "group", "firings", "calls", "failed", "Hz", "busy", "mean", "latency (99 %)", "queued")
        lines = [f"{self.outcome} after {seconds(self.duration_s)}, {self.firings} firings"]
        lines += ["", *table((*columns, "active", "doing"), nodes)]
        edges = [
            (label, one.sent, one.rate_hz, one.dropped, one.lost, one.drained, one.untaken, one.deepest, one.grown)
            for label, one in self.edges.items()
        ]
        if edges:
            lines += [
                "",
                *table(("edge", "sent", "Hz", "dropped", "lost", "drained", "untaken", "deepest", "grown"), edges),
            ]
        return "\n".join([*lines, *([""] if self.errors else []), *self.errors])
