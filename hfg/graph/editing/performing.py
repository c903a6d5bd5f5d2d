"""Carries commands out on a graph: each is checked as if it were written by hand, and noted as changes.

All of a transaction or nothing: what is refused leaves the graph as it was. Stands on `commands`, `changes` and
`enclosing`; a graph that runs is edited the same way, and the run follows.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias, cast

import msgspec

from hfg.base.values import own_copy, same
from hfg.errors import ConnectionError as EdgeRefused
from hfg.errors import GraphError, HfgError
from hfg.graph.editing import commands as c
from hfg.graph.editing.changes import (
    Change,
    EdgeChange,
    EdgeSwap,
    GateChange,
    GroupsChange,
    NodeChange,
    NodeCopied,
    NodeSwap,
    NotesChange,
    OptionsChange,
    ParameterChange,
    PortChange,
    PromotionChange,
    Renaming,
    undo_all,
)
from hfg.graph.editing.copying import copy_of
from hfg.graph.editing.data import edge_as_meant
from hfg.graph.editing.enclosing import declared_box, dissolve, enclose
from hfg.graph.editing.making import as_meant, fitting, kept, made
from hfg.graph.editing.type_texts import type_of_text
from hfg.graph.structure.adding import add
from hfg.graph.structure.assigning import move
from hfg.graph.structure.boundary import GraphInput, GraphOutput
from hfg.graph.structure.connecting import declare_edge, refuse
from hfg.graph.structure.declaring import need_new_port
from hfg.graph.structure.edge import Edge, SourceEnd, TargetEnd, owner_of
from hfg.graph.structure.finding import same_port
from hfg.graph.structure.fitting import need_fitting
from hfg.graph.structure.gates import Gate
from hfg.graph.structure.gating import refuse_gate
from hfg.graph.structure.given import edge_options, group_spec
from hfg.graph.structure.level import Level, level_of, nodes_within
from hfg.graph.structure.naming import need_name, suggest
from hfg.graph.structure.option import given
from hfg.graph.structure.options import PLAIN, EdgeOptions, GroupSpec
from hfg.graph.structure.places import side_of
from hfg.graph.structure.pointing import level_and_name, node_at, parameter_at, source_at, target_at
from hfg.graph.structure.promoting import refuse_promotion, refuse_standing, stands_for
from hfg.graph.structure.subgraph import is_box
from hfg.nodetypes.node import Node
from hfg.ports import ParameterPort, Port

__all__ = ["perform"]

Promoted: TypeAlias = dict[str, list[ParameterPort[Any]]]


def perform(level: Level, commands: Sequence[c.Command]) -> list[Change]:
    """Carry commands out, one after the other; all of them or, when one is refused, none.

    Raises:
      GraphError: one cannot be; the message says which, and why.
    """
    hand = _Hand(level)
    with level.whole.taking_commands():
        try:
            for command in commands:
                hand.carry_out(command)
            hand.check_moved()
        except BaseException:
            undo_all(hand.changes)
            raise
    return hand.changes


class _Hand:
    """Does what commands say and notes each step."""

    def __init__(self, root: Level) -> None:
        self.root = root
        self.changes: list[Change] = []
        self.moved: list[tuple[Level, Edge]] = []  # edges of nodes that were replaced

    def carry_out(self, command: c.Command) -> None:
        """Do what one command says.

        Raises:
          GraphError: it cannot be; nothing of this command was done that is not noted.
        """
        method: Callable[[Any], None] | None = getattr(self, f"_{type(command).__name__.lower()}", None)
        if method is None or not isinstance(command, c.Command):
            raise GraphError(
                f"an edit takes commands, got {command!r}; write one, as in hfg.commands.Connect('a.out', 'b.value')"
            )
        _refuse_malformed(command)
        method(command)

    def check_moved(self) -> None:
        """Check the edges of replaced nodes, when those at both ends are what they will be.

        Raises:
          GraphError: one cannot be.
        """
        for around, edge in self.moved:
            if edge in around.connections.order:
                refuse(around, edge.source, edge.target, edge.options)

    def _gated_levels(self) -> list[Level]:
        """Those in which there are gates."""
        return [level for level in self.root.walk() if level.gates.listed] if self.root.whole.gated else []

    def do(self, change: Change) -> None:
        """Take a step and note it."""
        change.do()
        self.changes.append(change)

    # --- nodes ---

    def _add(self, command: c.Add) -> None:
        self._add_node(made(command.type, command.parameters, command.path), command.path, command.options)

    def _add_node(self, node: Node, path: str, options: c.NodeData) -> None:
        around, name = level_and_name(self.root, path)
        groups = self.root.whole.groups
        before = groups.state()
        add(around, node, name, options)
        if groups.state() != before:  # by build() of a subgraph
            self.changes.append(GroupsChange(groups, before, groups.state()))
        self.changes.append(NodeChange.of(node, added=True))

    def _addsubgraph(self, command: c.AddSubgraph) -> None:
        declared = {}
        for kind in ("input", "output", "event", "slot"):
            for name, text in getattr(command, f"{kind}s").items():
                if name in declared:
                    raise GraphError(
                        f'subgraph "{command.path}": it has two ports "{name}"; give each a name of its own'
                    )
                declared[name] = kind, type_of_text(text, f'port "{command.path}.{name}"')
        self._add_node(declared_box(self.root.whole.box_type, declared, command.path), command.path, command.options)

    def _remove(self, command: c.Remove) -> None:
        self.take_out(node_at(self.root, command.path))

    def take_out(self, node: Node) -> None:
        """Remove a node with all that refers to it."""
        around = level_of(node.place.graph)
        gone = set(nodes_within(node))
        for edge in _edges_of(around, node):
            self.do(EdgeChange.of(around, edge, added=False))
        for level in self._gated_levels():
            for gate in [gate for gate in level.gates if gate.target in gone or gate.by in gone]:
                self.do(GateChange(level, gate, level.gates.listed.index(gate), added=False))
        promoted = {
            name: [port for port in ports if port.node is not node] for name, ports in around.promotions.by_name.items()
        }
        self.promote(around, promoted)
        for one in gone:
            self._note_of(one, {})
        self.do(NodeChange.of(node, added=False))

    def promote(self, around: Level, promoted: Promoted) -> None:
        """Let other parameters stand for those inside, if that changes anything."""
        before = around.promotions.copied()
        after = {name: ports for name, ports in promoted.items() if ports}
        if before != after:
            self.do(PromotionChange(around, before, after))

    def _copy(self, command: c.Copy) -> None:
        node = node_at(self.root, command.path)
        around, name = level_and_name(self.root, command.to)
        _need_free(around, name, command.to)
        copy, inner = copy_of(node, around)
        self.do(NodeChange(around, name, copy, node._options, len(around.nodes), inner, added=True))
        for one, other in zip(nodes_within(node), nodes_within(copy), strict=True):
            self._note_of(other, self.root.whole.notes.get(one, {}))
            self.changes.append(NodeCopied(one, other))

    def _rename(self, command: c.Rename) -> None:
        node = node_at(self.root, command.path)
        where = node.place
        if command.name == where.name:
            return
        _need_free(level_of(where.graph), command.name, command.path)
        self.do(Renaming(node, where.name, command.name))

    def _replace(self, command: c.Replace) -> None:
        old = node_at(self.root, command.path)
        new = made(command.type, kept(old, command), command.path)
        if is_box(old) or is_box(new):
            self._replace_box(old, new)
            return
        around = level_of(old.place.graph)
        edges = _edges_of(around, old)
        for edge in edges:
            _counterpart(edge.source, old, new)
            _counterpart(edge.target, old, new)
        need_fitting(new, command.path, old._options)
        self.do(NodeSwap(old, new))
        for edge in edges:
            other = Edge(_counterpart(edge.source, old, new), _counterpart(edge.target, old, new), edge.options)
            self.do(EdgeSwap(around, edge, other))
            self.moved.append((around, other))
        self._hand_over(around, old, new)

    def _replace_box(self, old: Node, new: Node) -> None:
        """A subgraph is built afresh, so its inside is another."""
        around = level_of(old.place.graph)
        name, options = old.place.name, old._options
        position = around.members.position(name)
        edges = [(around.connections.position(edge), edge) for edge in _edges_of(around, old)]
        for _, edge in edges:
            _counterpart(edge.source, old, new)
            _counterpart(edge.target, old, new)
        gates = [
            (level, gate) for level in self._gated_levels() for gate in level.gates if old in (gate.target, gate.by)
        ]
        promoted = around.promotions.copied()
        notes = self.root.whole.notes.get(old, {})
        self.take_out(old)
        add(around, new, name, cast(c.NodeData, options.said()))
        added = NodeChange.of(new, added=True)
        self.changes.append(added)
        moved = NodeChange(around, name, new, added.options, position, added.inside, added=True)
        self.do(added.inverse())
        self.do(moved)
        for at, edge in edges:
            other = Edge(_counterpart(edge.source, old, new), _counterpart(edge.target, old, new), edge.options)
            self.do(EdgeChange(around, other, at, added=True))
            self.moved.append((around, other))
        for level, gate in gates:
            self.do(GateChange(level, _gate_of(gate, old, new), len(level.gates.listed), added=True))
        self.promote(around, _promoted_by(around, promoted, old, new))
        self._note_of(new, notes)

    def _hand_over(self, around: Level, old: Node, new: Node) -> None:
        """Gates and promotions go on with the new node."""
        for level in self._gated_levels():
            for gate in [gate for gate in level.gates if old in (gate.target, gate.by)]:
                position = level.gates.listed.index(gate)
                self.do(GateChange(level, gate, position, added=False))
                self.do(GateChange(level, _gate_of(gate, old, new), position, added=True))
        self.promote(around, _promoted_by(around, around.promotions.by_name, old, new))
        notes = self.root.whole.notes.get(old, {})
        self._note_of(old, {})
        self._note_of(new, notes)

    # --- groups and ports of the whole ---

    def _addgroup(self, command: c.AddGroup) -> None:
        known = self.root.whole.groups
        if command.name in known.by_name and command.name != "loop":
            raise GraphError(
                f'group "{command.name}" is declared already, as {known.by_name[command.name]}; '
                "change it with ChangeGroup, or choose another name"
            )
        self._declare(group_spec(command.name, given(GroupSpec, command)))

    def _changegroup(self, command: c.ChangeGroup) -> None:
        before = self._group(command.name)
        said = {"threads": before.threads, **before.said(), **given(GroupSpec, command)}
        self._declare(group_spec(command.name, said))

    def _declare(self, spec: GroupSpec) -> None:
        groups = self.root.whole.groups
        before = groups.state()
        groups.change(spec)
        self.changes.append(GroupsChange(groups, before, groups.state()))

    def _removegroup(self, command: c.RemoveGroup) -> None:
        self._group(command.name)
        if command.name == "loop":
            raise GraphError('group "loop" is the event loop itself and is always there; remove another')
        for level in self.root.walk():
            for node in level.nodes.values():
                if node._options.group == command.name:
                    raise GraphError(
                        f'group "{command.name}" cannot be removed, for "{node.place.path}" runs in it; '
                        "move it with Move first, or remove it"
                    )
        groups = self.root.whole.groups
        before = groups.state()
        groups.remove(command.name)
        self.changes.append(GroupsChange(groups, before, groups.state()))

    def _group(self, name: str) -> GroupSpec:
        known = self.root.whole.groups.by_name
        if name not in known:
            raise GraphError(f'there is no group "{name}"; {suggest(str(name), known)}')
        return known[name]

    def _addinput(self, command: c.AddInput) -> None:
        hint = type_of_text(command.type, f'input "{command.name}" of the graph')
        need_new_port(self.root, "input", command.name, hint)
        self.do(PortChange(self.root, GraphInput(self.root.face, command.name, hint), added=True))

    def _addoutput(self, command: c.AddOutput) -> None:
        hint = type_of_text(command.type, f'output "{command.name}" of the graph')
        need_new_port(self.root, "output", command.name, hint)
        self.do(PortChange(self.root, GraphOutput(self.root.face, command.name, hint), added=True))

    # --- options and parameters ---

    def _move(self, command: c.Move) -> None:
        node = node_at(self.root, command.path)
        before = node._options
        move(self.root, node, command.group)
        self.changes.append(OptionsChange(node, before, node._options))

    def _enable(self, command: c.Enable) -> None:
        self._set_enabled(command.path, True)

    def _disable(self, command: c.Disable) -> None:
        self._set_enabled(command.path, False)

    def _set_enabled(self, path: str, enabled: bool) -> None:
        node = node_at(self.root, path)
        before = node._options
        self.do(OptionsChange(node, before, msgspec.structs.replace(before, enabled=enabled)))

    def _gate(self, command: c.Gate) -> None:
        gate = Gate(node_at(self.root, command.path), node_at(self.root, command.by), command.idle_rate_hz)
        refuse_gate(self.root, gate)
        level, other = (side_of(level_of(node.place.graph)) for node in (gate.target, gate.by))
        if level is not other:
            raise GraphError(
                f'"{command.path}" and "{command.by}" lie on two sides of the border of a subgraph that iterates, over '
                "which no gate reaches (rule G4); gate nodes on the same side"
            )
        self.do(GateChange(level, gate, len(level.gates.listed), added=True))

    def _ungate(self, command: c.Ungate) -> None:
        node = node_at(self.root, command.path)
        for level in self._gated_levels():
            for position, gate in enumerate(level.gates):
                if gate.target is node:
                    self.do(GateChange(level, gate, position, added=False))
                    return
        raise GraphError(f'"{command.path}" has no gate that could be taken away')

    def _note(self, command: c.Note) -> None:
        node = None if command.path == "" else node_at(self.root, command.path)
        try:
            value = msgspec.json.decode(msgspec.json.encode(command.value))  # as it comes over a wire
        except (TypeError, ValueError, RecursionError) as error:
            raise GraphError(
                f'note "{command.name}" of "{command.path}": notes are plain data, got {command.value!r:.80} '
                f"({error}); give numbers, texts, lists and dicts"
            ) from error
        notes = {name: value for name, value in self.root.whole.notes.get(node, {}).items() if name != command.name}
        self._note_of(node, notes if value is None else notes | {command.name: value})

    def _note_of(self, node: Node | None, after: dict[str, Any]) -> None:
        """Let these be the notes about a node, if they are others."""
        notes = self.root.whole.notes
        before = notes.get(node, {})
        if before != after:
            self.do(NotesChange(notes, node, before, after))

    def _setparameter(self, command: c.SetParameter) -> None:
        port = parameter_at(self.root, command.path)
        try:
            value = fitting(port.spec, command.value)
        except ValueError as error:
            raise GraphError(str(error)) from error
        self._write(port, value)

    def _write(self, port: ParameterPort[Any], value: object) -> None:
        """Give a parameter, and those that it stands for, a value."""
        before = [(one.node, one.name, one.value) for one in stands_for(port)]
        try:
            port.value = value
        except ValueError as error:
            raise GraphError(str(error)) from error
        self.changes += [
            ParameterChange(node, name, value, own_copy(node._parameters[name])) for node, name, value in before
        ]

    def _promote(self, command: c.Promote) -> None:
        outer, inner = parameter_at(self.root, command.path), parameter_at(self.root, command.inner)
        around = level_of(inner.node.place.graph)
        promoted = around.promotions.copied()
        if not command.promoted:
            standing = promoted.get(outer.name, []) if around.owner is outer.node else []
            if inner not in standing:
                raise GraphError(f'"{outer.path}" does not stand for "{inner.path}", so there is nothing to take back')
            self.promote(around, promoted | {outer.name: [port for port in standing if port is not inner]})
            return
        refuse_promotion(around, outer, inner)
        self._write(inner, outer.value)
        self.promote(around, promoted | {outer.name: [*promoted.get(outer.name, []), inner]})

    # --- edges ---

    def _connect(self, command: c.Connect) -> None:
        source, target = source_at(self.root, command.source), target_at(self.root, command.target)
        around = _level_for(self.root, source, target)
        said = edge_as_meant(command.said(), target, f'"{command.source}" -> "{command.target}"', as_meant)
        edge = declare_edge(around, source, target, said)
        self.changes.append(EdgeChange(around, edge, len(around.edges) - 1, added=True))

    def _disconnect(self, command: c.Disconnect) -> None:
        around, edge = self._edge(command.source, command.target)
        self.do(EdgeChange.of(around, edge, added=False))

    def _makeactive(self, command: c.MakeActive) -> None:
        around, edge = self._edge(command.source, command.target)
        self._say(around, edge, {"active": command.active})

    def _setedge(self, command: c.SetEdge) -> None:
        around, edge = self._edge(command.source, command.target)
        where = f'"{command.source}" -> "{command.target}"'
        said = edge_as_meant(given(EdgeOptions, command), edge.target, where, as_meant)
        if "latest" in (said.get("overflow"), edge.overflow) and said.get("overflow", edge.overflow) != edge.overflow:
            said.setdefault("capacity", PLAIN.capacity)  # the 1 of "latest" is its own
        self._say(around, edge, said)

    def _say(self, around: Level, edge: Edge, said: dict[str, Any]) -> None:
        """Let other options hold of an edge, if they are others."""
        options = edge_options(lambda: f'"{edge.label}"', msgspec.structs.asdict(edge.options) | said)
        refuse(around, edge.source, edge.target, options)
        if not same(options, edge.options):
            self.do(EdgeSwap(around, edge, Edge(edge.source, edge.target, options)))

    def _edge(self, source_path: str, target_path: str) -> tuple[Level, Edge]:
        source, target = source_at(self.root, source_path), target_at(self.root, target_path)
        for around in (_level_for(self.root, source, target), self.root):
            for edge in around.connections.at(target.node):
                if edge.source is source and edge.target is target:
                    return around, edge
        raise EdgeRefused(
            f'there is no edge "{source_path}" -> "{target_path}"; graph.edges lists those that there are'
        )

    # --- subgraphs ---

    def _enclose(self, command: c.Enclose) -> None:
        members = [node_at(self.root, path) for path in dict.fromkeys(command.paths)]
        enclose(self.do, members, command.name)

    def _dissolve(self, command: c.Dissolve) -> None:
        box = node_at(self.root, command.path)
        dissolve(self.do, box, self._gated_levels())
        self._note_of(box, {})


def _refuse_malformed(command: c.Command) -> None:
    """Commands of `decode` are well formed; those that are written in Python need not be.

    Raises:
      GraphError: a field holds something that it never holds.
    """
    for field in command.__struct_fields__:
        value = getattr(command, field)
        if field in ("parameters", "options", "inputs", "outputs", "events", "slots") and not isinstance(value, dict):
            raise GraphError(f"{type(command).__name__} takes {field} as a dict by name, got {value!r}")
        if field in ("source", "target", "type") and not isinstance(value, str):
            named = isinstance(command, c.AddInput | c.AddOutput)
            what = '"camera.out"' if field != "type" else '"int"' if named else '"module:name"'
            raise GraphError(f"{type(command).__name__} takes {field} as a text such as {what}, got {value!r}")
        if field == "name" and not isinstance(value, str):
            raise GraphError(f"{type(command).__name__} takes name as a text, got {value!r}")
        if field == "paths" and not (isinstance(value, tuple | list) and all(isinstance(one, str) for one in value)):
            raise GraphError(f'{type(command).__name__} takes several paths, as in ("detect", "track"), got {value!r}')


def _touches(edge: Edge, node: Node) -> bool:
    """Whether an edge begins or ends at a port of a node, as seen from outside."""
    return node in (owner_of(edge.source), owner_of(edge.target))


def _edges_of(around: Level, node: Node) -> list[Edge]:
    """The edges that begin or end at a port of a node, as seen from outside; in order."""
    return [edge for edge in around.connections.at(node) if _touches(edge, node)]


def _level_for(root: Level, source: SourceEnd, target: TargetEnd) -> Level:
    """The level at which an edge is declared: where its nodes are, for the ports of the whole may be named anywhere."""
    for end in (target, source):
        home = getattr(end, "graph", None)
        if home is not None and getattr(end, "node", None) is not root.face:
            return level_of(home)
    return root


def _counterpart(end: SourceEnd, old: Node, new: Node) -> Any:  # noqa: ANN401 - a port of the same kind
    """The port of the new node that stands for one of the old.

    Raises:
      GraphError: there is none.
    """
    if not isinstance(end, Port) or end.node is not old:
        return end
    try:
        return same_port(new, end)
    except HfgError as error:
        where = old._place or new._place
        raise GraphError(
            f'"{where.path if where else old._type.name}" cannot be replaced by {new._type.qualname}, which has no '
            f'{end.kind} "{end.name}", and that is in use; disconnect it first, or take a type that has it'
        ) from error


def _gate_of(gate: Gate, old: Node, new: Node) -> Gate:
    target, by = (new if one is old else one for one in (gate.target, gate.by))
    return Gate(target, by, gate.idle_rate_hz)


def _promoted_by(around: Level, promoted: Promoted, old: Node, new: Node) -> Promoted:
    """Let the parameters of the new node stand where those of the old one did.

    Raises:
      GraphError: it has none of this name, or one that cannot take the same values.
    """
    found: Promoted = {}
    for name, ports in promoted.items():
        found[name] = [_counterpart(port, old, new) for port in ports]
        for port in found[name]:
            if port.node is new and around.owner is not None:
                refuse_standing(around.owner.ports.parameters[name], port)
    return found


def _need_free(around: Level, name: str, path: str) -> None:
    if need_name("a node", name) in around.nodes:
        raise GraphError(f'"{path}": {around.title} has a node "{name}" already; choose another name')
