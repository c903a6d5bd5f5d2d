"""Notes and frames on the canvas, which are notes of the graph: saved in its file, undone like every edit.

A note is a note of the level that it lies on, by the name "note 1". So is a frame, and the nodes in it have a note
"frame" with its name: so it stays around them wherever they are and whatever they are called. Depends on the graph.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, Literal

import msgspec

from hfg.graph import Graph
from hfg.graph.editing import commands as c
from hfg.graph.structure.level import Level, inside, level_of
from hfg.graph.structure.paths import node_at
from hfg.studio.records import AnnotationRecord
from hfg.studio.refusing import Refused

__all__ = ["FRAME", "KINDS", "Annotate", "annotate", "annotations_of"]

FRAME: Final = "frame"
KINDS: Final = ("note", "frame")


class _Said(msgspec.Struct, frozen=True):
    """The value of a note about an annotation; anything else is a note of another editor."""

    text: str = ""
    at: tuple[float, float] = (0.0, 0.0)
    size: tuple[float, float] = (200.0, 72.0)


class Annotate(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What an annotation is to be.

    Attributes:
      level: path of the subgraph that it lies on.
      name: of one that is there; "" makes another.
      paths: the nodes in a frame; None leaves them.
      removed: it is to be no more.
    """

    kind: Literal["note", "frame"]
    level: str = ""
    name: str = ""
    text: str | None = None
    at: tuple[float, float] | None = None
    size: tuple[float, float] | None = None
    paths: list[str] | None = None
    removed: bool = False


def annotations_of(graph: Graph) -> dict[str, AnnotationRecord]:
    """Return all notes and frames by level and name."""
    found: dict[str, AnnotationRecord] = {}
    for level in level_of(graph).walk():
        members = _members(level)
        for name, value in _notes(level).items():
            said = _read(name, value)
            if said is not None:
                kind = name.partition(" ")[0]
                record = AnnotationRecord(level.path, name, kind, said.text, said.at, said.size, members.get(name, []))
                found[f"{level.path} {name}"] = record
    return found


def _notes(level: Level) -> dict[str, Any]:
    return level.whole.notes.get(level.owner, {})  # of the whole graph: None


def _read(name: str, value: object) -> _Said | None:
    kind, _, number = name.partition(" ")
    if kind not in KINDS or not number.isdecimal():
        return None
    try:
        return msgspec.convert(value, _Said)
    except msgspec.ValidationError:
        return None


def _members(level: Level) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for node in level.nodes.values():
        name = level.whole.notes.get(node, {}).get(FRAME)
        if isinstance(name, str):
            found.setdefault(name, []).append(node.place.path)
    return found


def annotate(graph: Graph, said: Annotate) -> dict[str, Any]:
    """Return the commands that make a note or frame, change it or remove it, and its key.

    Raises:
      GraphError: there is no such level or node.
      Refused: there is no such annotation, or a frame would be around nothing.
    """
    root = level_of(graph)
    level = root if not said.level else inside(node_at(root, said.level))
    if level is None:
        raise Refused("unknown", f'"{said.level}" is not a subgraph, so nothing is on it', said.level)
    notes = _notes(level)
    name = said.name or _free(notes, said.kind)
    before = _read(name, notes.get(name)) if said.name else _Said()
    if before is None:
        raise Refused("unknown", f'there is no {said.kind} "{name}"; it was removed', said.level)
    members = _members(level).get(name, [])
    wanted = members if said.paths is None else said.paths
    if said.kind == FRAME and not wanted and not said.removed:
        raise Refused("usage", "a frame is around nodes; choose some first", said.level)
    value = None if said.removed else msgspec.to_builtins(_changed(before, said))
    done: list[c.Command] = [c.Note(said.level, name, value)]
    done += _taken_in(name, members, [] if said.removed else wanted)
    return {"key": f"{said.level} {name}", "commands": msgspec.to_builtins(done)}


def _changed(before: _Said, said: Annotate) -> _Said:
    given = {each: value for each in ("text", "at", "size") if (value := getattr(said, each)) is not None}
    return msgspec.structs.replace(before, **given)


def _taken_in(frame: str, before: Sequence[str], after: Sequence[str]) -> list[c.Command]:
    out = [c.Note(path, FRAME, None) for path in before if path not in after]
    return [*out, *(c.Note(path, FRAME, frame) for path in after if path not in before)]


def _free(notes: dict[str, Any], kind: str) -> str:
    number = 1
    while f"{kind} {number}" in notes:
        number += 1
    return f"{kind} {number}"
