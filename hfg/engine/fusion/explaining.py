"""Says of each node whether its firings are fused, with which others, and if not, why. Stands on `members`."""

from __future__ import annotations

import msgspec

from hfg.engine.fusion.members import lives_by_its_slots, refusal
from hfg.engine.model.running_node import ENDED, RunningNode
from hfg.ports.edges import EventEdge, SyncEdge

__all__ = ["Explanation", "explain"]


class Explanation(msgspec.Struct, frozen=True):
    """How a node does its work.

    Attributes:
      fused: its firings, or its slot calls, are part of a region's waves.
      members: paths of the nodes of that region, in the order in which they fire; empty if it is not fused.
      reason: if it is not fused: the first reason, and what to do about it. Otherwise empty.
    """

    fused: bool
    members: tuple[str, ...] = ()
    reason: str = ""

    def __str__(self) -> str:
        if not self.fused:
            return f"interpreted: {self.reason}"
        others = len(self.members) - 1
        return f"fused with {others} {'other' if others == 1 else 'others'}" if others else "fused alone"


def explain(worker: RunningNode) -> Explanation:
    """Explain how a running node does its work at this moment, or did it until it ended."""
    over = worker.core.over or worker.blocked & ENDED  # then it is how it was before
    if worker.region is not None or (over and worker.fused_with):
        return Explanation(True, worker.fused_with)
    return Explanation(False, reason=_why_not(worker))


def _why_not(worker: RunningNode) -> str:
    if worker.process is None and worker.iteration is None:
        if worker.slot_edges and lives_by_its_slots(worker):
            return "it has only slots, whose calls are short as they are"
        return "it has only slots: they are called one by one"
    reason = refusal(worker)
    if reason:
        return reason
    if worker.unfit:
        return "its firings hardly ever end with a plain value: return values, not tokens, and await nothing"
    if worker.type.process_kind not in ("generator", "function", "async"):
        return "it is an async generator, which waits on its own"
    if not worker.is_source and len(worker.live_inputs) < len(worker.in_edges):
        return "a node before it is disabled: enable that"
    return _not_begun(worker)


def _not_begun(worker: RunningNode) -> str:
    """Nothing is wrong with the node itself: what leads to it."""
    fired, after = worker.counts.firings, worker.core.fuse_after
    for edge in worker.in_edges:
        if type(edge) is EventEdge:
            before = f'event "{edge.label.partition(" -> ")[0]}"'
        elif type(edge) is SyncEdge and edge.depth_first:
            continue
        else:
            before = f'"{edge.label.partition(" -> ")[0]}" over an edge with a queue, to another group, or pipelined'
        if fired > after:
            return f"it is fed by {before}, and no node after it could be fused with it"
    if fired <= after:
        return f"it has fired {fired} times; nodes are fused after {after} firings"
    return "a node before it is not fused, or fires at other times: see the explanation of that node"
