"""Subgraphs in files of their own: one type for all nodes of a file, found by name like any other type.

Its reference is `hfg.files.boxes:File[...]`. `building`, which depends on this module, provides how it is read and
filled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar, Final
from urllib.parse import quote, unquote

from hfg.encoding import Find
from hfg.graph.editing.boxes import Report, box_type
from hfg.graph.editing.document import Document
from hfg.graph.graph import Graph, Subgraph

Fill = Callable[[Any, Graph], None]
"""Fills the graph inside a subgraph."""

_MADE: Final[dict[Path, type[FileBox]]] = {}
"""The newest type of each file."""


class FileBox(Subgraph):
    """A subgraph that a file describes."""

    _file: ClassVar[Path]
    _document: ClassVar[Document]
    _parts: ClassVar[Mapping[str, type[FileBox]]]
    """The types of the files that it includes, by the names that it gives them."""
    _fill: ClassVar[Fill]
    _read: ClassVar[Callable[[Path], type[FileBox]]]
    """Makes the type of a file that was not read yet."""

    def build(self, graph: Graph) -> None:
        """Make the nodes and edges of the file."""
        type(self)._fill(self, graph)


def file_box_type(
    file: Path,
    document: Document,
    parts: Mapping[str, type[FileBox]],
    fill: Fill,
    report: Report,
    find: Find,
) -> type[FileBox]:
    """Make the type of the subgraphs that a file describes, or return the existing one if the file has not changed."""
    known = _MADE.get(file)
    if known is not None and known._document == document and known._parts == parts:
        return known
    words = file.name.partition(".")[0].replace("-", "_").split("_")
    body = {
        "__name__": "".join(word.title() for word in words) or "Box",
        "__module__": __name__,
        "__qualname__": f"File[{quote(str(file), safe='').replace('.', '%2E')}]",
        "__doc__": f"The subgraph in {file.name}.",
        "_file": file,
        "_document": document,
        "_parts": parts,
        "_fill": staticmethod(fill),
    }
    made = box_type(FileBox, document, body, report, find)
    assert issubclass(made, FileBox)
    if made is not FileBox:
        _MADE[file] = made
    return made


def file_of(reference: str) -> Path | None:
    """Return the file that the reference of a type stands for; None for other types."""
    module, _, name = reference.partition(":")
    return _file_in(name) if module == __name__ else None


def _file_in(name: str) -> Path | None:
    is_file = name.startswith("File[") and name.endswith("]")
    return Path(unquote(name.removeprefix("File[").removesuffix("]"))) if is_file else None


def __getattr__(name: str) -> Any:
    file = _file_in(name)
    if file is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _MADE[file] if file in _MADE else FileBox._read(file)
