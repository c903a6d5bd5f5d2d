"""Subgraphs at run time (rule G2) and gates (rule A11): what depends on the activity of something else.

A scope is a dissolved subgraph. Its activity is derived from its inside, and only if something depends on it: an
automatic event with an edge, `active_for_s`, or a gate.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Generic

from hfg.engine.model.contracts import NodeT
from hfg.ports.edges import AnyEdge

__all__ = ["Gate", "Scope"]


@dataclass(slots=True, eq=False)
class Scope(Generic[NodeT]):
    """A subgraph in a run."""

    index: float  # its place in the order of all
    path: str
    parent: Scope[NodeT] | None
    enabled: bool = True
    members: list[NodeT] = field(default_factory=list)  # the running nodes inside, including nested ones
    children: list[Scope[NodeT]] = field(default_factory=list)  # the scopes directly inside
    inner_edges: list[AnyEdge] = field(default_factory=list)  # those with both ends inside
    worker: NodeT | None = None  # has its automatic ports, and never fires
    active: bool = False  # A(subgraph) as last derived
    told: bool = False  # A(subgraph) as its events have last reported it
    watched: bool = False  # something depends on its activity
    gates: list[Gate[NodeT]] = field(default_factory=list)  # those that depend on it

    def __post_init__(self) -> None:
        if self.parent is not None:
            self.parent.children.append(self)

    def owned_by(self, worker: NodeT) -> None:
        """This running node has its automatic ports."""
        self.worker = worker

    def take_in(self, members: Iterable[NodeT]) -> None:
        """Enclose these running nodes."""
        self.members = list(members)
        for member in self.members:
            member.enclose((*member.around, self))

    def move(self, path: str, parent: Scope[NodeT] | None) -> None:
        """Change its path and place it last in another subgraph."""
        self.path = path
        self.parent = parent
        if parent is not None:
            parent.children.append(self)

    def rename(self, path: str) -> None:
        """Change its path."""
        self.path = path

    def renumber(self, index: float) -> None:
        """Change its place in the order of all."""
        self.index = index

    def forget_gates(self) -> None:
        """No gate depends on its activity."""
        self.gates = []

    def and_around(self) -> tuple[Scope[NodeT], ...]:
        """Return it and those around it, outermost first."""
        return (*(self.parent.and_around() if self.parent is not None else ()), self)

    def inside(self) -> list[NodeT]:
        """Return the running nodes of all nodes and subgraphs inside."""
        found = list(self.members)
        waiting = list(reversed(self.children))
        while waiting:
            scope = waiting.pop()
            if scope.worker is not None:
                found.append(scope.worker)
            waiting += reversed(scope.children)
        return found

    def find_inner_edges(self) -> None:
        """Find the edges with both ends inside. Not done before it is watched: most subgraphs are just boxes."""
        inside = set(self.inside())
        self.inner_edges = [
            edge for worker in inside for edge in (*worker.in_edges, *worker.slot_edges) if edge.source in inside
        ]

    def look(self) -> bool:
        """Derive its activity again. Return whether it has changed."""
        before, self.active = self.active, self.derive()
        return self.active != before

    def tell(self) -> bool:
        """Return its activity, which its events report now."""
        self.told = self.active
        return self.active

    def watch(self) -> None:
        """Derive its activity from now on."""
        self.watched = True
        self.find_inner_edges()
        self.active = self.told = self.derive()

    def derive(self) -> bool:
        """Return whether an inner node is active, or a +1 is untaken inside or was drained and has yet to act (G2)."""
        return any(worker.active or worker.brings_activity() for worker in self.members) or any(
            token.activity > 0 for edge in self.inner_edges for token in edge.contents()
        )


@dataclass(slots=True, eq=False)
class Gate(Generic[NodeT]):
    """Work coupled to the activity of a state node or subgraph (A11)."""

    state: NodeT | Scope[NodeT]  # must be active
    idle_rate_hz: float | None  # how many firings per second run while it is not; None suspends
    workers: list[NodeT]  # the gated ones

    def __post_init__(self) -> None:
        for worker in self.workers:
            worker.be_gated(self)
        self.state.gates.append(self)
