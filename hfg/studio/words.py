"""An edit in words, for the history: "set blur.sigma to 3". Depends on commands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from hfg.errors import shown
from hfg.graph import commands as c

__all__ = ["in_words"]

_MOST_LETTERS: Final = 40
_MOST_COMMANDS: Final = 3


def in_words(commands: Sequence[c.Command]) -> str:
    """Return what an edit does, on one line."""
    said = list(dict.fromkeys(_said(one) for one in commands))
    more = len(said) - _MOST_COMMANDS
    return ", ".join(said[:_MOST_COMMANDS]) + (f" and {more} more" if more > 0 else "")


def _said(command: c.Command) -> str:
    match command:
        case c.Add(path=path, type=type_):
            return f"add {path} ({type_.rpartition(':')[2]})"
        case c.AddSubgraph(path=path):
            return f"add subgraph {path}"
        case c.AddInput(name=name) | c.AddOutput(name=name):
            return f"add the graph's {'input' if isinstance(command, c.AddInput) else 'output'} {name}"
        case c.AddGroup(name=name):
            return f"add group {name}"
        case c.ChangeGroup(name=name):
            return f"change group {name}"
        case c.RemoveGroup(name=name):
            return f"remove group {name}"
        case c.Copy(path=path, to=to):
            return f"copy {path} to {to}"
        case c.Rename(path=path, name=name):
            return f"rename {path} to {name}"
        case c.Move(path=path, group=group):
            return f"move {path} to group {group or 'of its surroundings'}"
        case c.SetParameter(path=path, value=value):
            return f"set {path} to {shown(value, _MOST_LETTERS)}"
        case c.Note(path=path, name=name):
            return f"place {path}" if name == "position" else f"note {name} of {path or 'the graph'}"
        case c.Enclose(paths=paths, name=name):
            return f"put {', '.join(paths[:_MOST_COMMANDS])} into {name}"
        case c.Replace(path=path, type=type_):
            return f"replace {path} by {type_.rpartition(':')[2]}"
        case c.Gate(path=path, by=by):
            return f"gate {path} by {by}"
        case c.Promote(path=path, inner=inner, promoted=promoted):
            return f"let {path} stand for {inner}" if promoted else f"let {path} no longer stand for {inner}"
        case c.MakeActive(source=source, target=target, active=active):
            return f"make {source} → {target} {'active' if active else 'inactive'}"
        case c.Connect(source=source, target=target):
            return f"connect {source} → {target}"
        case c.Disconnect(source=source, target=target):
            return f"disconnect {source} → {target}"
        case c.SetEdge(source=source, target=target):
            return f"change {source} → {target}"
    return f"{type(command).__name__.lower()} {getattr(command, 'path', '')}".rstrip()
