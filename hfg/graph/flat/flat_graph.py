"""What a graph is once its subgraphs are dissolved: plain data for runners and checks; `flat` makes it.

Depends on `structure`: it refers to nodes, edges and levels.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, Literal, TypeAlias

import msgspec

from hfg.errors import Problem
from hfg.graph.structure.edge import Edge
from hfg.graph.structure.level import HasLevel, Level, level_of
from hfg.graph.structure.options import EdgeOptions, GroupSpec, NodeOptions
from hfg.nodetypes.node import Node

EndKind: TypeAlias = Literal["input", "output", "event", "slot", "parameter", "observable"]

ROOT: Final = -1
"""`End.node` of the graph's own ports."""


LINK: Final = -(2**62)
"""`End.node` of a link to another part, in a graph that is cut: tokens leave by its inputs."""


def scope_end(scope: int) -> int:
    """Return the `End.node` of a dissolved subgraph, whose automatic ports remain; its own inverse."""
    return -2 - scope


class FlatNode(msgspec.Struct, eq=False):
    """A node that fires or has slots.

    Attributes:
      options: with the group it really runs in.
      scopes: the subgraphs around it, the outermost first.
      iteration: the inside of a subgraph that iterates; its boundary are the subgraph's inner sides.
    """

    index: int
    path: str
    node: Node
    options: NodeOptions
    scopes: tuple[int, ...]
    iteration: FlatGraph | None = None


class Scope(msgspec.Struct, eq=False):
    """A dissolved subgraph.

    Attributes:
      parent: the subgraph around it, if any.
      members: the nodes inside, those of inner subgraphs too.
    """

    index: int
    path: str
    subgraph: Any
    parent: int | None
    options: NodeOptions
    members: list[int]


class End(msgspec.Struct, frozen=True, eq=False, gc=False):
    """One end of an edge.

    Attributes:
      node: index of the node; `LINK` where the edge continues in another part (see `cutting`); `ROOT` for the graph's
        own ports, among which an input of the graph is an "output" and an output an "input"; `scope_end(k)` for the
        automatic ports of scope k.
      port: the bound port; for an observable itself.
    """

    node: int
    kind: EndKind
    name: str
    port: Any


class FlatEdge(msgspec.Struct, eq=False):
    """An edge from end to end.

    Attributes:
      label: "a/b.out -> c.in", one of a kind in its graph.
      options: of the edges it consists of together; what only one says, the outermost does, among several the one
        nearest to the source.
      via: the scopes it enters or leaves through their ports.
      segments: the edges it consists of, from source to target.
    """

    index: int
    label: str
    source: End
    target: End
    options: EdgeOptions
    via: tuple[int, ...]
    segments: tuple[Edge, ...]

    @property
    def active(self) -> bool:
        """A(e) of the paper: whether it also transports activity."""
        return self.options.active

    @property
    def is_event_edge(self) -> bool:
        """Return whether it has a queue."""
        return self.source.kind in ("event", "observable")


class FlatGate(msgspec.Struct, frozen=True):
    """A gate; both ends as in `End.node`."""

    target: int
    by: int
    idle_rate_hz: float | None


class FlatGraph(msgspec.Struct, eq=False):
    """A graph without subgraphs.

    Attributes:
      groups: of the whole graph.
      graph: the whole, or the inside of what iterates.
      findings: what went wrong on the way; errors.
    """

    nodes: list[FlatNode]
    scopes: list[Scope]
    edges: list[FlatEdge]
    groups: dict[str, GroupSpec]
    gates: list[FlatGate]
    graph: HasLevel
    findings: list[Problem]

    @property
    def level(self) -> Level:
        """The level of its graph."""
        return level_of(self.graph)

    def path(self, end: int) -> str:
        """Return the path of what is named as in `End.node`: a node, a dissolved subgraph, or the graph itself."""
        if end == ROOT:
            return "graph"
        return self.nodes[end].path if end > ROOT else self.scopes[scope_end(end)].path

    def members(self, end: int) -> list[int]:
        """Return the node itself, or the nodes in the subgraph."""
        return [end] if end > ROOT else self.scopes[scope_end(end)].members

    def options(self) -> Iterator[tuple[int, NodeOptions]]:
        """Yield the options of each node and dissolved subgraph, with its name as in `End.node`."""
        yield from ((node.index, node.options) for node in self.nodes)
        yield from ((scope_end(scope.index), scope.options) for scope in self.scopes)

    def walk(self) -> Iterator[FlatGraph]:
        """Yield this graph and all that iterate inside it."""
        waiting = [self]
        while waiting:
            flat = waiting.pop()
            yield flat
            waiting += [node.iteration for node in reversed(flat.nodes) if node.iteration is not None]
