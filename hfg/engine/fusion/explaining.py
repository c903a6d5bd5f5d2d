"""Says of each node whether its firings are fused, with which others, and if not, why. Depends on `members`."""

from __future__ import annotations

import msgspec

from hfg.engine.fusion.members import lives_by_its_slots, refusal
from hfg.engine.model.running_node import ENDED, RunningNode
from hfg.ports.edges import EventEdge, SyncEdge

__all__ = ["Explanation", "explain", "is_fused"]


class Explanation(msgspec.Struct, frozen=True):
    """How a node does its work.

    Attributes:
      fused: its firings, or its slot calls, are part of a region's waves.
      members: paths of the nodes of that region, in the order in which they fire; empty if it is not fused.
      reason: if it is not fused: the first reason, and what to do about it. Otherwise empty.
      refused: the reason is the node itself, as the graph has it: it is never fused in any run.
    """

    fused: bool
    members: tuple[str, ...] = ()
    reason: str = ""
    refused: bool = False

    def __str__(self) -> str:
        if not self.fused:
            return f"interpreted: {self.reason}"
        others = len(self.members) - 1
        return f"fused with {others} {'other' if others == 1 else 'others'}" if others else "fused alone"


def is_fused(worker: RunningNode) -> bool:
    """Whether a running node is fused at this moment, or was until it ended."""
    over = worker.core.over or worker.blocked & ENDED
    return worker.region is not None or bool(over and worker.fused_with)


def explain(worker: RunningNode) -> Explanation:
    """Explain how a running node does its work at this moment, or did it until it ended."""
    if is_fused(worker):
        return Explanation(True, worker.fused_with)
    if worker.process is None and worker.iteration is None:
        short = worker.slot_edges and lives_by_its_slots(worker)
        how = "whose calls are short as they are" if short else "which are called one by one"
        return Explanation(False, reason=f"it has only slots, {how}")
    reason = refusal(worker, declared=True)
    if not reason and worker.unfit:
        reason = "its firings hardly ever end with a plain value: return values, not tokens, and await nothing"
    elif not reason and worker.type.process_kind not in ("generator", "function", "async"):
        reason = "it is an async generator, which waits on its own"
    return Explanation(False, reason=reason or refusal(worker) or _not_begun(worker), refused=bool(reason))


def _not_begun(worker: RunningNode) -> str:
    """Nothing is wrong with the node itself: what leads to it."""
    if not worker.is_source and len(worker.live_inputs) < len(worker.in_edges):
        return "a node before it is disabled: enable that"
    fired, after = worker.counts.firings, worker.core.fuse_after
    if fired <= after:
        return f"it has fired {fired} times; nodes are fused after {after} firings"
    odd = next((edge for edge in worker.in_edges if not (type(edge) is SyncEdge and edge.depth_first)), None)
    if odd is not None:
        name = f'"{odd.label.partition(" -> ")[0]}"'
        event, queue = f"event {name}", f"{name} over an edge with a queue, to another group, or pipelined"
        return f"it is fed by {event if type(odd) is EventEdge else queue}, and no node after it could be fused with it"
    return "a node before it is not fused, or fires at other times: see the explanation of that node"
