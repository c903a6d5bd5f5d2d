"""What holds of a whole run between two of its steps: of nodes, edges and regions, and between them.

Asked in debug mode and by tests. Stands on `running_node` and `core`.
"""

from __future__ import annotations

from collections import Counter

from hfg.engine.model.core import Core
from hfg.engine.model.running_node import RunningNode
from hfg.errors import EngineInternalError
from hfg.ports.edges import EventEdge

__all__ = ["check_invariants"]


def check_invariants(core: Core[RunningNode]) -> None:
    """Between two steps of the run certain things hold of all of it: nodes, edges, regions, and between them.

    Raises:
      EngineInternalError: one of them does not.
    """
    if core.over:
        return
    _check_workers(core)
    for region in core.regions:
        region.check_invariants()
    _check_queues(core)
    if core.next_in_wave or core.returned or core.drained or core.deferred_events is not None:
        raise EngineInternalError("a sending is not over: who follows, or what was returned or drained, is left")
    for scope in core.scopes:
        if scope.watched and scope not in core.dirty_scopes and scope.active != scope.derive():
            raise EngineInternalError(f'subgraph "{scope.path}": its activity is not that of its inside (G2)')


def _check_workers(core: Core[RunningNode]) -> None:
    """What lies on the edges is what the nodes at their ends have counted."""
    held: Counter[RunningNode] = Counter()
    full: Counter[RunningNode] = Counter()
    for edge in core.edges:
        edge.check_invariants()
        if isinstance(edge, EventEdge):
            full[edge.source] += edge.full
        else:
            held[edge.waits] += edge.unprocessed
    for worker in core.workers:
        worker.check_invariants()
        worker.outputs.check_invariants(held[worker], f'outputs of "{worker.path}"')
        if worker.room.full_edges != full[worker]:
            raise EngineInternalError(f'node "{worker.path}": {full[worker]} of its queues are full (F8)')
        if worker.region is not None and worker.region not in core.regions:
            raise EngineInternalError(f'node "{worker.path}": its region is gone')


def _check_queues(core: Core[RunningNode]) -> None:
    """Who is queued stands in the run queue of its group, once, and nobody else does."""
    standing = Counter(worker for group in {worker.group for worker in core.workers} for worker in group.policy)
    for worker in core.workers:
        if standing[worker] != worker.queued:
            raise EngineInternalError(f'node "{worker.path}": it stands {standing[worker]} times in its run queue')
