"""Carries commands out on a graph: all of an edit or nothing, because a refused command undoes those before it.

Resolves the paths in commands; `steps` does the work. A running graph is edited in the same way, and the run follows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import msgspec

from hfg.errors import ConnectionError as EdgeRefused
from hfg.errors import GraphError
from hfg.graph.editing import commands as c
from hfg.graph.editing.boxes import box_with
from hfg.graph.editing.changes import Change, GroupsChange, NodeChange, NodeCopied, Renaming
from hfg.graph.editing.copying import copy_of
from hfg.graph.editing.enclosing import dissolve, enclose
from hfg.graph.editing.making import kept, made
from hfg.graph.editing.replacing import replace
from hfg.graph.editing.steps import Steps
from hfg.graph.structure.connecting import refuse
from hfg.graph.structure.edge import Edge, SourceEnd, TargetEnd
from hfg.graph.structure.facts import Fact
from hfg.graph.structure.gates import Gate
from hfg.graph.structure.level import Level, level_of, nodes_within
from hfg.graph.structure.monitors import moved_monitor
from hfg.graph.structure.naming import need_name, suggest
from hfg.graph.structure.option import given
from hfg.graph.structure.options import PLAIN, EdgeOptions, GroupGiven, GroupSpec
from hfg.graph.structure.paths import level_and_name, node_at, parameter_at, source_at, target_at
from hfg.nodetypes.node import Node


def perform(level: Level, commands: Sequence[c.Command]) -> list[Change]:
    """Carry commands out, one after the other; all of them or, when one is refused, none.

    Raises:
      GraphError: a command cannot be carried out; the message says which, and why.
    """
    interpreter = _Interpreter(level)
    with level.whole.taking_commands():
        try:
            for command in commands:
                interpreter.carry_out(command)
            interpreter.check_replaced()
        except BaseException:
            interpreter.steps.take_back()
            raise
    return interpreter.steps.changes


class _Interpreter:
    """Has a method for each kind of command, named after it."""

    def __init__(self, root: Level) -> None:
        self.root = root
        self.steps = Steps(root)
        self.replaced: list[tuple[Level, Edge]] = []  # edges of nodes that were replaced

    def carry_out(self, command: c.Command) -> None:
        """Carry out one command."""
        method: Callable[[Any], None] | None = getattr(self, f"_{type(command).__name__.lower()}", None)
        if method is None or not isinstance(command, c.Command):
            raise GraphError(
                f"an edit takes commands, got {command!r}; write one, as in hfg.commands.Connect('a.out', 'b.value')"
            )
        _refuse_malformed(command)
        if isinstance(command, c.Rename | c.Enclose | c.Dissolve) and self.root.whole.monitors:
            before = {node.place.path: node for level in self.root.walk() for node in level.nodes.values()}
            method(command)
            self._move_monitors(before)
        else:
            method(command)

    def _move_monitors(self, before: Mapping[str, Node]) -> None:
        """Let monitors name the same nodes as before: by the paths that these have now."""

        def now(path: str) -> str:
            node = before.get(path)
            return path if node is None or node._place is None else node.place.path

        monitors = self.root.whole.monitors
        self.steps.set_monitors({name: moved_monitor(spec, now) for name, spec in monitors.items()})

    def check_replaced(self) -> None:
        """Check the edges of replaced nodes, now that the nodes at both ends are final."""
        for around, edge in self.replaced:
            if edge in around.connections.order:
                refuse(around, edge.source, edge.target, edge.options)

    # --- nodes ---

    def _add(self, command: c.Add) -> None:
        node = made(command.type, command.parameters, command.path)
        self.steps.need_room(node)
        self.steps.add(*level_and_name(self.root, command.path), node, command.options)

    def _addsubgraph(self, command: c.AddSubgraph) -> None:
        box = box_with(self.root.whole.box_type, command, command.path)
        self.steps.add(*level_and_name(self.root, command.path), box, command.options)

    def _remove(self, command: c.Remove) -> None:
        self.steps.remove(node_at(self.root, command.path))

    def _copy(self, command: c.Copy) -> None:
        node = node_at(self.root, command.path)
        around, name = level_and_name(self.root, command.to)
        _need_free(around, name, command.to)
        self.steps.need_room(node, copy=True)
        originals = list(nodes_within(node))  # now: a copy may be inside of its original
        copy, inner = copy_of(node, around)
        self.steps.do(NodeChange(around, name, copy, node._options, len(around.nodes), inner, added=True))
        for one, other in zip(originals, nodes_within(copy), strict=True):
            self.steps.set_notes(other, self.root.whole.notes.get(one, {}))
            self.steps.changes.append(NodeCopied(one, other))

    def _rename(self, command: c.Rename) -> None:
        node = node_at(self.root, command.path)
        where = node.place
        if command.name != where.name:
            _need_free(level_of(where.graph), command.name, command.path)
            self.steps.do(Renaming(node, where.name, command.name))

    def _replace(self, command: c.Replace) -> None:
        old = node_at(self.root, command.path)
        new = made(command.type, kept(old, command), command.path)
        self.steps.need_room(new)
        self.replaced += replace(self.steps, old, new)

    def _move(self, command: c.Move) -> None:
        self.steps.move(node_at(self.root, command.path), command.group)

    def _enable(self, command: c.Enable) -> None:
        self.steps.set_options(node_at(self.root, command.path), enabled=True)

    def _disable(self, command: c.Disable) -> None:
        self.steps.set_options(node_at(self.root, command.path), enabled=False)

    def _setparameter(self, command: c.SetParameter) -> None:
        self.steps.set_parameter(parameter_at(self.root, command.path), command.value)

    def _note(self, command: c.Note) -> None:
        node = None if command.path == "" else node_at(self.root, command.path)
        try:
            value = msgspec.json.decode(msgspec.json.encode(command.value))  # as it arrives over a network
        except (TypeError, ValueError, RecursionError) as error:
            raise GraphError(
                f'note "{command.name}" of "{command.path}": notes are plain data, got {command.value!r:.80} '
                f"({error}); give numbers, texts, lists and dicts"
            ) from error
        self.steps.set_note(node, command.name, value)

    # --- groups and ports of the whole graph ---

    def _addgroup(self, command: c.AddGroup) -> None:
        known = self.root.whole.groups.by_name
        if command.name in known and command.name != "loop":
            raise GraphError(
                f'group "{command.name}" is already declared as {known[command.name]}; '
                "change it with ChangeGroup, or choose another name"
            )
        self.steps.declare_group(command.name, given(GroupSpec, command))

    def _changegroup(self, command: c.ChangeGroup) -> None:
        before = self._group(command.name)
        said: GroupGiven = {"threads": before.threads, **before.said(), **given(GroupSpec, command)}
        self.steps.declare_group(command.name, said)

    def _removegroup(self, command: c.RemoveGroup) -> None:
        self._group(command.name)
        if command.name == "loop":
            raise GraphError('group "loop" is the event loop itself and is always there; remove another')
        for level in self.root.walk():
            for node in level.nodes.values():
                if node._options.group == command.name:
                    raise GraphError(
                        f'cannot remove group "{command.name}": "{node.place.path}" runs in it; '
                        "move it with Move first, or remove it"
                    )
        groups = self.root.whole.groups
        before = groups.state()
        groups.remove(command.name)
        self.steps.changes.append(GroupsChange(groups, before, groups.state()))

    def _group(self, name: str) -> GroupSpec:
        known = self.root.whole.groups.by_name
        if name not in known:
            raise GraphError(f'there is no group "{name}"; {suggest(str(name), known)}')
        return known[name]

    def _setmonitor(self, command: c.SetMonitor) -> None:
        self.steps.declare_monitor(command.name, command.property, command.said())

    def _removemonitor(self, command: c.RemoveMonitor) -> None:
        known = self.root.whole.monitors
        if command.name not in known:
            raise GraphError(f'there is no monitor "{command.name}"; {suggest(command.name, known)}')
        self.steps.set_monitors({name: spec for name, spec in known.items() if name != command.name})

    def _addinput(self, command: c.AddInput) -> None:
        self.steps.declare_port("input", command.name, command.type)

    def _addoutput(self, command: c.AddOutput) -> None:
        self.steps.declare_port("output", command.name, command.type)

    # --- edges ---

    def _connect(self, command: c.Connect) -> None:
        source, target = source_at(self.root, command.source), target_at(self.root, command.target)
        where = f'"{command.source}" -> "{command.target}"'
        self.steps.connect(_level_for(self.root, source, target), source, target, command.said(), where)

    def _disconnect(self, command: c.Disconnect) -> None:
        self.steps.disconnect(*self._edge(command))

    def _makeactive(self, command: c.MakeActive) -> None:
        self.steps.redeclare(*self._edge(command), {"active": command.active})

    def _setedge(self, command: c.SetEdge) -> None:
        around, edge = self._edge(command)
        said = given(EdgeOptions, command)
        if "latest" in (said.get("overflow"), edge.overflow) and said.get("overflow", edge.overflow) != edge.overflow:
            said.setdefault("capacity", PLAIN.capacity)  # the 1 of "latest" is its own
        self.steps.redeclare(around, edge, said)

    def _edge(self, command: c.Disconnect | c.MakeActive | c.SetEdge) -> tuple[Level, Edge]:
        source, target = source_at(self.root, command.source), target_at(self.root, command.target)
        for around in (_level_for(self.root, source, target), self.root):
            for edge in around.connections.at(target.node):
                if edge.source is source and edge.target is target:
                    return around, edge
        raise EdgeRefused(
            f'there is no edge "{command.source}" -> "{command.target}"; graph.edges lists those that there are'
        )

    # --- facts, gates and promotions ---

    def _fact(self, command: c.Fact) -> None:
        fact = Fact(command.claim, tuple(node_at(self.root, path) for path in command.nodes))
        self.steps.state(fact) if command.stated else self.steps.retract(fact)

    def _gate(self, command: c.Gate) -> None:
        target, by = node_at(self.root, command.path), node_at(self.root, command.by)
        self.steps.gate(Gate(target, by, command.idle_rate_hz))

    def _ungate(self, command: c.Ungate) -> None:
        node = node_at(self.root, command.path)
        for level in self.steps.gated_levels():
            for gate in level.gates:
                if gate.target is node:
                    self.steps.ungate(level, gate)
                    return
        raise GraphError(f'"{command.path}" has no gate that could be removed')

    def _promote(self, command: c.Promote) -> None:
        outer, inner = parameter_at(self.root, command.path), parameter_at(self.root, command.inner)
        if command.promoted:
            self.steps.promote(outer, inner)
            return
        around = level_of(inner.node.place.graph)
        promoted = around.promotions.copied()
        standing = promoted.get(outer.name, []) if around.owner is outer.node else []
        if inner not in standing:
            raise GraphError(f'"{outer.path}" does not stand for "{inner.path}", so there is nothing to undo')
        rest = [port for port in standing if port is not inner]
        self.steps.set_promotions(around, promoted | {outer.name: rest})

    # --- subgraphs ---

    def _enclose(self, command: c.Enclose) -> None:
        members = [node_at(self.root, path) for path in dict.fromkeys(command.paths)]
        enclose(self.steps.do, members, command.name)

    def _dissolve(self, command: c.Dissolve) -> None:
        box = node_at(self.root, command.path)
        dissolve(self.steps.do, box, self.steps.gated_levels())
        self.steps.set_notes(box, {})


_DICTS = ("parameters", "options", "inputs", "outputs", "events", "slots")


def _refuse_malformed(command: c.Command) -> None:
    """Refuse values that fields cannot have: only the commands of `decode` are known to be well formed."""
    for field in command.__struct_fields__:
        value = getattr(command, field)
        if field in _DICTS and not isinstance(value, dict):
            raise GraphError(f"{type(command).__name__} takes {field} as a dict by name, got {value!r}")
        if field in ("source", "target", "type") and not isinstance(value, str):
            named = isinstance(command, c.AddInput | c.AddOutput)
            what = '"camera.out"' if field != "type" else '"int"' if named else '"module:name"'
            raise GraphError(f"{type(command).__name__} takes {field} as a text such as {what}, got {value!r}")
        if field == "name" and not isinstance(value, str):
            raise GraphError(f"{type(command).__name__} takes name as a text, got {value!r}")
        if field == "paths" and not (isinstance(value, tuple | list) and all(isinstance(one, str) for one in value)):
            raise GraphError(f'{type(command).__name__} takes several paths, as in ("detect", "track"), got {value!r}')


def _level_for(root: Level, source: SourceEnd, target: TargetEnd) -> Level:
    """Return the level of an edge: that of its nodes, because ports of the whole graph can be named anywhere."""
    for end in (target, source):
        home = getattr(end, "graph", None)
        if home is not None and getattr(end, "node", None) is not root.face:
            return level_of(home)
    return root


def _need_free(around: Level, name: str, path: str) -> None:
    if need_name("a node", name) in around.nodes:
        raise GraphError(f'"{path}": {around.title} already has a node "{name}"; choose another name')
