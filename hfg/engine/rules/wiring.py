"""Which edges are live, and what that makes of a worker (SEMANTICS "live edge", rules F1, F5, F10, G1).

Called when the plan is made and when something is enabled, disabled, ended or edited; never per token. Depends on
`worker`.
"""

from __future__ import annotations

from hfg.engine.model import Scope
from hfg.engine.model.running_node import DISABLED, UNWIRED, RunningNode
from hfg.engine.rules.agenda import consider, note_full
from hfg.engine.rules.listening import find_listeners
from hfg.ports.edges import AnyEdge, Edge, EventEdge

__all__ = ["is_live", "reaches", "refresh", "refresh_via", "rewire"]


def is_live(edge: Edge) -> bool:
    """Both ends enabled, or the target is an `enable` slot; and no relay on the way disabled."""
    return not edge.source.blocked & DISABLED and reaches(edge)


def reaches(edge: Edge) -> bool:
    """The same without the source: what that sent before it was disabled is still delivered (F10)."""
    if edge.target.blocked & DISABLED and not (edge.target_kind == "slot" and edge.port_name == "enable"):
        return False
    around = (*edge.source.around, *edge.target.around)  # whether those are enabled is known by their nodes
    return all(scope.enabled for scope in edge.via if scope not in around)


def refresh(worker: RunningNode) -> None:
    """Derive again what is live around a worker: it and its neighbours."""
    touched = {worker.index: worker}
    for edge in worker.edges_in():
        edge.enliven(is_live(edge))
        touched[edge.source.index] = edge.source
    for edge in worker.all_out_edges():
        edge.enliven(is_live(edge))
        touched[edge.target.index] = edge.target
    for edge in (*worker.edges_in(), *worker.event_edges()):
        if type(edge) is EventEdge:
            note_full(edge)
    for neighbour in touched.values():
        rewire(neighbour)


def refresh_via(scope: Scope) -> None:
    """A subgraph was enabled or disabled: edges that only pass through it change too."""
    if scope.worker is None:
        return
    for edge in scope.worker.core.edges:
        if scope in edge.via:
            edge.enliven(is_live(edge))
            if type(edge) is EventEdge:
                note_full(edge)
            rewire(edge.source)
            rewire(edge.target)


def rewire(worker: RunningNode) -> None:
    """Derive what a worker waits for and sends on from the liveness of its edges; its step is chosen again."""
    worker.rewire(tuple(edge for edge in worker.in_edges if _is_waited_for(edge)))
    find_listeners(worker)
    if worker.is_boundary_output or _may_fire(worker):
        worker.allow(UNWIRED)
    else:
        worker.block(UNWIRED)
    worker.changed()
    if worker.core.started:
        consider(worker)


def _is_waited_for(edge: AnyEdge) -> bool:
    """Whether the next firing takes from the edge."""
    if (edge.ended and not edge.untaken) or not edge.joins():
        return False
    return edge.live or (type(edge) is EventEdge and bool(edge.queue))  # what was sent before is delivered (F10)


def _may_fire(worker: RunningNode) -> bool:
    """F1: whether it is a source or has a live input, and each mandatory input has a live edge, or has had END."""
    if worker.process is None or not (worker.is_source or worker.live_inputs):
        return False
    fed = {edge.port_name for edge in worker.live_inputs if edge.target_kind == "input"}
    fed |= {edge.port_name for edge in worker.in_edges if edge.ended}
    return fed.issuperset(worker.mandatory_ports)
