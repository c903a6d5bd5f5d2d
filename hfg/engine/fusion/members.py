"""Which running nodes may be members of a fused region, and which may lead one; and if not, why.

A firing of a member is a call of its function plus the checks that a wave can make. A node whose firings need more
(`ready()`, a time limit, retries, an observer) is not fused. Each refusal is a reason with its remedy, for
`explaining`. Depends on the model.
"""

from __future__ import annotations

from typing import Any

from hfg.engine.model.policies import Fifo
from hfg.engine.model.running_node import ENDED, RunningNode
from hfg.ports.edges import SyncEdge

__all__ = ["is_alive", "is_plain_and_fed", "lives_by_its_slots", "may_be_called", "may_be_inside", "refusal"]


def refusal(worker: RunningNode, *, declared: bool = False) -> str:
    """Say what keeps a node from being fused, and what to do about it, or ""; `declared`: in the graph, for any run."""
    reason = _of_the_group(worker) or _of_its_options(worker) or _of_its_ports(worker)
    if not (reason or declared):
        ended = any(edge.ended for edge in worker.in_edges)
        return _looks(worker) or ("an optional input has ended (F4)" if ended else "")
    return reason


def _looks(worker: RunningNode) -> str:
    """Of a run or node that is inspected step by step, so that each firing must be seen by itself."""
    core = worker.core
    if not core.fast:
        return "the run interprets every firing: leave out fast=False"
    if core.debug:
        return "the run checks every firing: leave out debug=True"
    if core.trace is not None:
        return "a trace sees every firing: stop tracing, or trace changes only (changes_only=True)"
    if worker.within is not None:
        return "it is inside of a subgraph that iterates, which looks after each step (G4)"
    if worker.halt is not None:
        return "it has a breakpoint: remove that"
    if worker.observed or worker.idle_callbacks is not None:
        return "code or an edit waits for its next firing: it is fused again when the run goes on"
    if worker.slot_edges and any(event.tap for event in worker.events.values()):
        return "its events are tapped, which tells the number of each call: end the tap"
    if worker.group.threaded and any(edge.tap is not None for edges in worker.out_edges for edge in edges):
        return "its outputs are tapped, and it runs in a thread: end the tap"
    return ""


def _of_the_group(worker: RunningNode) -> str:
    group = worker.group
    if not isinstance(group.policy, Fifo):
        return f'group "{group.name}" is not first in, first out: give it policy="fifo", or the node another group'
    if group.several:
        return f'group "{group.name}" has several threads, which one wave would keep waiting: use threads=1'
    if group.threaded and (worker.is_async or worker.listeners):
        return "its code, or a slot that listens only while active, is for the loop: take it out of the thread group"
    if is_alive(worker) and (group.threaded or worker.is_async):
        why = "async" if worker.is_async else "in a thread group"
        return f"it is {why} and has slots, a gate or `processed` connected: write a plain function on the loop"
    return ""


def _of_its_options(worker: RunningNode) -> str:
    options = worker.options
    if worker.type is None or options is None or worker.scope is not None:
        return "it is no node with code of its own"
    if options.max_duration_s and (worker.is_async or worker.group.threaded):
        return "its firings have a time limit: leave out max_duration_s="
    if worker.ready_hook is not None:
        return "it is asked `ready()` before each firing: leave that out, or stay silent instead"
    if any(gate.idle_rate_hz is not None for gate in worker.gates_over):
        return "a gate throttles it: leave out idle_rate_hz="
    if worker.concurrent is not None:
        return "it has several firings at once: leave out concurrency="
    if worker.attempts is not None:
        return "a firing that fails is repeated: leave out retries="
    return "it iterates over a collection (G4)" if worker.iteration is not None else ""


def _of_its_ports(worker: RunningNode) -> str:
    """Whether it takes values and gives values, and that is all that passes its inputs and outputs."""
    kind = worker.type
    if worker.shape.remembers:
        return "its event `failed` is connected, which tells what a firing took: disconnect it"
    if any(edge.source is worker and type(edge) is SyncEdge for edge in worker.slot_edges):
        return "its output leads to a slot of its own: use an event for that"
    parameter = any(edge.target_kind != "input" for edge in worker.in_edges)
    if parameter or len(worker.out_names) != len(kind.outputs):
        return "a parameter of it is connected: set it with run.set, or make it an input or output"
    if any(worker.wants_token):
        return "its code takes tokens: take values"
    return "it is async and has events: use outputs, or a plain function" if worker.is_async and kind.events else ""


def is_alive(worker: RunningNode) -> bool:
    """Whether more than its inputs decides what a firing does, or more than its outputs leaves with it.

    Only waves on the loop check this, and not those in which async code lets others run.
    """
    return bool(worker.slot_edges or worker.gates_over or worker.shape.announced)


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
        and not refusal(worker)
    )


def may_be_called(worker: RunningNode) -> bool:
    """Whether a slot call of it may be a member: it lives by one slot that an output of its own group feeds."""
    if len(worker.slot_edges) != 1 or not lives_by_its_slots(worker):
        return False
    edge = worker.slot_edges[0]
    return bool(
        type(edge) is SyncEdge
        and edge.depth_first
        and edge.handler is not None
        and not (edge.while_active or edge.takes_token)
        and not worker.unfit
        and isinstance(worker.group.policy, Fifo)
        and not _looks(worker)
    )


def lives_by_its_slots(worker: RunningNode) -> bool:
    """Whether its calls may take the fast path: it is not observed, and only itself depends on its activity."""
    options, core = worker.options, worker.core
    if options is None or worker.group.threaded or worker.is_source or worker.in_edges or worker.within is not None:
        return False
    held = worker.gates_over or worker.ready_hook is not None or options.max_rate_hz or options.max_duration_s
    looked_at = worker.observed or worker.idle_callbacks is not None or worker.scopes or worker.watched
    interpreted = not core.fast or core.debug or core.trace is not None
    return bool(worker.slot_edges) and not held and not looked_at and not interpreted


def is_plain_and_fed(worker: RunningNode) -> bool:
    """Whether it is a source, or a function with an edge into each mandatory input, and is not observed."""
    if worker.type is None or worker.process is None or refusal(worker):
        return False
    if worker.slot_edges and not _waits_after_firing(worker):
        return False
    if worker.is_source:
        return worker.type.process_kind in ("generator", "function")
    if worker.type.process_kind not in ("function", "async"):
        return False
    return bool(0 < len(worker.live_inputs) == len(worker.in_edges) and _has_all(worker))


def _waits_after_firing(worker: RunningNode) -> bool:
    """Whether its next firing is only enabled when its outputs are processed: calls that come meanwhile go first.

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
