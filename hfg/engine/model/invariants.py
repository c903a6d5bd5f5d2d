"""What holds of a whole run between two of its steps: of nodes, edges and regions, and between them.

Checked in debug mode and by tests.
"""

from __future__ import annotations

from collections import Counter

from hfg.engine.model.core import Core
from hfg.engine.model.running_node import RunningNode
from hfg.errors import EngineInternalError
from hfg.ports.edges import EventEdge

__all__ = ["check_invariants"]


def check_invariants(core: Core[RunningNode]) -> None:
    """Check what holds of a whole run between two of its steps.

    Raises:
      EngineInternalError: one of them does not.
    """
    if core.over:
        return
    _check_nodes(core)
    for region in core.regions:
        region.check_invariants()
    _check_queues(core)
    if core.next_in_wave or core.returned or core.drained or core.deferred_events is not None:
        raise EngineInternalError("a sending is not over: who follows, or what was returned or drained, is left")
    for scope in core.scopes:
        if scope.watched and scope not in core.dirty_scopes and scope.active != scope.derive():
            raise EngineInternalError(f'subgraph "{scope.path}": its activity is not that of its inside (G2)')


def _check_nodes(core: Core[RunningNode]) -> None:
    """The nodes at the ends of edges have counted the tokens on them."""
    held: Counter[RunningNode] = Counter()
    full: Counter[RunningNode] = Counter()
    for edge in core.edges:
        edge.check_invariants()
        if isinstance(edge, EventEdge):
            full[edge.source] += edge.full
        else:
            held[edge.waits] += edge.unprocessed
    for node in core.workers:
        node.check_invariants()
        node.outputs.check_invariants(held[node], f'outputs of "{node.path}"')
        if node.room.full_edges != full[node]:
            raise EngineInternalError(f'node "{node.path}": {full[node]} of its queues are full (F8)')
        if node.region is not None and node.region not in core.regions:
            raise EngineInternalError(f'node "{node.path}": its region is gone')


def _check_queues(core: Core[RunningNode]) -> None:
    """Queued nodes are in the ready queue of their group, once, and no others are."""
    standing = Counter(node for group in {node.group for node in core.workers} for node in group.policy)
    for node in core.workers:
        if standing[node] != node.queued:
            raise EngineInternalError(f'node "{node.path}": it is {standing[node]} times in its ready queue')
