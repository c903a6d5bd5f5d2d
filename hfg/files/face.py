"""Graph files, the face: load and save, and the steps between for those who need them apart.

What does the work is imported when it is needed: a program that has no graph files does not wait for YAML.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from hfg.errors import EngineInternalError, UsageError
from hfg.files.opening import SUFFIX
from hfg.graph import Graph
from hfg.graph.editing.document import Document


def load(path: str | os.PathLike[str], *, allow: Iterable[str] = ()) -> Graph:
    """Make the graph that a file describes.

    Only the modules that it names are imported, and only from hfg, packages with node types, and what is allowed here,
    not what lies beside the file (docs/howto/files.md). A node whose type is not there keeps its place, and
    `graph.check()` says so.

    Args:
      path: of a file that ends in ".hfg.yaml".
      allow: further packages whose node types may be imported.

    Raises:
      FileError: it describes no graph; `problems` holds every finding with its line, `wants` what it may not import.
    """
    from hfg.files import building

    return building.load(_path(path), _names(allow))


def save(graph: Graph, path: str | os.PathLike[str]) -> None:
    """Write a graph into a file; one that is there is replaced when the new one is whole, and not before.

    Args:
      graph: a whole graph, also while it runs.
      path: ends in ".hfg.yaml".

    Raises:
      FileError: something of it cannot be said in a file; `problems` holds every finding, and nothing was written.
      UsageError: it is the inside of a subgraph, or the file cannot be written or is called otherwise.
    """
    if not isinstance(graph, Graph):
        raise UsageError(f"save takes a graph, got {graph!r:.80}; write hfg.save(graph, 'robot{SUFFIX}')")
    file = _path(path)
    _need_suffix(file)
    write(describe(graph, beside=file), file)


def describe(graph: Graph, *, beside: str | os.PathLike[str] | None = None) -> Document:
    """Return what a file would say about a graph, as plain data.

    Args:
      graph: a whole graph.
      beside: the file that it is written to; included files are named from its folder.

    Raises:
      FileError: something of it cannot be said.
      UsageError: it is the inside of a subgraph.
    """
    from hfg.files import describing

    return describing.describe(graph, None if beside is None else _path(beside))


def build(document: Document, *, beside: str | os.PathLike[str] = ".", allow: Iterable[str] = ()) -> Graph:
    """Make the graph that a document describes.

    Args:
      document: as read, or made by hand.
      beside: the file in whose place it stands: its folder is where included files are, and modules of the project.
      allow: further packages whose node types may be imported.

    Raises:
      FileError: it describes no graph.
    """
    from hfg.files import building

    place = _path(beside)
    return building.build(document, place / f"graph{SUFFIX}" if place.is_dir() else place, _names(allow))


def read(path: str | os.PathLike[str]) -> Document:
    """Read what a file says; no node type is imported and no included file read.

    Raises:
      FileError: it is not a graph file.
    """
    from hfg.files.findings import Findings
    from hfg.files.reading import read_file

    findings = Findings()
    found = read_file(_path(path), str(path), findings)
    findings.reject(f"{path} cannot be read")
    if found is None:
        raise EngineInternalError(f"{path} was not read, and nobody said why")
    return found.document


def text_of(document: Document) -> str:
    """Return the text of a file that says this.

    Raises:
      FileError: a text cannot be read back as it is.
    """
    from hfg.files.findings import Findings
    from hfg.files.reading import read_bytes
    from hfg.files.writing import text_of as written

    text = written(document)
    findings = Findings()
    back = read_bytes(text.encode(), "what would be written", findings)
    findings.reject("the document cannot be written")
    if back is None or written(back.document) != text:  # so that nothing is lost
        raise EngineInternalError("a graph file would not say what the graph is")
    return text


def write(document: Document, path: str | os.PathLike[str]) -> None:
    """Write a document into a file, whole or not at all.

    Raises:
      FileError: a text in it cannot be written.
      UsageError: the file cannot be written or is called otherwise.
    """
    from hfg.files.writing import write_text

    file = _path(path)
    _need_suffix(file)
    text = text_of(document)
    try:
        write_text(text, file)
    except OSError as error:
        raise UsageError(f"{file} cannot be written ({error.strerror}); what was there before is as it was") from error


def schema(*, types: bool = False, allow: Iterable[str] = ()) -> str:
    """Return the JSON schema of graph files, as text.

    Args:
      types: whether it knows the installed node types with their parameters: editors complete and check these then.
      allow: packages whose node types it knows too.

    Raises:
      UsageError: a package cannot be imported.
    """
    from hfg.files.json_schema import json_schema, schema_text

    if not types and not allow:
        return schema_text(json_schema())
    from hfg.catalogue import installed, types_of
    from hfg.files.typed import with_types

    found = {one.reference: one for one in installed().types}
    for package in _names(allow):
        catalogue = types_of(package)
        if not catalogue.types and catalogue.problems:
            raise UsageError(f"{package} has no node types for the schema: {catalogue.problems[0]}")
        found |= {one.reference: one for one in catalogue.types}
    return schema_text(with_types(json_schema(), found.values()))


def _path(path: str | os.PathLike[str]) -> Path:
    try:
        return Path(path)
    except TypeError as error:
        raise UsageError(f"a graph file is named by its path, got {path!r:.80}; write 'robot{SUFFIX}'") from error


def _need_suffix(file: Path) -> None:
    if not file.name.endswith(SUFFIX) or file.name == SUFFIX:
        raise UsageError(f"{file} is no name of a graph file; call it {file.name.partition('.')[0] or 'graph'}{SUFFIX}")


def _names(allow: Iterable[str]) -> tuple[str, ...]:
    names: tuple[object, ...] = (allow,) if isinstance(allow, str) else tuple(allow)
    for name in names:
        if not isinstance(name, str) or not name:
            raise UsageError(f'allow takes names of packages, got {name!r:.80}; write allow=["my_robot"]')
    return tuple(map(str, names))
