"""Samples of single nodes and edges, for a page that shows them many times per second; cheaper than statistics.

Depends on `measuring`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any, NamedTuple

from hfg.engine.model.running_node import RunningNode
from hfg.engine.observing.measuring import Measuring, doing
from hfg.engine.observing.statistics import NodeStatistics
from hfg.engine.runtime.engine import Engine
from hfg.engine.runtime.places import edges_at, place_of
from hfg.graph import Edge

__all__ = ["BARS", "Box", "Flow", "Load", "Sample", "Sampler"]

BARS = 24
"""How many of the newest durations a sample has."""

_PERCENTILES_S = 0.25


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
    newest_s: tuple[float, ...]


class Box(NamedTuple):
    """A firing or call that has ended: which node's, when on the run's clock, how long it took."""

    worker: RunningNode
    ended: float
    seconds: float


class Flow(NamedTuple):
    """One edge: how much was sent over it so far, how much of it is not taken yet."""

    sent: int
    untaken: int


class Load(NamedTuple):
    """One group: how many nodes, how many firings and calls per second, and the share of time it was busy."""

    nodes: int
    rate_hz: float
    busy_share: float
    queued: int


class _Percentiles(NamedTuple):
    at: float
    p50_s: float
    p99_s: float


class Sampler:
    """Samples one run. Times are measured from its first use on.

    Call `settle` before several samples. A sample costs some microseconds: nothing is summed up for it beyond what the
    statistics sum up anyway, and percentiles are computed four times per second at most.
    """

    def __init__(self, engine: Engine, measuring: Measuring) -> None:
        self._engine = engine
        self._measuring = measuring
        self._percentiles: dict[str, _Percentiles] = {}
        self._spans = measuring.spans()

    def settle(self) -> None:
        """Sum up what was measured, if that is due; once before several samples."""
        self._measuring.fold_due()
        self._engine.core.settle_barriers()
        self._spans = self._measuring.spans()

    def node(self, path: str) -> Sample | None:
        """Return how a node is; None if no node of this process has this path."""
        worker = self._worker(path)
        if worker is None or worker.meter is None:
            return None
        meter, done = worker.meter, worker.counts.done
        passed_s, machine_s, over_s = self._spans
        known = self._percentiles.get(path)
        if known is None or passed_s - known.at >= _PERCENTILES_S:
            known = self._percentiles[path] = _Percentiles(passed_s, *meter.spent.percentiles())
        return Sample(
            doing=doing(worker),
            active=worker.active,
            failed=worker.counts.failed,
            done=done,
            p50_s=known.p50_s,
            p99_s=known.p99_s,
            rate_hz=(done - meter.before) / over_s if over_s > 0 else 0.0,
            active_share=min(1.0, meter.active / passed_s) if passed_s > 0 else 0.0,
            busy_share=min(1.0, meter.busy_s / machine_s) if machine_s > 0 else 0.0,
            newest_s=tuple(meter.spent.newest)[-BARS:],
        )

    def statistics(self, path: str) -> NodeStatistics | None:
        """Return all that is measured of one node; None if no node of this process has this path."""
        worker = self._worker(path)
        return None if worker is None else self._measuring.node(worker)

    def _worker(self, path: str) -> RunningNode | None:
        worker = self._engine.core.by_path.get(path)
        return None if worker is None or worker.type is None or worker.scope is not None else worker

    def _workers(self) -> Iterator[RunningNode]:
        return (one for one in self._engine.core.workers if one.type is not None and one.scope is None)

    def loads(self) -> dict[str, Load]:
        """Return how busy each group is, by name."""
        _, machine_s, over_s = self._spans
        found = dict.fromkeys(self._engine.groups, Load(0, 0.0, 0.0, 0))
        for worker in self._workers():
            meter, name = worker.meter, worker.group.name
            so_far = found.get(name, Load(0, 0.0, 0.0, 0))
            rate = 0.0 if meter is None or over_s <= 0 else (worker.counts.done - meter.before) / over_s
            busy = 0.0 if meter is None or machine_s <= 0 else meter.busy_s / machine_s
            nodes, queued = so_far.nodes + 1, so_far.queued + bool(worker.queued)
            found[name] = Load(nodes, so_far.rate_hz + rate, so_far.busy_share + busy, queued)
        return found

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
        return sum(worker.counts.done for worker in self._workers())
