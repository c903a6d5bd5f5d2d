"""What a command does to a drawn graph, in steps that can each be taken back exactly (rule R4).

A change holds the very nodes and edges, with their places in the order, so that what is undone is as it was. Whoever
makes a change has checked it; doing it cannot fail. A run reads changes too, to see which edges are gone for good.
Stands on `structure`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

from typing_extensions import override

from hfg.graph.graph import Graph
from hfg.graph.structure.boxes import is_box
from hfg.graph.structure.edges import Edge, is_single
from hfg.graph.structure.gates import Gate
from hfg.graph.structure.options import NodeOptions
from hfg.nodetype import Node, Place
from hfg.ports import ParameterPort

__all__ = [
    "Change",
    "EdgeChange",
    "EdgeSwap",
    "GateChange",
    "NodeChange",
    "NodeSwap",
    "OptionsChange",
    "ParameterChange",
    "PromotionChange",
    "Renaming",
    "nodes_within",
    "place",
    "undo_all",
]


class Change:
    """One step."""

    def do(self) -> None:
        """Take it."""
        raise NotImplementedError

    def inverse(self) -> Self:
        """Give the step back."""
        raise NotImplementedError


def undo_all(changes: Sequence[Change]) -> list[Change]:
    """Take changes back, the last first; gives what was done for that."""
    done = [change.inverse() for change in reversed(changes)]
    for change in done:
        change.do()
    return done


@dataclass(eq=False)
class NodeChange(Change):
    """A node comes into a graph (`added`) or leaves it; its edges are not touched.

    Attributes:
      position: among the nodes of the graph.
      inside: of a subgraph: the graph in it.
    """

    graph: Graph
    name: str
    node: Node
    options: NodeOptions
    position: int
    inside: Graph | None
    added: bool

    @classmethod
    def of(cls, node: Any, *, added: bool) -> NodeChange:
        """Describe a node that is in a graph."""
        where = node._place
        position = list(where.graph.nodes).index(where.name)
        inside = getattr(node, "_graph", None)
        return cls(where.graph, where.name, node, node._options, position, inside, added)

    @override
    def do(self) -> None:
        node: Any = self.node
        if self.added:
            _insert(self.graph.nodes, self.position, self.name, node)
            node._options = self.options
            if self.inside is not None:
                node._graph = self.inside
            place(node, self.graph, self.name)
        else:
            del self.graph.nodes[self.name]
            node._place = node._options = None
            if self.inside is not None:
                del node._graph

    @override
    def inverse(self) -> Self:
        return replace(self, added=not self.added)


@dataclass(eq=False)
class NodeSwap(Change):
    """A node takes the place of another: name, order and options stay."""

    old: Node
    new: Node

    @override
    def do(self) -> None:
        old, new = self.old, self.new
        where, options = old.place, old._options
        nodes = where.graph.nodes
        nodes[where.name] = new  # the place in the order stays
        old._place = old._options = None
        new._options = options
        place(new, where.graph, where.name)

    @override
    def inverse(self) -> Self:
        return replace(self, old=self.new, new=self.old)


@dataclass(eq=False)
class Renaming(Change):
    """A node has another name."""

    node: Node
    before: str
    after: str

    @override
    def do(self) -> None:
        graph = self.node.place.graph
        position = list(graph.nodes).index(self.before)
        del graph.nodes[self.before]
        _insert(graph.nodes, position, self.after, self.node)
        place(self.node, graph, self.after)

    @override
    def inverse(self) -> Self:
        return replace(self, before=self.after, after=self.before)


@dataclass(eq=False)
class OptionsChange(Change):
    """A node has other options."""

    node: Node
    before: NodeOptions
    after: NodeOptions

    @override
    def do(self) -> None:
        self.node._options = self.after

    @override
    def inverse(self) -> Self:
        return replace(self, before=self.after, after=self.before)


@dataclass(eq=False)
class ParameterChange(Change):
    """A parameter has another value."""

    node: Node
    name: str
    before: Any
    after: Any

    @override
    def do(self) -> None:
        self.node._parameters[self.name] = self.after

    @override
    def inverse(self) -> Self:
        return replace(self, before=self.after, after=self.before)


@dataclass(eq=False)
class EdgeChange(Change):
    """An edge is drawn (`added`) or rubbed out.

    Attributes:
      position: among the edges of the graph.
      for_good: when it is rubbed out, what lies on it is gone; else other edges lead the same way (rule G1).
    """

    graph: Graph
    edge: Edge
    position: int
    added: bool
    for_good: bool = True

    @classmethod
    def of(cls, graph: Graph, edge: Edge, *, added: bool, for_good: bool = True) -> EdgeChange:
        """Describe an edge that is in a graph."""
        return cls(graph, edge, graph.edges.index(edge), added, for_good)

    @override
    def do(self) -> None:
        if self.added:
            self.graph.edges.insert(self.position, self.edge)
            _note(self.graph, self.edge)
        else:
            del self.graph.edges[self.position]
            _forget(self.graph, self.edge)

    @override
    def inverse(self) -> Self:
        return replace(self, added=not self.added)


@dataclass(eq=False)
class EdgeSwap(Change):
    """An edge is drawn otherwise, in its place in the order: with other options, or with the ports of a new node."""

    graph: Graph
    old: Edge
    new: Edge

    @override
    def do(self) -> None:
        edges = self.graph.edges
        edges[edges.index(self.old)] = self.new
        _forget(self.graph, self.old)
        _note(self.graph, self.new)

    @override
    def inverse(self) -> Self:
        return replace(self, old=self.new, new=self.old)


@dataclass(eq=False)
class GateChange(Change):
    """A gate is set or taken away."""

    graph: Graph
    gate: Gate
    position: int
    added: bool

    @override
    def do(self) -> None:
        if self.added:
            self.graph.gates.insert(self.position, self.gate)
            self.graph._root._gated.add(self.gate.target)
        else:
            del self.graph.gates[self.position]
            self.graph._root._gated.discard(self.gate.target)

    @override
    def inverse(self) -> Self:
        return replace(self, added=not self.added)


@dataclass(eq=False)
class PromotionChange(Change):
    """Parameters of the subgraph around a graph stand for others inside."""

    graph: Graph
    before: dict[str, list[ParameterPort[Any]]]
    after: dict[str, list[ParameterPort[Any]]]

    @override
    def do(self) -> None:
        self.graph._promoted = {name: list(ports) for name, ports in self.after.items()}

    @override
    def inverse(self) -> Self:
        return replace(self, before=self.after, after=self.before)


def place(node: Any, graph: Graph, name: str) -> None:
    """Say where a node is, and where all inside it are."""
    node._place = Place(graph, name, f"{graph.path}/{name}" if graph._owner is not None else name)
    waiting = [node]
    while waiting:
        inside = getattr(waiting.pop(), "_graph", None)
        if inside is not None:
            for inner_name, inner in inside.nodes.items():
                inner._place = Place(inside, inner_name, f"{inside.path}/{inner_name}")
                if is_box(inner):
                    waiting.append(inner)


def nodes_within(node: Any) -> Iterator[Any]:
    """Give a node and all inside it."""
    waiting = [node]
    while waiting:
        one = waiting.pop()
        yield one
        inside = getattr(one, "_graph", None)
        if inside is not None:
            waiting += reversed(inside.nodes.values())


def _insert(nodes: dict[str, Node], position: int, name: str, node: Node) -> None:
    """Put a node at its place in the order."""
    behind = list(nodes.items())[position:]
    for other, _ in behind:
        del nodes[other]
    nodes[name] = node
    nodes.update(behind)


def _note(graph: Graph, edge: Edge) -> None:
    if is_single(edge.target):
        graph._into[edge.target] = edge
    else:
        graph._pairs.add((edge.source, edge.target))


def _forget(graph: Graph, edge: Edge) -> None:
    if graph._into.get(edge.target) is edge:
        del graph._into[edge.target]
    graph._pairs.discard((edge.source, edge.target))
