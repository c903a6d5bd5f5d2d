"""Which running nodes may be members of a fused region, and which may lead one.

A member's firings are calls of its function and nothing else: what else a firing may be asked to do (a gate, a time
limit, `ready()`, slots, somebody who looks) is for the interpreted way. Stands on the model.
"""

from __future__ import annotations

from typing import Any

from hfg.engine.model.policies import Fifo
from hfg.engine.model.running_node import ENDED, RunningNode
from hfg.ports.edges import SyncEdge

__all__ = ["is_alive", "is_plain_and_fed", "lives_by_its_slots", "may_be_called", "may_be_inside"]


def _is_plain(worker: RunningNode) -> bool:
    """Its firings are calls of a function and nothing else."""
    return (
        worker.type is not None
        and worker.options is not None
        and worker.scope is None
        and _nobody_looks(worker)
        and isinstance(worker.group.policy, Fifo)
        and not worker.group.several  # of which one wave would keep the other threads waiting
        and not (worker.group.threaded and (worker.is_async or worker.listeners))  # which is for the loop to look at
        and not (is_alive(worker) and (worker.group.threaded or worker.is_async))
        and not (worker.options.max_duration_s and (worker.is_async or worker.group.threaded))  # else it never waits
        and worker.ready_hook is None
        and all(gate.idle_rate_hz is None for gate in worker.gates_over)
        and worker.concurrent is None
        and worker.attempts is None
        and worker.iteration is None
        and _values_in_and_out(worker)
    )


def _values_in_and_out(worker: RunningNode) -> bool:
    """It takes values and gives back values, and that is all that passes its ports."""
    kind = worker.type
    return (
        not worker.shape.remembers
        and not any(edge.source is worker and type(edge) is SyncEdge for edge in worker.slot_edges)
        and len(worker.out_names) == len(kind.outputs)
        and not any(worker.wants_token)
        and all(edge.target_kind == "input" and not edge.ended for edge in worker.in_edges)
        and not (worker.is_async and kind.events)
    )


def _nobody_looks(worker: RunningNode) -> bool:
    """No edit waits for it, nobody at its barriers, no breakpoint; and no tap where a wave runs in a thread.

    Nor does anybody look at the events of its slots, who would want to know in which call a signal was triggered: in a
    wave calls are not numbered one by one.
    """
    return (
        not worker.observed
        and worker.idle_callbacks is None
        and worker.halt is None
        and not (worker.slot_edges and any(event.tap for event in worker.events.values()))
        and not (worker.group.threaded and any(edge.tap is not None for edges in worker.out_edges for edge in edges))
    )


def may_be_inside(worker: RunningNode) -> bool:
    """Whether it may follow the head: its inputs are all fed by outputs of its own group, in the same wave (R2)."""
    return (
        not worker.is_source
        and not worker.unfit
        and not worker.blocked & ENDED
        and worker.type is not None
        and worker.type.process_kind in ("function", "async")
        and 0 < len(worker.live_inputs) == len(worker.in_edges)
        and all(type(edge) is SyncEdge and edge.depth_first for edge in worker.in_edges)
        and not worker.paced
        and _is_plain(worker)
    )


def is_alive(worker: RunningNode) -> bool:
    """Whether more than its inputs decides what a firing does, or more than its outputs leaves with it.

    Only a wave on the loop looks at that, and none in which async code gives way to others.
    """
    return bool(worker.slot_edges or worker.gates_over or worker.shape.announced)


def may_be_called(worker: RunningNode) -> bool:
    """Whether a slot call of it may be a member: it lives by one slot that an output of its own group feeds."""
    if len(worker.slot_edges) != 1 or not lives_by_its_slots(worker):
        return False
    edge = worker.slot_edges[0]
    return bool(
        type(edge) is SyncEdge
        and edge.depth_first
        and edge.handler is not None
        and not edge.while_active
        and not worker.unfit
        and isinstance(worker.group.policy, Fifo)
        and _nobody_looks(worker)
    )


def lives_by_its_slots(worker: RunningNode) -> bool:
    """Its calls may go the fast path: nobody looks, and nothing depends on its activity but itself."""
    options = worker.options
    if options is None or worker.group.threaded or worker.is_source or worker.in_edges or not _may_be_fast(worker):
        return False
    held = worker.gates_over or worker.ready_hook is not None or options.max_rate_hz or options.max_duration_s
    looked_at = worker.observed or worker.idle_callbacks is not None or worker.scopes or worker.watched
    return bool(worker.slot_edges) and not held and not looked_at


def _may_be_fast(worker: RunningNode) -> bool:
    """Nobody looks at all that happens in the run, and no border behind each step (G4)."""
    core = worker.core
    return core.fast and not core.debug and core.trace is None and worker.within is None


def is_plain_and_fed(worker: RunningNode) -> bool:
    """Whether it is a source, or a function with an edge into each input that it waits for, and nobody looks."""
    if not _may_be_fast(worker):
        return False
    if worker.type is None or worker.process is None or not _is_plain(worker):
        return False
    if worker.slot_edges and not _waits_after_firing(worker):
        return False
    if worker.is_source:
        return worker.type.process_kind in ("generator", "function")
    if worker.type.process_kind not in ("function", "async"):
        return False
    return bool(0 < len(worker.live_inputs) == len(worker.in_edges) and _has_all(worker))


def _waits_after_firing(worker: RunningNode) -> bool:
    """Whether its next firing is never enabled before its outputs are processed: calls that come amid it go first.

    Where nothing waits for what it sends, its next firing has its place when this one begins, before those calls (F9).
    """
    return any(
        type(edge) is SyncEdge and edge.target_kind == "input" and not edge.target.blocked & ENDED
        for edges in worker.out_edges
        for edge in edges
    )


def _has_all(worker: RunningNode) -> bool:
    fed: set[Any] = {edge.port_name for edge in worker.live_inputs}
    return all(name in fed for name in worker.mandatory_ports)
