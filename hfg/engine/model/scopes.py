"""Subgraphs at run time (rule G2) and gates (rule A11): what depends on the activity of something else.

A scope is a dissolved subgraph that somebody watches: it has an automatic event with an edge, `active_for_s`, or
gates a node. Its activity is derived, never stored by a token. Stands on nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Generic

from hfg.engine.model.contracts import Node, NodeT

__all__ = ["Gate", "Scope"]


class Scope(Generic[NodeT]):
    """A subgraph whose activity matters.

    Attributes:
      worker: its automatic ports live on a worker of their own, which never fires.
      members: the running nodes inside, nested ones too.
      children: the scopes directly inside.
      inner_edges: the edges with both ends inside.
      active: A(subgraph) as last derived.
      told: A(subgraph) as its events have told it last.
    """

    __slots__ = (
        "active",
        "children",
        "enabled",
        "gates",
        "index",
        "inner_edges",
        "members",
        "parent",
        "path",
        "told",
        "watched",
        "worker",
    )

    def __init__(self, index: float, path: str, parent: Scope[NodeT] | None, *, enabled: bool = True) -> None:
        self.index = index
        self.path = path
        self.parent = parent
        self.members: list[NodeT] = []
        self.children: list[Scope[NodeT]] = []
        if parent is not None:
            parent.children.append(self)
        self.inner_edges: list[Any] = []
        self.worker: NodeT | None = None
        self.active = False
        self.told = False
        self.enabled = enabled
        self.watched = False
        self.gates: list[Gate[NodeT]] = []

    def be_told_by(self, worker: NodeT) -> None:
        """Its automatic ports live there."""
        self.worker = worker

    def take_in(self, members: Iterable[NodeT]) -> None:
        """These running nodes are inside, and know it."""
        self.members = list(members)
        for member in self.members:
            member.lie_in((*member.around, self))

    def move(self, path: str, parent: Scope[NodeT] | None) -> None:
        """It is called otherwise, and lies elsewhere, as the last one inside of that."""
        self.path = path
        self.parent = parent
        if parent is not None:
            parent.children.append(self)

    def rename(self, path: str) -> None:
        """It is called otherwise from now on."""
        self.path = path

    def renumber(self, index: float) -> None:
        """It comes here in the order of all."""
        self.index = index

    def forget_gates(self) -> None:
        """No gate looks at its activity."""
        self.gates = []

    def and_around(self) -> tuple[Scope[NodeT], ...]:
        """Give it and those around it, outermost first."""
        return (*(self.parent.and_around() if self.parent is not None else ()), self)

    def inside(self) -> list[NodeT]:
        """Give the workers of all nodes and subgraphs inside."""
        assert self.worker is not None
        found = list(self.members)
        waiting = list(reversed(self.children))
        while waiting:
            scope = waiting.pop()
            if scope.worker is not None:
                found.append(scope.worker)
            waiting += reversed(scope.children)
        return found

    def find_inner_edges(self) -> None:
        """Note the edges with both ends inside; left until somebody asks, since most subgraphs are just boxes."""
        assert self.worker is not None
        inside = set(self.inside())
        self.inner_edges = [
            edge for worker in inside for edge in (*worker.in_edges, *worker.slot_edges) if edge.source in inside
        ]

    def look(self) -> bool:
        """Derive its activity anew; whether it has changed."""
        before, self.active = self.active, self.derive()
        return self.active != before

    def tell(self) -> bool:
        """Its events tell its activity now; gives it back."""
        self.told = self.active
        return self.active

    def watch(self) -> None:
        """Somebody cares about its activity: it is derived from now on."""
        self.watched = True
        self.find_inner_edges()
        self.active = self.told = self.derive()

    def derive(self) -> bool:
        """Whether an inner node is active, or a token with +1 lies untaken inside or was drained and has yet to act.

        (G2, F12).
        """
        return any(worker.active or _will_be(worker) for worker in self.members) or any(
            token.activity > 0 for edge in self.inner_edges for token in edge.contents()
        )


def _will_be(worker: Node) -> bool:
    return worker.ending is not None and worker.ending.brings_activity


class Gate(Generic[NodeT]):
    """Work coupled to the activity of a state node or subgraph (A11).

    Attributes:
      state: who must be active.
      idle_rate_hz: how many firings a second run while it is not; None suspends.
      workers: the gated running nodes.
    """

    __slots__ = ("idle_rate_hz", "state", "workers")

    def __init__(self, state: NodeT | Scope[NodeT], idle_rate_hz: float | None, workers: Iterable[NodeT]) -> None:
        self.state = state
        self.idle_rate_hz = idle_rate_hz
        self.workers = list(workers)
        for worker in self.workers:
            worker.be_gated(self)
        state.gates.append(self)
