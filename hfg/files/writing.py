"""Writes a document as text, and text into a file: whole or not at all. Depends on `emitting` and `document`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from hfg.base.whole import write_whole
from hfg.files.emitting import emit
from hfg.graph.editing.document import (
    NODE_OPTIONS,
    VERSION,
    BoxDocument,
    Document,
    EdgeDocument,
    GroupDocument,
    MonitorDocument,
    NodeDocument,
    OperatorDocument,
)

_FIRST: Final = ("hfg", "name", "notes", "groups", "monitors")
_ARROW: Final = " -> "


def text_of(document: Document) -> str:
    """Write a document as text; the same text for the same document.

    Raises:
      TypeError: a value in it is not plain data.
    """
    said: dict[str, Any] = {"hfg": VERSION, "name": document.name}
    for name in _FIRST[2:]:
        value = getattr(document, name)
        if value:
            said[name] = _plain(value)
    said |= _box(document)
    if document.facts:
        said["facts"] = _plain(document.facts)
    return emit(said)


def _box(box: BoxDocument) -> dict[str, Any]:
    return {name: _plain(value) for name in BoxDocument.__struct_fields__ if (value := getattr(box, name))}


def _plain(value: Any) -> Any:
    match value:
        case NodeDocument():
            found = _struct(value)
            if value.graph is not None:
                found["graph"] = _box(value.graph)
            return found
        case EdgeDocument():
            return _edge(value)
        case GroupDocument():
            return {"threads": value.threads} | _struct(value)
        case OperatorDocument():
            found = _struct(value)
            return value.type if len(found) == 1 else found
        case MonitorDocument():
            found = _struct(value)
            return value.property if len(found) == 1 else {"property": found.pop("property"), **found}
        case dict():
            return {name: _plain(one) for name, one in value.items()}
        case list() | tuple():
            return [_plain(one) for one in value]
    if hasattr(value, "__struct_fields__"):
        return _struct(value) or None
    return value


def _struct(value: Any) -> dict[str, Any]:
    """Return the fields that differ from their defaults, and those that are always written."""
    defaults = dict(zip(reversed(value.__struct_fields__), reversed(value.__struct_defaults__), strict=False))
    found: dict[str, Any] = {}
    names = value.__struct_fields__
    if isinstance(value, NodeDocument):  # what it is, how it runs, what it is given
        names = (*names[:2], *NODE_OPTIONS, *(name for name in names[2:] if name not in NODE_OPTIONS))
    for name in names:
        one = getattr(value, name)
        usual = defaults.get(name, _Required)
        usual = usual.factory() if hasattr(usual, "factory") else usual
        if usual is _Required or type(usual) is not type(one) or usual != one:
            found[name] = _plain(one)
    return found


class _Required:
    """Stands for no default."""


def _edge(edge: EdgeDocument) -> Any:
    options = _struct(edge)
    del options["source"], options["target"]
    label = f"{edge.source}{_ARROW}{edge.target}"
    if label.count(_ARROW) > 1 or label != " ".join(label.split(" ")).strip() or edge.source.strip() != edge.source:
        return {"source": edge.source, "target": edge.target} | options
    return {label: options} if options else label


def write_text(text: str, path: Path) -> None:
    """Put a text into a file: all of it or, on a full disk or a sudden end, nothing, and then the file is as before.

    Raises:
      OSError: it cannot be written.
    """
    write_whole(path, lambda stream: stream.write(text.encode()))
