"""Commands that give a port an edge: to a node that shows its values, or out of its subgraph.

Leads a port inside a subgraph out of it: the subgraph gets its own port, with an edge to a port of its neighbours.

A subgraph without a type of its own has the ports that its edges need (rule G1), so it is dissolved, connected and
enclosed again, in one edit: nodes, tokens and activity stay as they are. Depends on `targets`.
"""

from __future__ import annotations

from typing import Any

import msgspec

from hfg.graph import Graph
from hfg.graph.editing import commands as c
from hfg.graph.structure.edge import type_of
from hfg.graph.structure.level import level_of
from hfg.graph.structure.subgraph import Box, is_box, is_unnamed
from hfg.studio.refusing import Refused
from hfg.studio.targets import end_of, ends_of, fit_of
from hfg.types import why_not

__all__ = ["shown_by", "ways_out"]


def ways_out(graph: Graph, port: str) -> dict[str, Any]:
    """Return the ports outside that a port inside a subgraph can be led to, with the commands that do it.

    Raises:
      GraphError: there is no such port.
    """
    fixed, begins, level = end_of(graph, port)
    box = level.owner
    if not is_box(box) or fixed.node is box:
        return {"rows": [], "message": ""}
    around = level_of(box.place.graph)
    if not is_unnamed(box) or box._type.reference is not None:
        kind = box._type.qualname
        return {"rows": [], "message": f'"{box.place.path}" has the ports that its type {kind} declares'}
    rows = []
    for other in ends_of(around, sources=not begins):
        if other.node is box:
            continue
        source, target = (fixed, other) if begins else (other, fixed)
        if why_not(type_of(source), type_of(target)) is None:
            commands = _commands(box, list(level.nodes), port, other.path, begins=begins)
            rows.append({"port": other.path, "fit": fit_of(type_of(target)), "commands": msgspec.to_builtins(commands)})
    return {"rows": rows, "message": ""}


def shown_by(graph: Graph, port: str) -> dict[str, Any]:
    """Return the commands that add a node which shows what a port sends, because nothing else takes it.

    Raises:
      GraphError: there is no such port.
      Refused: nothing is sent there.
    """
    _, begins, level = end_of(graph, port)
    if not begins:
        raise Refused("usage", f'"{port}" is where an edge ends, so nothing is sent there', port)
    path = level.path_to(level.members.free_name("show")[0])
    commands = [c.Add("hfg.nodes.display:Show", path), c.Connect(port, f"{path}.value")]
    return {"commands": msgspec.to_builtins(commands)}


def _commands(box: Box, members: list[str], port: str, other: str, *, begins: bool) -> list[c.Command]:
    path, around = box.place.path, level_of(box.place.graph)
    outer = around.path
    prefix = f"{outer}/" if outer else ""
    inner = prefix + port.removeprefix(f"{path}/")
    notes = around.whole.notes.get(box, {})
    source, target = (inner, other) if begins else (other, inner)
    again = [c.Note(path, name, value) for name, value in notes.items()]
    group = box._options.group
    moved = [] if group is None else [c.Move(path, group)]
    return [
        c.Dissolve(path),
        c.Connect(source, target),
        c.Enclose(tuple(prefix + name for name in members), box.place.name),
        *moved,
        *again,
    ]
