"""Measuring a run while it runs, for its statistics (rule R7).

Counts exist anyway. Times are measured from the first time somebody asks: the code of the nodes by `meters`, and what
nodes wait for by looking at all of them, twenty times a second; under a virtual clock whenever time passes, which is
exact. Depends on `meters` and `statistics`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from time import monotonic
from typing import Any

from msgspec import structs

from hfg.engine.executing.virtual import VirtualTimeLoop
from hfg.engine.fusion.specialise import specialise
from hfg.engine.model.running_node import (
    BACKOFF,
    DEAD_SOURCE,
    DISABLED,
    ENDED,
    FULL,
    RATE,
    RECORDED,
    RESTING,
    STARTING,
    TORN_DOWN,
    UNREADY,
    UNWIRED,
    RunningNode,
)
from hfg.engine.observing.meters import Distribution, Meter
from hfg.engine.observing.report import edge_report, node_report
from hfg.engine.observing.statistics import EdgeStatistics, GroupStatistics, NodeStatistics, Statistics, Times
from hfg.engine.runtime.callbacks import Edited
from hfg.engine.runtime.engine import Engine
from hfg.graph.flat import flatten
from hfg.graph.flat.deadlines import deadlines
from hfg.ports.edges import AnyEdge

__all__ = ["Measuring", "doing"]

_LOOK_EVERY_S = 0.05
_LOOKS_SHARE = 0.01  # of the loop's time at most
_RATE_OVER_S = 1.0


def doing(worker: RunningNode) -> str:
    """Say what a node does or waits for now, in the words of `NodeStatistics.waiting`."""
    if worker.busy or worker.has_concurrent_code():
        return "working"
    if worker.tasks is not None and worker.tasks.doing.task is not None:
        return "do"
    blocked = worker.blocked
    if worker.queued and not blocked & TORN_DOWN:
        return "turn"
    if blocked:
        word = next((word for bit, word in _BLOCKED if blocked & bit), "ended")
        return "signal" if word == "unconnected" and worker.process is None else word
    if worker.inputs.missing:
        for edge in worker.live_inputs:
            if not edge.untaken:
                return f"input {edge.port_name}"
    if worker.outputs.missing:
        for name, edges in zip(worker.out_names, worker.out_edges, strict=False):
            if any(edge.unprocessed for edge in edges):
                return f"output {name}"
    return "turn"


_BLOCKED = (
    (DISABLED, "disabled"),
    (ENDED, "ended"),
    (STARTING, "start"),
    (BACKOFF, "restart"),
    (RESTING, "gate"),
    (FULL, "queue"),
    (RECORDED, "recorder"),
    (RATE, "rate"),
    (UNREADY, "ready"),
    (UNWIRED, "unconnected"),
    (DEAD_SOURCE, "ended"),
)


class Measuring:
    """Measures a run from now on, until it ends."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._began = self._looked = engine.now()
        self._began_on_machine = monotonic()
        self._ended_on_machine: float | None = None
        self._fold_at = 0.0
        self._mark_at = self._before_at = self._began
        self._marks: dict[Any, int] = {}
        self._before: dict[Any, int] = {}
        self._timer: Any = None
        self._boxes: tuple[deque[Any], ...] = ()
        self._deadlines: dict[str, float] | None = None
        self._mark_edges()
        self._before = self._marks
        for worker in self._workers():
            self._meter(worker)
        engine.callbacks.pumped.append(self.fold_due)
        engine.callbacks.finished.append(self._end)
        engine.callbacks.edited.append(self._refit)
        loop: Any = engine.loop
        if isinstance(loop, VirtualTimeLoop):
            loop.watchers.append(self._passed)
        elif engine.ended_how is None:  # after the run its loop may be closed
            self._timer = loop.call_later(_LOOK_EVERY_S, self._look, context=engine.context)
        if engine.ended_how is not None:
            self._end()

    def _workers(self) -> Iterator[RunningNode]:
        return (worker for worker in self._engine.core.workers if worker.type is not None and worker.scope is None)

    def _meter(self, worker: RunningNode) -> Meter:
        meter: Meter | None = worker.meter
        if meter is None:
            meter = Meter(worker)
            meter.boxes = self._boxes
            meter.measure()
            if worker.core.started:
                specialise(worker)
        return meter

    @property
    def deadlines(self) -> dict[str, float]:
        """The earliest deadline that the graph declares for each node, by path."""
        if self._deadlines is None:
            self._deadlines = {
                flat.nodes[index].path: seconds
                for flat in flatten(self._engine.graph).walk()
                for index, (seconds, _) in deadlines(flat).items()
            }
        return self._deadlines

    def _refit(self, edited: Edited) -> None:
        """These workers have other nodes now: from here on the code of those is measured."""
        self._deadlines = None
        for worker in edited.workers:
            if worker.meter is not None:
                worker.meter.refit()
                specialise(worker)

    def _end(self) -> None:
        """The run is over."""
        if self._ended_on_machine is not None:
            return
        self._ended_on_machine = monotonic()
        loop: Any = self._engine.loop
        if self._timer is not None:
            self._timer.cancel()
        elif isinstance(loop, VirtualTimeLoop):
            loop.watchers.remove(self._passed)

    def fold_due(self) -> None:
        """Sum up what was measured, twenty times per second; also called when a slice of the pump is over."""
        if monotonic() >= self._fold_at:
            began = monotonic()
            for worker in self._workers():
                self.fold(worker)
            now = monotonic()
            self._fold_at = now + max(_LOOK_EVERY_S, (now - began) / _LOOKS_SHARE)

    def fold(self, worker: RunningNode) -> Meter:
        """Sum up what was measured of one since the last look."""
        meter = self._meter(worker)
        meter.fold()
        return meter

    # --- looking ----------------------------------------------------------------------------------------------------

    def _look(self) -> None:
        """On the machine's clock: what a node does now it has done since the last look."""
        began = monotonic()
        now = self._engine.now()
        self._passed(now - self._looked)
        self._looked = now
        cost = monotonic() - began
        pause = max(_LOOK_EVERY_S, cost / _LOOKS_SHARE)
        self._timer = self._engine.loop.call_later(pause, self._look, context=self._engine.context)

    def _passed(self, seconds: float) -> None:
        """Time has passed on the run's clock."""
        if self._engine.core.over:
            return
        self._engine.core.settle_barriers()
        for worker in self._workers():
            meter = self._meter(worker)
            what = doing(worker)
            if what != "working":
                meter.waiting[what] = meter.waiting.get(what, 0.0) + seconds
            if worker.active:
                meter.active += seconds
        now = self._engine.now()
        if now - self._mark_at >= _RATE_OVER_S:
            self._before_at, self._mark_at = self._mark_at, now
            self._engine.core.settle_counts()
            for worker in self._workers():
                meter = self._meter(worker)
                meter.before, meter.mark = meter.mark, worker.counts.done
            self._before = self._marks
            self._mark_edges()

    def _mark_edges(self) -> None:
        self._engine.core.settle_counts()
        self._marks = {edge: edge.sent for edge in self._edges()}

    def _edges(self) -> Iterator[AnyEdge]:
        return iter(self._engine.core.edges)

    def spans(self) -> tuple[float, float, float]:
        """Return seconds since measuring began on the run's clock and on the machine's, and those that rates are of."""
        engine = self._engine
        now = engine.now() if engine.time.ended_at is None else engine.time.ended_at
        return (
            now - self._began,
            (self._ended_on_machine or monotonic()) - self._began_on_machine,
            now - self._before_at,
        )

    def note_boxes(self, into: deque[Any]) -> None:
        """Note each firing and call that is measured there, too."""
        self._set_boxes((*self._boxes, into))

    def forget_boxes(self, into: deque[Any]) -> None:
        """Note them there no more."""
        self._set_boxes(tuple(one for one in self._boxes if one is not into))

    def _set_boxes(self, boxes: tuple[deque[Any], ...]) -> None:
        self._boxes = boxes
        for worker in self._workers():
            self._meter(worker).boxes = boxes

    # --- the snapshot -----------------------------------------------------------------------------------------------

    def snapshot(self) -> Statistics:
        """Say what the run has done so far."""
        engine = self._engine
        core = engine.core
        core.settle_barriers()
        passed, machine, over = self.spans()
        nodes: dict[str, NodeStatistics] = {}
        parts: dict[str, list[tuple[RunningNode, NodeStatistics, float]]] = {name: [] for name in engine.groups}
        for worker in self._workers():
            node, busy = self._node(worker, passed, machine, over)
            nodes[worker.path] = node
            parts.setdefault(worker.group.name, []).append((worker, node, busy))
        return Statistics(
            outcome=engine.outcome,
            time=self._began + passed,
            duration_s=engine.elapsed(),
            measured_s=passed,
            machine_s=machine,
            firings=sum(node.firings for node in nodes.values()),
            nodes=nodes,
            edges={edge.label: self._edge(edge, over) for edge in self._edges()},
            groups={name: _group(members, machine) for name, members in parts.items()},
            lost_activity=core.lost_activity,
            errors=[str(error) for error in core.errors],
        )

    def node(self, worker: RunningNode) -> NodeStatistics:
        """Return what one node has done so far."""
        self._engine.core.settle_barriers()
        return self._node(worker, *self.spans())[0]

    def _node(self, worker: RunningNode, passed: float, machine: float, over: float) -> tuple[NodeStatistics, float]:
        meter = self.fold(worker)
        busy = meter.busy_s
        pieces = worker.counts.done
        node = NodeStatistics(
            **structs.asdict(node_report(worker)),
            group=worker.group.name,
            under_way=worker.firings_under_way(),
            rate_hz=_per_second(pieces - meter.before, over),
            busy=_times(meter.spent),
            busy_share=_share(busy, machine),
            latency=_times(meter.delays),
            doing=doing(worker),
            waiting=dict(meter.waiting),
            active_share=_share(meter.active, passed),
            queued=sum(edge.untaken for edge in (*worker.in_edges, *worker.slot_edges)),
            tasks=() if worker.tasks is None else worker.tasks.names,
        )
        return node, busy

    def _edge(self, edge: AnyEdge, over: float) -> EdgeStatistics:
        return EdgeStatistics(
            **structs.asdict(edge_report(edge)),
            rate_hz=_per_second(edge.sent - self._before.get(edge, 0), over),
            deepest=max(edge.deepest, int(edge.sent > edge.dropped + edge.drained)),  # fast paths count from two on
            capacity=getattr(edge, "capacity", None),
        )


def _times(of: Distribution) -> Times:
    median, slow = of.percentiles()
    return Times(of.count, of.total, of.mean, of.longest, median, slow, tuple(of.newest))


def _group(members: list[tuple[RunningNode, NodeStatistics, float]], machine: float) -> GroupStatistics:
    busy = sum(seconds for _, _, seconds in members)
    return GroupStatistics(
        nodes=len(members),
        firings=sum(node.firings for _, node, _ in members),
        calls=sum(node.calls for _, node, _ in members),
        rate_hz=sum(node.rate_hz for _, node, _ in members),
        busy_s=busy,
        busy_share=_share(busy, machine),
        queued=sum(worker.queued for worker, _, _ in members),
    )


def _share(part: float, whole: float) -> float:
    return min(1.0, part / whole) if whole > 0 else 0.0


def _per_second(count: int, seconds: float) -> float:
    return count / seconds if seconds > 0 else 0.0
