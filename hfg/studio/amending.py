"""The graph as the text of a graph file, and edits of that text as commands.

Both texts become graphs, whose difference is carried out on the graph as it is by then: what others have edited in the
meantime stays. Depends on the graph's files.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from hfg.files.building import build_text
from hfg.files.describing import describe
from hfg.files.writing import text_of
from hfg.graph import Graph
from hfg.graph.editing.differing import difference
from hfg.graph.structure.level import level_of
from hfg.studio.project import Project

__all__ = ["amended", "text_of_graph"]


def text_of_graph(project: Project) -> dict[str, str]:
    """Return the graph as the text of a graph file, and the name of that file.

    Raises:
      FileError: part of it cannot be stored in a file.
    """
    return {"name": _file(project).name, "text": text_of(describe(project.graph, _file(project), same_program=True))}


def amended(project: Project, before: str, after: str) -> dict[str, Any]:
    """Return the commands for what differs between two texts of the graph.

    Raises:
      FileError: a text is not a graph file; the message names the lines.
      GraphError: no command makes this difference.
    """
    allow = [*project.allow, *_modules(project.graph)]
    file = _file(project)
    one, other = (level_of(build_text(text, file, allow)) for text in (before, after))
    return {"commands": msgspec.to_builtins(difference(one, other))}


def _file(project: Project) -> Path:
    return project.folder / (project.record().path or f"{project.graph.name}.hfg.yaml")


def _modules(graph: Graph) -> set[str]:
    """Return the packages that the graph has imported anyway."""
    kinds = {node._type.module for level in level_of(graph).walk() for node in level.nodes.values()}
    return {module.partition(".")[0] for module in kinds}
