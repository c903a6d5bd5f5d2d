"""Samples of single nodes and edges, for a page that shows them many times per second; cheaper than statistics.

Depends on `measuring`.
"""

from __future__ import annotations

from collections import deque
from itertools import islice
from typing import Any, NamedTuple

from hfg.engine.model.running_node import RunningNode
from hfg.engine.observing.measuring import Measuring, doing
from hfg.engine.runtime.engine import Engine
from hfg.engine.runtime.places import edges_at, place_of
from hfg.graph import Edge

__all__ = ["BARS", "Box", "Flow", "Sample", "Sampler"]

BARS = 24
"""How many of the newest durations a sample has."""


class Sample(NamedTuple):
    """One node.

    Attributes:
      doing: "working", or what it waits for (`NodeStatistics.waiting`).
      active: A(v).
      failed: failed firings and calls so far.
      done: firings and calls so far.
      p50_s, p99_s: how long they took.
      rate_hz: of them a second, over the last one to two seconds.
      active_share, busy_share: of the time since measuring began.
      newest_s: how long the last ones took, oldest first.
    """

    doing: str
    active: bool
    failed: int
    done: int
    p50_s: float
    p99_s: float
    rate_hz: float
    active_share: float
    busy_share: float
    newest_s: list[float]


class Box(NamedTuple):
    """A firing or call that has ended: which node's, when on the run's clock, how long it took."""

    worker: RunningNode
    ended: float
    seconds: float


class Flow(NamedTuple):
    """One edge: how much was sent over it so far, how much of it is not taken yet."""

    sent: int
    untaken: int


class Sampler:
    """Samples one run. Times are measured from its first use on."""

    def __init__(self, engine: Engine, measuring: Measuring) -> None:
        self._engine = engine
        self._measuring = measuring

    def node(self, path: str) -> Sample | None:
        """Return how a node is; None if no node of this process has this path."""
        worker = self._engine.core.by_path.get(path)
        if worker is None or worker.type is None or worker.scope is not None:
            return None
        measuring = self._measuring
        meter = measuring.fold(worker)
        p50_s, p99_s = meter.spent.percentiles()
        passed_s, machine_s, over_s = measuring.spans()
        newest = meter.spent.newest
        return Sample(
            doing=doing(worker),
            active=worker.active,
            failed=worker.counts.failed,
            done=worker.counts.done,
            p50_s=p50_s,
            p99_s=p99_s,
            rate_hz=(worker.counts.done - meter.before) / over_s if over_s > 0 else 0.0,
            active_share=min(1.0, meter.active / passed_s) if passed_s > 0 else 0.0,
            busy_share=min(1.0, meter.busy_s / machine_s) if machine_s > 0 else 0.0,
            newest_s=list(islice(newest, max(0, len(newest) - BARS), None)),
        )

    def settle(self) -> None:
        """Count what fast paths have not counted yet; once before several samples."""
        self._engine.core.settle_counts()
        self._engine.core.settle_barriers()

    def flow(self, edge: Edge) -> Flow | None:
        """Return how much has passed an edge as it is drawn; None if there is none in this process."""
        edges = edges_at(self._engine, place_of(self._engine, edge))
        if not edges:
            return None
        return Flow(sum(one.sent for one in edges), sum(one.untaken for one in edges))

    def note_boxes(self, into: deque[Any]) -> None:
        """Let each firing and call that is measured be noted there, until `forget_boxes`."""
        self._measuring.note_boxes(into)

    def forget_boxes(self, into: deque[Any]) -> None:
        """Note them there no more."""
        self._measuring.forget_boxes(into)

    def done(self) -> int:
        """Return how many firings and calls there were so far, measured or not."""
        self.settle()
        return sum(worker.counts.done for worker in self._engine.core.workers if worker.type is not None)
