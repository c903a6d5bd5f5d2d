"""The steps in which a command changes a graph; each can be undone exactly (rule R4).

A change holds the nodes and edges themselves, with their places in the order, so that undoing restores the same objects
at the same places: a run recognises them by identity, and keeps the tokens on them. A change was checked before it is
made, so it cannot fail half-way. A run reads the changes, too, to see which edges are gone permanently.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

from typing_extensions import override

from hfg.graph.structure.boundary import GraphInput, GraphOutput
from hfg.graph.structure.edge import Edge
from hfg.graph.structure.facts import Fact, swap_in_facts
from hfg.graph.structure.gates import Gate
from hfg.graph.structure.groups import Groups, GroupsState
from hfg.graph.structure.level import Level, Whole, inside, level_of
from hfg.graph.structure.membership import close_box, leave, open_box, place, set_options, settle, write_parameter
from hfg.graph.structure.options import MonitorSpec, NodeOptions
from hfg.nodetypes.node import Node
from hfg.ports import ParameterPort


@dataclass(eq=False)
class Change:
    """One step.

    It holds what is there before and after it, in pairs of fields, or whether something is `added`. So each step has
    an inverse, which is of the same kind.
    """

    def do(self) -> None:
        """Take the step."""
        raise NotImplementedError

    def inverse(self) -> Self:
        """Return the step that takes this one back."""
        said = vars(self)
        if "added" in said:
            other: dict[str, Any] = {"added": not said["added"]}
        elif "old" in said:
            other = {"old": said["new"], "new": said["old"]}
        else:
            other = {"before": said["after"], "after": said["before"]}
        return replace(self, **other)


def undo_all(changes: Sequence[Change]) -> list[Change]:
    """Take changes back, the last first, and return the steps that did it."""
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

    level: Level
    name: str
    node: Node
    options: NodeOptions
    position: int
    inside: Level | None
    added: bool

    @classmethod
    def of(cls, node: Node, *, added: bool) -> NodeChange:
        """Describe a node that is in a graph."""
        where = node.place
        level = level_of(where.graph)
        return cls(level, where.name, node, node._options, level.members.position(where.name), inside(node), added)

    @override
    def do(self) -> None:
        if self.added:
            self.level.members.insert(self.position, self.name, self.node)
            if self.inside is not None:
                open_box(self.node, self.inside)
            settle(self.node, self.level, self.name, self.options)
        else:
            self.level.members.remove(self.name)
            leave(self.node)
            close_box(self.node)


@dataclass(eq=False)
class NodeSwap(Change):
    """A node takes the place of another: name, order and options stay."""

    old: Node
    new: Node

    @override
    def do(self) -> None:
        where, options = self.old.place, self.old._options
        level = level_of(where.graph)
        level.members.swap(where.name, self.new)
        leave(self.old)
        settle(self.new, level, where.name, options)
        swap_in_facts(level.whole.facts, self.old, self.new)


@dataclass(eq=False)
class Renaming(Change):
    """A node has another name."""

    node: Node
    before: str
    after: str

    @override
    def do(self) -> None:
        level = level_of(self.node.place.graph)
        level.members.rename(self.before, self.after)
        place(self.node, level, self.after)


@dataclass(eq=False)
class OptionsChange(Change):
    """A node has other options."""

    node: Node
    before: NodeOptions
    after: NodeOptions

    @override
    def do(self) -> None:
        set_options(self.node, self.after)


@dataclass(eq=False)
class ParameterChange(Change):
    """A parameter has another value."""

    node: Node
    name: str
    before: Any
    after: Any

    @override
    def do(self) -> None:
        write_parameter(self.node, self.name, self.after)


@dataclass(eq=False)
class EdgeChange(Change):
    """An edge is declared (`added`) or deleted.

    Attributes:
      position: among the edges of the graph.
      for_good: when it is deleted, what lies on it is gone; else other edges lead the same way (rule G1).
    """

    level: Level
    edge: Edge
    position: int
    added: bool
    for_good: bool = True

    @classmethod
    def of(cls, level: Level, edge: Edge, *, added: bool, for_good: bool = True) -> EdgeChange:
        """Describe an edge that is in a graph."""
        return cls(level, edge, level.connections.position(edge), added, for_good)

    @override
    def do(self) -> None:
        if self.added:
            self.level.connections.insert(self.position, self.edge)
        else:
            self.level.connections.remove(self.position)


@dataclass(eq=False)
class EdgeSwap(Change):
    """An edge is declared otherwise, in its place in the order: with other options, or with the ports of a new node."""

    level: Level
    old: Edge
    new: Edge

    @override
    def do(self) -> None:
        self.level.connections.swap(self.old, self.new)


@dataclass(eq=False)
class GateChange(Change):
    """A gate is set or taken away."""

    level: Level
    gate: Gate
    position: int
    added: bool

    @override
    def do(self) -> None:
        if self.added:
            self.level.gates.insert(self.position, self.gate)
        else:
            self.level.gates.remove(self.position)


@dataclass(eq=False)
class FactChange(Change):
    """A fact is stated or taken back."""

    whole: Whole
    fact: Fact
    position: int
    added: bool

    @override
    def do(self) -> None:
        if self.added:
            self.whole.facts.insert(self.position, self.fact)
        else:
            del self.whole.facts[self.position]
        self.whole.laws_changed()


@dataclass(eq=False)
class FactsMoved(Change):
    """The facts about a node are about another."""

    facts: list[Fact]
    old: Node
    new: Node

    @override
    def do(self) -> None:
        swap_in_facts(self.facts, self.old, self.new)


@dataclass(eq=False)
class NodeCopied(Change):
    """A node that was added is a copy of another: said for a run, where the other may be set until both are there."""

    source: Node
    copy: Node

    @override
    def do(self) -> None:
        pass

    @override
    def inverse(self) -> Self:
        return self


@dataclass(eq=False)
class PromotionChange(Change):
    """Parameters of the subgraph around a graph stand for others inside."""

    level: Level
    before: dict[str, list[ParameterPort[Any]]]
    after: dict[str, list[ParameterPort[Any]]]

    @override
    def do(self) -> None:
        self.level.promotions.become(self.after)


@dataclass(eq=False)
class GroupsChange(Change):
    """Other groups are declared, or the same otherwise."""

    groups: Groups
    before: GroupsState
    after: GroupsState

    @override
    def do(self) -> None:
        self.groups.restore(self.after)


@dataclass(eq=False)
class MonitorsChange(Change):
    """Other monitors are declared, or the same otherwise."""

    whole: Whole
    before: Mapping[str, MonitorSpec]
    after: Mapping[str, MonitorSpec]

    @override
    def do(self) -> None:
        self.whole.set_monitors(self.after)


@dataclass(eq=False)
class PortChange(Change):
    """A port of the whole graph is declared (`added`) or removed; always the last one of its kind."""

    level: Level
    port: GraphInput[Any] | GraphOutput[Any]
    added: bool

    @override
    def do(self) -> None:
        self.level.ports.add(self.port) if self.added else self.level.ports.remove(self.port)


@dataclass(eq=False)
class NotesChange(Change):
    """Editors have noted something else about a node, or about the whole graph.

    Attributes:
      before: the notes that change, as they were. The others are not kept: commands may make thousands, one by one.
      after: the notes that change, as they are then.
    """

    notes: dict[Node | None, dict[str, Any]]
    node: Node | None
    before: dict[str, Any]
    after: dict[str, Any]

    @override
    def do(self) -> None:
        there = self.notes.setdefault(self.node, {})
        for name in self.before:
            if name not in self.after:
                del there[name]
        there.update(self.after)
        if not there:
            del self.notes[self.node]
