"""Finds the commands that make one graph like another, whatever both came from (rule R4).

Both become the commands that build them. Commands that only the first graph has are reversed, those that only the other
has are carried out. A node that has another name in the other graph is another node. Depends on `to_commands`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import msgspec

from hfg.base.values import same
from hfg.errors import GraphError
from hfg.graph.editing import commands as c
from hfg.graph.editing.to_commands import as_commands
from hfg.graph.structure.level import Level
from hfg.graph.structure.paths import node_at, parameter_at

_BESIDES = ("group", "enabled")
"""Options of a node that a command changes; with others it is another node."""


def difference(before: Level, after: Level) -> list[c.Command]:
    """Return commands that make a whole graph like another one.

    Raises:
      GraphError: part of one of them is not data, or a port of the graph would have to go.
    """
    return list(_Difference(_Told(before), _Told(after), after).commands())


class _Told:
    """A graph as commands, each by what it is about."""

    def __init__(self, level: Level) -> None:
        self.commands = as_commands(level)
        self.of = {_key(one): one for one in self.commands}
        self.nodes = {one.path: one for one in self.commands if isinstance(one, c.Add | c.AddSubgraph)}
        self.cleared = [one for one in self.commands if isinstance(one, c.Remove | c.Disconnect)]

    def cleared_in(self, path: str) -> list[c.Command]:
        """Return what was removed of what the type of a subgraph builds."""
        return [one for one in self.cleared if any(_is_at(each, path) for each in _about(one))]


def _key(command: c.Command) -> tuple[Any, ...]:
    match command:
        case c.Connect(source=source, target=target):
            return "edge", source, target
        case c.Disconnect(source=source, target=target):
            return "cut", source, target
        case c.Promote(path=path, inner=inner):
            return "promotion", path, inner
        case c.Note(path=path, name=name):
            return "note", path, name
        case c.Add(path=path) | c.AddSubgraph(path=path):
            return "node", path
        case c.Enable(path=path) | c.Disable(path=path):
            return "enabled", path
        case c.Fact(claim=claim, nodes=nodes):
            return "fact", f"{claim}: {sorted(nodes)}"
        case c.AddGroup(name=name) | c.SetMonitor(name=name) | c.AddInput(name=name) | c.AddOutput(name=name):
            return type(command).__name__, name
    return type(command).__name__, getattr(command, "path", "")


def _about(command: c.Command) -> Iterator[str]:
    """Yield the paths of the nodes that a command is about."""
    match command:
        case c.Connect(source=source, target=target) | c.Disconnect(source=source, target=target):
            yield from (_node_of(source), _node_of(target))
        case c.Promote(path=path, inner=inner):
            yield from (_node_of(path), _node_of(inner))
        case c.Gate(path=path, by=by):
            yield from (path, by)
        case c.Fact(nodes=nodes):
            yield from nodes
        case c.SetParameter(path=path):
            yield _node_of(path)
        case c.Note(path=""):
            return
        case _ if hasattr(command, "path"):
            yield command.path


def _node_of(port: str) -> str:
    """Return the path of the node that a port belongs to; "" for a port of the whole graph."""
    dot = port.find(".", port.rfind("/") + 1)
    return "" if dot < 0 else port[:dot]


def _is_at(path: str, node: str) -> bool:
    return path == node or path.startswith(f"{node}/")


class _Difference:
    def __init__(self, before: _Told, after: _Told, level: Level) -> None:
        self.before = before
        self.after = after
        self.level = level
        known, wanted = before.nodes, after.nodes
        others = {path for path in known if path in wanted and self._is_another(path)}
        self.gone = {path for path in known if path not in wanted or path in others}
        self.new = {path for path in wanted if path not in known or path in others}

    def _is_another(self, path: str) -> bool:
        one, other = self.before.nodes[path], self.after.nodes[path]
        if type(one) is not type(other) or not same(_rest(one), _rest(other)):
            return True
        return self.before.cleared_in(path) != self.after.cleared_in(path)

    def commands(self) -> Iterator[c.Command]:
        """Yield what goes, then what comes, in the order in which the other graph is built."""
        yield from self._undone()
        for path in sorted(self.gone):
            if not any(_is_at(path, other) for other in self.gone if other != path):
                yield c.Remove(path)
        for command in self.after.commands:
            old = self.before.of.get(_key(command))
            if self._concerns(command, self.new) or (old is None and not isinstance(command, c.Remove | c.Disconnect)):
                yield command
            elif old is not None and not same(old, command):
                yield from self._changed(old, command)
        yield from self._usual()

    @staticmethod
    def _concerns(command: c.Command, nodes: Iterable[str]) -> bool:
        about = list(_about(command))
        return any(_is_at(path, node) for path in about for node in nodes)

    def _left(self) -> Iterator[tuple[c.Command, c.Command | None]]:
        """Yield what the graph says now of nodes that stay, and what the other says instead."""
        for key, old in self.before.of.items():
            if not self._concerns(old, self.gone):
                yield old, self.after.of.get(key)

    def _undone(self) -> Iterator[c.Command]:
        for old, new in self._left():
            match old:
                case c.Connect() if new is None or not same(_inactive(old), _inactive(new)):
                    yield c.Disconnect(old.source, old.target)
                case c.Gate() if not same(old, new):
                    yield c.Ungate(old.path)
                case c.Fact() if new is None:
                    yield c.Fact(old.claim, old.nodes, stated=False)
                case c.Promote() if new is None:
                    yield c.Promote(old.path, old.inner, promoted=False)
                case c.AddInput() | c.AddOutput() if new is None:
                    raise GraphError(
                        f'the port "{old.name}" of the graph stays: no edit removes one; put it back into the graph'
                    )

    def _changed(self, old: c.Command, new: c.Command) -> Iterator[c.Command]:
        match old, new:
            case (c.Add() | c.AddSubgraph(), c.Add() | c.AddSubgraph()):
                yield from self._node_changed(old, new)
            case c.Connect(), c.Connect() if same(_inactive(old), _inactive(new)):
                yield c.MakeActive(new.source, new.target, new.active)
            case _, c.AddGroup():
                said = {name: getattr(new, name) for name in new.__struct_fields__}
                yield c.ChangeGroup(**{name: value for name, value in said.items() if value is not msgspec.UNSET})
            case _, c.AddInput() | c.AddOutput():
                raise GraphError(f'the port "{new.name}" of the graph keeps its type; give another one another name')
            case _:
                yield new

    def _node_changed(self, old: c.Add | c.AddSubgraph, new: c.Add | c.AddSubgraph) -> Iterator[c.Command]:
        group = new.options.get("group")
        if old.options.get("group") != group:
            yield c.Move(new.path, group)
        enabled = new.options.get("enabled", True)
        if old.options.get("enabled", True) != enabled:
            yield (c.Enable if enabled else c.Disable)(new.path)
        said, wanted = getattr(old, "parameters", {}), getattr(new, "parameters", {})
        for name in {**said, **wanted}:
            if name not in wanted:
                yield self._setting(f"{new.path}.{name}")
            elif name not in said or not same(said[name], wanted[name]):
                yield c.SetParameter(f"{new.path}.{name}", wanted[name])

    def _usual(self) -> Iterator[c.Command]:
        """Yield what the other graph does not say, because it is as usual there."""
        for old, new in self._left():
            if new is not None:
                continue
            match old:
                case c.SetParameter(path=path):
                    yield self._setting(path)
                case c.Note(path=path, name=name):
                    yield c.Note(path, name, None)
                case c.Enable(path=path) | c.Disable(path=path):
                    yield (c.Enable if node_at(self.level, path)._options.enabled else c.Disable)(path)
                case c.Move(path=path):
                    yield c.Move(path, node_at(self.level, path)._options.group)
                case c.AddGroup(name=name):
                    yield c.RemoveGroup(name)

    def _setting(self, path: str) -> c.SetParameter:
        port = parameter_at(self.level, path)
        return c.SetParameter(path, port.spec.encode(port.value))


def _rest(command: c.Command) -> object:
    """Return what makes a node another one."""
    options = {name: value for name, value in command.options.items() if name not in _BESIDES}  # type: ignore[attr-defined]
    changed = msgspec.structs.replace(command, options=options)
    return msgspec.structs.replace(changed, parameters={}) if isinstance(command, c.Add) else changed


def _inactive(command: c.Command) -> c.Command:
    return msgspec.structs.replace(command, active=False)
