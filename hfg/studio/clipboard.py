"""Nodes as text, to be pasted into this graph or another one, or sent to another user. Depends on muting."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from typing import Any, Final

import msgspec

from hfg.errors import GraphError
from hfg.graph import Graph
from hfg.graph import commands as c
from hfg.graph.structure.level import inside, level_of
from hfg.graph.structure.paths import node_at
from hfg.studio.muting import ways_among, ways_named
from hfg.studio.refusing import Refused

__all__ = ["pasted", "text_of_nodes"]

_PATHS: Final = ("path", "source", "target", "by", "inner")
_LEFT_OUT: Final = (c.AddGroup, c.AddInput, c.AddOutput, c.ChangeGroup)


def text_of_nodes(graph: Graph, paths: Iterable[str]) -> str:
    """Return nodes, and the edges and gates between them, as commands on one line.

    Raises:
      GraphError: one is not there, or cannot be made by commands.
    """
    chosen = set(paths)
    for path in chosen:
        node_at(level_of(graph), path)
    if len({path.rpartition("/")[0] for path in chosen}) > 1:
        raise Refused("usage", "nodes are copied from one level at a time")
    within = [one for one in graph.as_commands() if not isinstance(one, _LEFT_OUT) and _is_within(one, chosen)]
    copied = (ways_among(one, lambda path: _node_in(path, chosen) is not None) for one in within)
    return c.encode([one for one in copied if one is not None])


def _is_within(command: c.Command, chosen: Container[str]) -> bool:
    said = [getattr(command, name) for name in _PATHS if isinstance(getattr(command, name, None), str)]
    return bool(said) and all(_node_in(one, chosen) is not None for one in said)


def _node_in(path: str, nodes: Container[str]) -> str | None:
    """Return the outermost of some nodes that a path leads to, into or to a port of; None if there is none."""
    ends = [number for number, letter in enumerate(path) if letter in "/."]
    return next((path[:end] for end in (*ends, len(path)) if path[:end] in nodes), None)


def pasted(graph: Graph, text: str, level: str, allow: Iterable[str]) -> list[Any]:
    """Return the commands of a text so that they add its nodes at a level, under names that are free there.

    Raises:
      GraphError: the text holds no commands, or there is no such level.
    """
    commands = c.decode(text, allow=allow)
    around = level_of(graph) if not level else inside(node_at(level_of(graph), level))
    if around is None:
        raise GraphError(f'"{level}" is not a subgraph, so nothing is inside it')
    names: dict[str, str] = {}
    taken: set[str] = set()
    numbers: dict[str, int] = {}  # the last that was tried after a name: a text may have one name many times
    for top in _tops(commands):
        base = top.rpartition("/")[2]
        name, number = base, numbers.get(base, 1)
        while name in around.nodes or name in taken:
            number += 1
            name = f"{base}_{number}"
        numbers[base] = number
        taken.add(name)
        names[top] = f"{level}/{name}" if level else name
    plain = msgspec.json.decode(c.encode([_moved(one, names) for one in commands]))
    assert isinstance(plain, list)
    return plain


def _tops(commands: Iterable[c.Command]) -> list[str]:
    """Return the outermost nodes that are added; all others are inside them."""
    added = {one.path: None for one in commands if isinstance(one, c.Add | c.AddSubgraph)}
    return [path for path in added if _node_in(path, added) == path]


def _moved(command: c.Command, names: Mapping[str, str]) -> c.Command:
    def named(path: str) -> str:
        old = _node_in(path, names)
        return path if old is None else names[old] + path[len(old) :]

    said = {field: one for field in _PATHS if isinstance(one := getattr(command, field, None), str)}
    moved = msgspec.structs.replace(command, **{field: named(path) for field, path in said.items()})
    return ways_named(moved, named)
