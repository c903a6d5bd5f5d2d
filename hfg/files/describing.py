"""Makes the document of a graph file, and finds everything that cannot be stored before anything is written.

A subgraph that a file describes is represented by that file, and a node whose type is missing by what its file said.
"""

from __future__ import annotations

import os
from pathlib import Path

from typing_extensions import override

from hfg.errors import UsageError
from hfg.files.allowed import project_of
from hfg.files.boxes import FileBox
from hfg.files.findings import Findings
from hfg.files.missing import MissingNode
from hfg.graph.editing.document import Document, NodeDocument
from hfg.graph.editing.to_document import Describer
from hfg.graph.graph import Graph
from hfg.graph.structure.level import Level, inside, level_of
from hfg.nodetypes.node import Node


def describe(graph: Graph, beside: Path | None = None, *, same_program: bool = False) -> Document:
    """Make a document of a whole graph.

    Args:
      graph: the graph; it may be running.
      beside: the file that the document is written to; names of included files are relative to its folder.
      same_program: the document is for another process of the same program, which has its types, too.

    Raises:
      FileError: part of the graph cannot be stored; `problems` lists everything.
      UsageError: the graph is the inside of a subgraph.
    """
    level = level_of(graph)
    if level.owner is not None:
        raise UsageError(
            f'{level.title} is saved with the whole graph: save graph "{level.whole.root.name}", or describe the '
            "subgraph in a file of its own"
        )
    describer = _Describer(level, beside, same_program)
    document = describer.document()
    describer.findings.reject(f'graph "{graph.name}" cannot be stored in a file')
    return document


class _Describer(Describer):
    def __init__(self, root: Level, beside: Path | None, same_program: bool) -> None:
        super().__init__(root)
        self.same_program = same_program
        self.beside = None if beside is None else beside.resolve()
        self.findings = Findings()

    @override
    def wrong(self, what: str, path: str, sentence: str) -> None:
        self.findings.add("", 0, path, sentence)

    @override
    def reference(self, node: Node) -> str:
        reference = super().reference(node)
        if reference.startswith(("__main__:", "hfg_target_")) and not self.same_program:
            self.findings.add(
                "",
                0,
                node.place.path,
                f"its type {node._type.qualname} is in the program itself, where no other program finds it; move it to "
                "a module whose name no other module has",
            )
        return reference

    @override
    def kind(self, node: Node) -> NodeDocument:
        if isinstance(node, MissingNode):
            said = node._said
            return NodeDocument(said.type, parameters=said.parameters, inside=said.inside, graph=said.graph)
        within = inside(node)
        if not isinstance(node, FileBox) or within is None:
            return super().kind(node)
        box = NodeDocument(parameters=self.parameters(node))
        differences = self.differences(node, within)
        if differences is None:
            self.replace_inside(node, within, box)
        else:
            box.file, box.inside = self._file(node), differences
        return box

    def _file(self, node: FileBox) -> str:
        """Return the name of a subgraph's file, relative to the file that is written."""
        file = node._file
        if self.beside is None:
            return str(file)
        project = project_of(self.beside)
        if not file.is_relative_to(project):
            self.findings.add(
                "",
                0,
                node.place.path,
                f"its file {file} is outside of the project {project}, so a file there cannot include it; save beside "
                "it, or copy it there",
            )
        return Path(os.path.relpath(file, self.beside.parent)).as_posix()
