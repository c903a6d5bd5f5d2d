"""Chooses how a running node does its next piece of work, for its present shape.

It chooses again whenever the wiring or the observers of the node change. Depends on `slots` and `firing`.
"""

from __future__ import annotations

from collections.abc import Callable

from hfg.base.token import END
from hfg.engine.fusion.giving_way import AsyncRegion
from hfg.engine.fusion.members import is_alive, is_plain_and_fed, lives_by_its_slots
from hfg.engine.fusion.region import Region
from hfg.engine.fusion.schedule import schedule
from hfg.engine.fusion.slots import calls_step
from hfg.engine.fusion.threads import SOONER_IN_THREADS, ThreadRegion
from hfg.engine.fusion.waiting import waiting_step
from hfg.engine.model.running_node import RunningNode
from hfg.engine.rules import firing, iterating

__all__ = ["specialise"]

Step = Callable[[RunningNode], None]


def specialise(worker: RunningNode) -> None:
    """Choose the shortest step that is right for the node's present shape; its breakpoint, if any, comes first."""
    region = worker.region
    if region is not None:
        region.dissolve()  # which calls this for each member, now or after the current call
        return
    step = _step_of(worker)
    worker.use_step(step if worker.halt is None else worker.halt(step))


def _step_of(worker: RunningNode) -> Step:
    if worker.within is not None:  # after each step, its border checks whether that was the last (G4)
        return iterating.step
    if worker.node is None and worker.process is not None:  # it takes what comes out, or lays down what comes in
        return worker.process
    if worker.is_boundary_output:
        return _leave_lying
    if lives_by_its_slots(worker):
        return calls_step(worker)
    if not is_plain_and_fed(worker):
        return firing.step
    waits = worker.is_async and not (worker.paced or is_alive(worker))
    alone = waiting_step(worker) if waits else firing.step
    return alone if worker.unfit else _until_warm(worker, alone)


def _until_warm(worker: RunningNode, alone: Step) -> Step:
    """Return a step that runs `alone` until the node has fired so often that fusing pays, and forms a region then."""
    core = worker.core
    threaded = worker.group.threaded
    left = core.fuse_after // SOONER_IN_THREADS if threaded else core.fuse_after

    def step(worker: RunningNode) -> None:
        nonlocal left
        left -= 1
        if (
            left < 0
            and not _has_ended(worker)
            and core.started
            and not core.over
            and not core.paused
            and worker.region is None
        ):
            found = schedule(worker)
            if found is None or (threaded and len(found.order) == 1):  # in a thread that is one job a wave as it is
                worker.use_step(alone)
            else:
                kind = ThreadRegion if threaded else AsyncRegion if any(one.is_async for one in found.order) else Region
                worker.use_step(kind(found, specialise).step)
            worker.step(worker)
        else:
            alone(worker)

    return step


def _leave_lying(worker: RunningNode) -> None:
    """A graph output: its token lies there until it is read (P10)."""
    worker.dequeued()


def _has_ended(worker: RunningNode) -> bool:
    """Whether its next firing is its last, for which no region needs to be made."""
    return worker.special and any(token.value is END for edge in worker.live_inputs for token in edge.contents()[:1])
