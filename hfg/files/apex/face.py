"""Files of CS::APEX, the face."""

from __future__ import annotations

import os
from pathlib import Path

from hfg.errors import EngineInternalError
from hfg.files.apex.report import ConversionReport
from hfg.graph import Graph
from hfg.graph.editing.document import Document


def read(path: str | os.PathLike[str]) -> tuple[Document, ConversionReport]:
    """Read a file of CS::APEX as what a graph file would say, and tell what became of each node and connection.

    A type that there is nothing for keeps its place with its data: the graph can be looked at and saved, but not run.

    Args:
      path: of a file that ends in ".apex", or of a snippet, ".apexs".

    Raises:
      FileError: it is no such file, or contradicts itself; `problems` holds every finding with its line.
    """
    from hfg.files.apex.converting import convert
    from hfg.files.apex.proving import prove
    from hfg.files.apex.reading import read_file
    from hfg.files.findings import Findings

    file, findings = Path(path), Findings()
    found = read_file(file, str(path), findings)
    converted = None if found is None else convert(found, str(path), findings)
    findings.reject(f"{path} cannot be read")
    if converted is None:
        raise EngineInternalError(f"{path} was not read, and nobody said why")
    document, report = converted
    prove(document, report, file)
    return document, report


def load(path: str | os.PathLike[str]) -> Graph:
    """Make the graph that a file of CS::APEX describes; `read` tells in what it differs.

    Raises:
      FileError: it describes no graph.
    """
    from hfg.files.building import build

    return build(read(path)[0], Path(path))
