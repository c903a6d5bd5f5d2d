"""Edits of a graph in terms of its own objects: each is checked as if it were made by hand, and recorded as changes.

Commands (`performing`) and documents (`from_document`) both come here once their paths are resolved, so that there is
one way to build a graph from data. Depends on `changes` and `structure`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any, Literal, TypeAlias, Unpack

import msgspec

from hfg.base.bounds import NODES_AND_PORTS
from hfg.base.values import own_copy, same
from hfg.encoding import Find
from hfg.errors import GraphError
from hfg.graph.editing.changes import (
    Change,
    EdgeChange,
    EdgeSwap,
    FactChange,
    GateChange,
    GroupsChange,
    MonitorsChange,
    NodeChange,
    NotesChange,
    OptionsChange,
    ParameterChange,
    PortChange,
    PromotionChange,
    undo_all,
)
from hfg.graph.editing.data import edge_as_meant
from hfg.graph.editing.making import as_meant, fitting
from hfg.graph.editing.type_texts import type_of_text
from hfg.graph.structure.adding import add
from hfg.graph.structure.boundary import GraphInput, GraphOutput
from hfg.graph.structure.connecting import declare_edge, refuse
from hfg.graph.structure.declaring import move, need_new_port, refuse_gate, refuse_promotion, stands_for
from hfg.graph.structure.edge import Edge, SourceEnd, TargetEnd, owner_of
from hfg.graph.structure.facts import Fact, facts_of, refuse_fact
from hfg.graph.structure.gates import Gate
from hfg.graph.structure.given import edge_options, group_spec
from hfg.graph.structure.level import Level, inside, level_of, nodes_within
from hfg.graph.structure.monitors import monitor_spec, with_monitor
from hfg.graph.structure.options import EdgeGiven, GroupGiven, MonitorGiven, MonitorSpec, NodeGiven
from hfg.graph.structure.places import side_of
from hfg.nodetypes.node import Node
from hfg.ports import ParameterPort

Promoted: TypeAlias = dict[str, list[ParameterPort[Any]]]


class Multiplied:
    """Counts the nodes and ports that data makes in few words: each copy may be copied, and a size is one number."""

    def __init__(self, count: int = 0) -> None:
        self.count = count

    def add(self, more: int) -> None:
        """Count more.

        Raises:
          GraphError: they are more than data may make.
        """
        self.count += more
        if more and self.count > NODES_AND_PORTS.most:
            raise GraphError(f"the graph would have {self.count:,} nodes and ports: {NODES_AND_PORTS.remedy}")


def _parts_of(nodes: Iterable[Node]) -> int:
    """Count nodes and the ports of their vectors."""
    return sum(1 + _ports_of(node) for node in nodes)


def _ports_of(node: Node) -> int:
    return sum(one.size or 0 for one in node._type.vectors.values())


class Steps:
    """Edits one graph and records how.

    Attributes:
      root: the level from which paths start.
      changes: all that was done, in order.
      find: returns the code that values refer to; None allows only references that are tagged as such.
    """

    def __init__(self, root: Level, find: Find | None = None, multiplied: Multiplied | None = None) -> None:
        self.root = root
        self._multiplied = multiplied
        self.changes: list[Change] = []
        self.find = find
        self._promoting: tuple[PromotionChange, int] | None = None  # the last one, and how many changes there were then

    def need_room(self, node: Node, *, copy: bool = False) -> None:
        """Check that a node with its vectors of ports is not too much for a graph; of a copy, with all inside it.

        Raises:
          GraphError: it is.
        """
        more = _parts_of(nodes_within(node)) if copy else _ports_of(node)
        if more and self._multiplied is None:
            self._multiplied = Multiplied(_parts_of(one for level in self.root.walk() for one in level.nodes.values()))
        if self._multiplied is not None:
            self._multiplied.add(more)

    def do(self, change: Change) -> None:
        """Make a change that was checked, and record it."""
        change.do()
        self.changes.append(change)

    def take_back(self, count: int = 0) -> None:
        """Undo all changes after the first `count`."""
        undo_all(self.changes[count:])
        del self.changes[count:]
        self._promoting = None

    def gated_levels(self) -> list[Level]:
        """Return the levels that have gates."""
        return [level for level in self.root.walk() if level.gates.listed] if self.root.whole.gated else []

    # --- nodes ---

    def add(self, level: Level, name: str, node: Node, options: NodeGiven) -> None:
        """Add a node that is in no graph yet."""
        groups = self.root.whole.groups
        before = groups.state()
        add(level, node, name, options)
        if groups.state() != before:  # by build() of a subgraph
            self.changes.append(GroupsChange(groups, before, groups.state()))
        position = len(level.nodes) - 1
        self.changes.append(NodeChange(level, name, node, node._options, position, inside(node), added=True))

    def remove(self, node: Node) -> None:
        """Remove a node with its edges, gates, promotions and notes."""
        around = level_of(node.place.graph)
        gone = set(nodes_within(node))
        for edge in edges_of(around, node):
            self.disconnect(around, edge)
        for level in self.gated_levels():
            for gate in [gate for gate in level.gates if gate.target in gone or gate.by in gone]:
                self.ungate(level, gate)
        promoted = around.promotions.by_name.items()
        self.set_promotions(around, {name: [one for one in ports if one.node is not node] for name, ports in promoted})
        for one in gone:
            self.set_notes(one, {})
        self.do(NodeChange.of(node, added=False))

    def set_options(self, node: Node, **options: Unpack[NodeGiven]) -> None:
        """Change checked options of a node."""
        before = node._options
        self.do(OptionsChange(node, before, msgspec.structs.replace(before, **options)))

    def move(self, node: Node, group: str | None) -> None:
        """Let a node run in another group."""
        before = node._options
        move(self.root, node, group)
        self.changes.append(OptionsChange(node, before, node._options))

    def set_parameter(self, port: ParameterPort[Any], data: object) -> None:
        """Set a parameter to a value that may be plain data."""
        try:
            value = fitting(port.spec, data, self.find)
        except ValueError as error:
            raise GraphError(str(error)) from error
        self.write(port, value)

    def write(self, port: ParameterPort[Any], value: object) -> None:
        """Set a parameter, and the inner parameters that it stands for."""
        before = [(one.node, one.name, one.value) for one in stands_for(port)]
        try:
            port.value = value
        except ValueError as error:
            raise GraphError(str(error)) from error
        self.changes += [
            ParameterChange(node, name, value, own_copy(node._parameters[name])) for node, name, value in before
        ]

    def set_notes(self, node: Node | None, after: dict[str, Any]) -> None:
        """Replace the notes about a node, or about the whole graph."""
        there = self.root.whole.notes.get(node, {})
        before = {name: value for name, value in there.items() if name not in after or after[name] != value}
        changed = {name: value for name, value in after.items() if name not in there or there[name] != value}
        if before or changed:
            self.do(NotesChange(self.root.whole.notes, node, before, changed))

    def set_note(self, node: Node | None, name: str, value: object) -> None:
        """Replace one note about a node, or about the whole graph; None removes it."""
        there = self.root.whole.notes.get(node, {})
        before = {name: there[name]} if name in there else {}
        after = {} if value is None else {name: value}
        if before != after:
            self.do(NotesChange(self.root.whole.notes, node, before, after))

    # --- edges, gates, promotions ---

    def connect(
        self, level: Level, source: SourceEnd, target: TargetEnd, said: EdgeGiven[Any, Any], where: str
    ) -> Edge:
        """Add an edge whose options are data; errors about operators start with `where`."""
        options = edge_as_meant(said, target, where, partial(as_meant, find=self.find))
        edge = declare_edge(level, source, target, options)
        self.changes.append(EdgeChange(level, edge, len(level.edges) - 1, added=True))
        return edge

    def disconnect(self, level: Level, edge: Edge) -> None:
        """Remove an edge, with the tokens on it."""
        self.do(EdgeChange.of(level, edge, added=False))

    def redeclare(self, level: Level, edge: Edge, said: EdgeGiven[Any, Any]) -> None:
        """Change options of an edge. An option that stays the same is left out: a run could not follow that change."""
        where = f'"{edge.label}"'
        options = edge_as_meant(said, edge.target, where, partial(as_meant, find=self.find))
        checked = edge_options(lambda: where, msgspec.structs.asdict(edge.options) | options)
        refuse(level, edge.source, edge.target, checked)
        if not same(checked, edge.options):
            self.do(EdgeSwap(level, edge, Edge(edge.source, edge.target, checked)))

    def gate(self, gate: Gate, level: Level | None = None) -> None:
        """Set a gate at a level; by default at the outermost one around both nodes that no iteration separates."""
        refuse_gate(self.root, gate)
        side, other = (side_of(level_of(node.place.graph)) for node in (gate.target, gate.by))
        if side is not other:
            raise GraphError(
                f'"{gate.target.place.path}" and "{gate.by.place.path}" are on different sides of the boundary of a '
                "subgraph that iterates, which no gate crosses (rule G4); gate nodes on the same side"
            )
        level = level or side
        self.do(GateChange(level, gate, len(level.gates.listed), added=True))

    def state(self, fact: Fact) -> None:
        """State a fact, unless it is stated."""
        refuse_fact(self.root, fact)
        if not any(one.says(fact) for one in facts_of(self.root)):
            self.do(FactChange(self.root.whole, fact, len(self.root.whole.facts), added=True))

    def retract(self, fact: Fact) -> None:
        """Take a fact back.

        Raises:
          GraphError: it is not stated.
        """
        facts = self.root.whole.facts
        known = next((number for number, one in enumerate(facts) if one.says(fact)), None)
        if known is None:
            raise GraphError(f"it is not stated that {fact}; graph.facts lists the facts that are")
        self.do(FactChange(self.root.whole, facts[known], known, added=False))

    def ungate(self, level: Level, gate: Gate) -> None:
        """Remove a gate."""
        self.do(GateChange(level, gate, level.gates.listed.index(gate), added=False))

    def promote(self, outer: ParameterPort[Any], inner: ParameterPort[Any]) -> None:
        """Let a parameter of a subgraph stand for an inner one, which takes its value."""
        around = level_of(inner.node.place.graph)
        refuse_promotion(around, outer, inner)
        last, is_last = self._promoting, len(self.changes)
        self.write(inner, outer.value)
        if last is not None and last[0].level is around and last[1] == is_last:  # one change for many in a row
            change = last[0]
            around.promotions.add(outer.name, inner)
            change.after.setdefault(outer.name, []).append(inner)
        else:
            before, after = around.promotions.copied(), around.promotions.copied()
            after.setdefault(outer.name, []).append(inner)
            change = PromotionChange(around, before, after)
            self.do(change)
        self._promoting = change, len(self.changes)

    def set_promotions(self, level: Level, promoted: Promoted) -> None:
        """Let other parameters stand for the inner ones, if that changes anything."""
        before = level.promotions.copied()
        after = {name: ports for name, ports in promoted.items() if ports}
        if before != after:
            self.do(PromotionChange(level, before, after))

    # --- the whole graph ---

    def declare_group(self, name: str, said: GroupGiven) -> None:
        """Declare a group, or declare it with other options."""
        groups = self.root.whole.groups
        before = groups.state()
        groups.change(group_spec(name, said))
        self.changes.append(GroupsChange(groups, before, groups.state()))

    def set_monitors(self, after: Mapping[str, MonitorSpec]) -> None:
        """Declare other monitors, if that changes anything."""
        before = self.root.whole.monitors
        if after != before:
            self.do(MonitorsChange(self.root.whole, before, after))

    def declare_monitor(self, name: str, property_: object, said: MonitorGiven) -> None:
        """Declare a monitor, or declare it otherwise."""
        self.set_monitors(with_monitor(self.root.whole.monitors, monitor_spec(name, property_, said)))

    def declare_port(self, kind: Literal["input", "output"], name: str, type_: str) -> None:
        """Declare a port of the whole graph; its type is a string."""
        hint = type_of_text(type_, f'{kind} "{name}" of the graph')
        need_new_port(self.root, kind, name, hint)
        made = GraphInput if kind == "input" else GraphOutput
        port: GraphInput[Any] | GraphOutput[Any] = made(self.root.face, name, hint)
        self.do(PortChange(self.root, port, added=True))


def edges_of(level: Level, node: Node) -> list[Edge]:
    """Return the edges that begin or end at a port of a node, as seen from outside, in order."""
    return [edge for edge in level.connections.at(node) if node in (owner_of(edge.source), owner_of(edge.target))]
