"""An edit in words, for the history: "set blur.sigma to 3". Depends on commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from hfg.errors import shown
from hfg.graph import commands as c
from hfg.studio.annotating import FRAME, KINDS

__all__ = ["in_words"]

_MOST_LETTERS: Final = 40
_MOST_COMMANDS: Final = 3


def in_words(commands: Sequence[c.Command]) -> str:
    """Return what an edit does, on one line."""
    said = list(dict.fromkeys(_said(one) for one in commands))
    more = len(said) - _MOST_COMMANDS
    return ", ".join(said[:_MOST_COMMANDS]) + (f" and {more} more" if more > 0 else "")


_WORDS: Final[Mapping[type[c.Command], str]] = {
    c.Add: "add {path} ({kind})",
    c.AddSubgraph: "add subgraph {path}",
    c.AddInput: "add the graph's input {name}",
    c.AddOutput: "add the graph's output {name}",
    c.AddGroup: "add group {name}",
    c.ChangeGroup: "change group {name}",
    c.RemoveGroup: "remove group {name}",
    c.Copy: "copy {path} to {to}",
    c.Rename: "rename {path} to {name}",
    c.Move: "move {path} to group {group}",
    c.SetParameter: "set {path} to {shown}",
    c.Enclose: "put {first} into {name}",
    c.Replace: "replace {path} by {kind}",
    c.Gate: "gate {path} by {by}",
    c.Connect: "connect {source} → {target}",
    c.Disconnect: "disconnect {source} → {target}",
    c.SetEdge: "change {source} → {target}",
}
"""What a command does, with its fields; those whose words depend on a value, and verbs of one path, are not here."""


def _noted(path: str, name: str, *, removed: bool) -> str:
    if name == "position":
        return f"place {path}"
    if name == FRAME:
        return f"take {path} out of a frame" if removed else f"put {path} into a frame"
    if name.partition(" ")[0] in KINDS:
        return f"{'remove' if removed else 'write'} {name}"
    return f"note {name} of {path or 'the graph'}"


def _said(command: c.Command) -> str:
    match command:
        case c.Note(path=path, name=name):
            return _noted(path, name, removed=command.value is None)
        case c.Promote(path=path, inner=inner, promoted=promoted):
            return f"let {path} stand for {inner}" if promoted else f"let {path} no longer stand for {inner}"
        case c.Fact(claim=claim, nodes=nodes, stated=stated):
            some = ", ".join(nodes[:_MOST_COMMANDS])
            return f"{'state' if stated else 'no longer state'} that {claim} of {some} is active"
        case c.MakeActive(source=source, target=target, active=active):
            return f"make {source} → {target} {'active' if active else 'inactive'}"
    words = _WORDS.get(type(command))
    if words is None:
        return f"{type(command).__name__.lower()} {getattr(command, 'path', '')}".rstrip()
    fields = {name: getattr(command, name) for name in command.__struct_fields__}
    fields["kind"] = str(fields.get("type", "")).rpartition(":")[2]
    fields["first"] = ", ".join(fields.get("paths", ())[:_MOST_COMMANDS])
    fields["shown"] = shown(fields.get("value"), _MOST_LETTERS)
    fields["group"] = fields.get("group") or "of its surroundings"
    return words.format_map(fields)
