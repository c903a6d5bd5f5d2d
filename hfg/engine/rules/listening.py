"""Slots that listen only while their node is active (rule T4): who hears an output, without a look at those who do not.

A letter to a hundred states concerns the one that is active. The sender keeps those that may listen: whoever becomes
active, or gets a token with activity into a slot, is noted; whoever does not listen any more is found at the next
sending. What the others would have got is counted for all together, and for each when somebody asks. While somebody
looks at the tokens themselves (trace, tap) each edge is gone through instead. Depends on the model.
"""

from __future__ import annotations

from typing import Any

from hfg.engine.model.running_node import RunningNode
from hfg.ports.edges import AnyEdge, Edge, SyncEdge

__all__ = ["Listeners", "find_listeners", "listens", "may_listen"]

_FEW = 4  # up to this many edges, a loop is faster


def listens(worker: RunningNode) -> bool:
    """Whether a node is active, or a token with +1 waits for one of its slot calls."""
    if worker.active:
        return True
    calls = worker.calls
    return bool(calls) and any(token.activity > 0 for edge in set(calls or ()) for token in edge.contents())


def may_listen(worker: RunningNode) -> None:
    """It has become active, or is about to: those who send to its slots are to look at it."""
    for listeners, edge in worker.listened or ():
        listeners.awake[edge] = None


def find_listeners(worker: RunningNode) -> None:
    """Derive again which edges of each output lead to slots that listen only while their nodes are active."""
    for old in worker.listeners:
        if old is not None:
            old.let_go()
    found = tuple(_listeners(worker, edges) for edges in worker.out_edges)
    worker.listeners = found if any(one is not None for one in found) else ()


def _listeners(worker: RunningNode, edges: tuple[AnyEdge, ...]) -> Listeners | None:
    quiet = [edge for edge in edges if edge.while_active and type(edge) is SyncEdge and not edge.active]
    fast = worker.core.fast and worker.within is None
    if len(quiet) < _FEW or not fast or any(edge.tap is not None for edge in quiet):
        return None
    return Listeners(worker, edges, quiet)


class Listeners:
    """The edges of one output.

    Attributes:
      awake: those of the quiet ones whose target may listen.
    """

    __slots__ = ("_core", "_count", "_edges", "_others", "_quiet", "_seen", "awake")

    def __init__(self, worker: RunningNode, edges: tuple[AnyEdge, ...], quiet: list[Any]) -> None:
        self._core = worker.core
        self._edges = edges
        self._quiet = quiet
        self._others = [edge for edge in edges if edge not in set(quiet)]
        self._count = 0  # sendings
        self._seen = dict.fromkeys(quiet, 0)  # those that an edge has counted
        self.awake: dict[Any, None] = dict.fromkeys(quiet)
        worker.core.listeners[self] = None
        for edge in quiet:
            target: RunningNode = edge.target
            if target.listened is None:
                target.listened = []
            target.listened.append((self, edge))

    def who_hear(self) -> tuple[Any, ...] | list[Any]:
        """Return the edges on which a token must be put now, in order; for the others it is only counted."""
        if self._core.trace is not None:
            self.settle_counts()
            return self._edges
        count = self._count
        self._count = count + 1
        awake = self.awake
        hearing = self._others[:]
        for edge in list(awake):
            if listens(edge.target):
                edge.sent += count - self._seen[edge]
                self._seen[edge] = count + 1  # the one that is put now is counted there
                hearing.append(edge)
            else:
                del awake[edge]
        if len(hearing) > 1:
            hearing.sort(key=_index)
        return hearing

    def settle_counts(self) -> None:
        """Let each edge know how many tokens it has been sent."""
        count = self._count
        for edge, seen in self._seen.items():
            if seen != count:
                edge.sent += count - seen
                self._seen[edge] = count

    def let_go(self) -> None:
        """They are not told of changes any more."""
        self.settle_counts()
        del self._core.listeners[self]
        for edge in self._quiet:
            target: RunningNode = edge.target
            if target.listened is not None:
                target.listened = [one for one in target.listened if one[0] is not self] or None


def _index(edge: Edge) -> float:
    return float(edge.index)
