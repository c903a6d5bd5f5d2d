"""Commands that mute a node: it is disabled, and what comes to it goes around it, until it takes part again.

Its edges are kept in its note, so that they come back after the graph was saved and opened, too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Final

import msgspec

from hfg.encoding import encode
from hfg.graph import Edge, Graph
from hfg.graph.editing import commands as c
from hfg.graph.editing.data import edge_as_data
from hfg.graph.structure.edge import end_path, owner_of, type_of
from hfg.graph.structure.level import Level, level_of
from hfg.graph.structure.paths import node_at
from hfg.nodetypes.node import Node
from hfg.studio.refusing import Refused
from hfg.types import why_not

__all__ = ["muted", "ways_among", "ways_named"]

_NOTE: Final = "muted"


def muted(graph: Graph, path: str) -> dict[str, Any]:
    """Return the commands that mute a node, or those that let a muted one take part again.

    Raises:
      GraphError: there is no such node.
      Refused: nothing that comes to the node could go on in its place.
    """
    node = node_at(level_of(graph), path)
    level = level_of(node.place.graph)
    kept = level.whole.notes.get(node, {}).get(_NOTE)
    commands = _around(level, node) if kept is None else _through(level, node, kept)
    return {"commands": msgspec.to_builtins(commands)}


def _around(level: Level, node: Node) -> list[c.Command]:
    path = node.place.path
    commands: list[c.Command] = [c.Disable(path)]
    kept = []
    for edge, before in _joined(level, node):
        source, target = end_path(before.source), end_path(edge.target)
        options = msgspec.to_builtins(edge_as_data(edge, encode))
        kept.append({"from": source, "out": edge.source.name, "to": target, "options": options})
        commands += [c.Disconnect(end_path(edge.source), target), c.Connect(source, target)]
    if not kept:
        raise Refused("usage", f'nothing that "{path}" receives can go on in its place; disable it instead', path)
    return [*commands, c.Note(path, _NOTE, kept)]


def _joined(level: Level, node: Node) -> Iterator[tuple[Edge, Edge]]:
    """Yield each edge from an output of a node, with the first one to its inputs whose values its target takes."""
    into = level.connections.into
    inputs = [into[port] for port in node.ports.inputs.values() if port in into]
    others = [one for one in inputs if owner_of(one.source) is not node]
    for edge in level.edges:
        if owner_of(edge.source) is node and edge.source.kind == "output" and owner_of(edge.target) is not node:
            fit = (one for one in others if why_not(type_of(one.source), type_of(edge.target)) is None)
            if (before := next(fit, None)) is not None:
                yield edge, before


def _through(level: Level, node: Node, kept: list[dict[str, Any]]) -> list[c.Command]:
    """Put back what was kept of edges that are still there; the others have been edited meanwhile."""
    path = node.place.path
    commands: list[c.Command] = [c.Enable(path)]
    there = {edge.label for edge in level.edges}
    for one in kept:
        if f"{one['from']} -> {one['to']}" in there:
            again = {"do": "Connect", "source": f"{path}.{one['out']}", "target": one["to"], **one["options"]}
            commands += [c.Disconnect(one["from"], one["to"]), msgspec.convert(again, c.Connect)]
    return [*commands, c.Note(path, _NOTE)]


def ways_among(command: c.Command, is_chosen: Callable[[str], bool]) -> c.Command | None:
    """Keep of the note of a muted node the ways around it between chosen nodes; without any, take the note away."""
    if (ways := _ways(command)) is None:
        return command
    kept = [way for way in ways if is_chosen(way["from"]) and is_chosen(way["to"])]
    return msgspec.structs.replace(command, value=kept) if kept else None


def ways_named(command: c.Command, named: Callable[[str], str]) -> c.Command:
    """Let the note of a muted node follow the names of the nodes around it."""
    if (ways := _ways(command)) is None:
        return command
    renamed = [way | {"from": named(way["from"]), "to": named(way["to"])} for way in ways]
    return msgspec.structs.replace(command, value=renamed)


def _ways(command: c.Command) -> list[dict[str, Any]] | None:
    """Return the ways around a node that its note keeps; None if it is another note, or one that makes no sense."""
    if not isinstance(command, c.Note) or command.name != _NOTE or not isinstance(command.value, list):
        return None
    is_own = all(isinstance(one, dict) and {"from", "to"} <= one.keys() for one in command.value)
    return (
        command.value
        if is_own and all(isinstance(one[end], str) for one in command.value for end in ("from", "to"))
        else None
    )
