"""A glance at a run: the few counts that a live table shows, cheap enough to take many times a second.

`Statistics` says more and costs ten times as much. Everything that grows is a count since the run began, so whoever
looks twice knows rates and shares. Depends on `measuring`.
"""

from __future__ import annotations

import time

import msgspec

from hfg.engine.fusion.explaining import is_fused
from hfg.engine.observing.measuring import Measuring, doing
from hfg.engine.runtime.engine import Engine

__all__ = ["Glance", "MonitorGlance", "NodeGlance", "glance_at"]


class NodeGlance(msgspec.Struct, frozen=True, array_like=True, gc=False):
    """One node.

    Attributes:
      path: where it stands in the graph.
      group: where it runs.
      done: firings and slot calls so far.
      busy_s: for how long its code kept its group busy, on the machine's clock, since the first look.
      queued: untaken tokens in front of it.
      failed: failed firings and calls so far.
      active: A(v).
      doing: "working", or what it waits for (`NodeStatistics.waiting`).
      under_way: how many of its firings are in progress now.
      retries: how often a firing was tried again so far.
      age_s: how long ago its counts were taken, on the run's clock: a node of another process is as of its last report.
      fused: whether its firings are part of a region's waves (`Run.explain`).
      deadline_s: how old its data may be when it is done with it; 0 if nothing is declared.
      oldest_s: how old it was at most, since the first look.
    """

    path: str
    group: str
    done: int
    busy_s: float
    queued: int
    failed: int
    active: bool
    doing: str
    under_way: int = 0
    retries: int = 0
    age_s: float = 0.0
    fused: bool = False
    deadline_s: float = 0.0
    oldest_s: float = 0.0


class MonitorGlance(msgspec.Struct, frozen=True, array_like=True, gc=False):
    """One monitor.

    Attributes:
      name: of the monitor.
      verdict: "holds", "violated", "not yet" or "unknown".
      violations: how often it was violated.
    """

    name: str
    verdict: str
    violations: int = 0


class Glance(msgspec.Struct, frozen=True):
    """What a run is doing.

    Attributes:
      graph: its name.
      outcome: "running", "paused", or how it ended.
      duration_s: since it began, on its clock; 0 before.
      machine_s: now, on the machine's monotonic clock.
      nodes: in order of adding, those inside iterating subgraphs too.
      lost: tokens that are gone with processes of groups (L2).
      growing: capacities by edge: queues that have grown to many times what was declared (F8).
      monitors: what is known of each.
    """

    graph: str
    outcome: str
    duration_s: float
    machine_s: float
    nodes: list[NodeGlance]
    lost: int = 0
    growing: dict[str, int] = {}
    monitors: list[MonitorGlance] = []


def glance_at(engine: Engine, measuring: Measuring) -> Glance:
    """Look at a run; to be called on its loop."""
    nodes, deadlines = [], measuring.deadlines
    engine.core.settle_counts()
    engine.core.settle_barriers()
    for worker in engine.core.workers:
        if worker.type is None or worker.scope is not None:
            continue
        deadline_s = deadlines.get(worker.path, 0.0)
        meter = measuring.fold(worker) if deadline_s else worker.meter
        nodes.append(
            NodeGlance(
                worker.path,
                worker.group.name,
                worker.counts.done,
                0.0 if meter is None else meter.busy_s,
                sum([edge.untaken for edge in (*worker.in_edges, *worker.slot_edges)]),
                worker.counts.failed,
                worker.active,
                doing(worker),
                worker.firings_under_way(),
                worker.counts.retries,
                fused=is_fused(worker),
                deadline_s=deadline_s,
                oldest_s=0.0 if meter is None else meter.delays.longest,
            )
        )
    return Glance(
        graph=engine.graph.name,
        outcome="paused" if engine.core.paused and engine.outcome == "running" else engine.outcome,
        duration_s=engine.elapsed() if engine.core.started else 0.0,
        machine_s=time.monotonic(),
        nodes=nodes,
        lost=sum(edge.lost for edge in engine.core.edges),
        monitors=[MonitorGlance(*one) for monitors in engine.callbacks.glanced for one in monitors()],
        growing={edge.label: edge.capacity for edge in engine.core.overgrown if edge in engine.core.edges},
    )
