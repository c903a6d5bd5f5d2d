"""Collects what is wrong with a graph file: each finding with file, line and path in the graph. Depends on errors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias

from hfg.errors import FileError, Problem
from hfg.graph.editing.from_document import Key

Lines: TypeAlias = Mapping[Key, int]


class FileProblem(Problem, frozen=True):
    """One finding about a graph file.

    Attributes:
      file: as it was named.
      line: from 1; 0 if there is none, as for a graph that a file cannot express.
    """

    file: str = ""
    line: int = 0

    def __str__(self) -> str:
        where = f"{self.file}:{self.line}: " if self.line else f"{self.file}: " if self.file else ""
        return f"{where}{self._said()}"

    def _said(self) -> str:
        at = f'"{self.path}": ' if self.path and '"' not in self.path else f"{self.path}: " if self.path else ""
        return f"{at}{self.what}{'; ' if self.remedy else ''}{self.remedy}"


class Findings:
    """All that is found wrong while a file is read, a graph built of it, or a graph described."""

    def __init__(self) -> None:
        self.problems: list[FileProblem] = []

    def add(self, file: str, line: int, path: str, sentence: str) -> None:
        """Add a finding; its sentence ends with the remedy, after the last semicolon."""
        what, remedy = split(sentence)
        self.problems.append(
            FileProblem(
                path=path, severity="error", what=what, why="", remedy=remedy, check="graph-file", file=file, line=line
            )
        )

    def reject(self, sentence: str, wants: Iterable[str] = ()) -> None:
        """Raise if there are any.

        Args:
          sentence: what becomes of it.
          wants: modules that may not be imported.

        Raises:
          FileError: with all of them, in the order of files and lines.
        """
        if self.problems:
            files = list(dict.fromkeys(one.file for one in self.problems))
            found = sorted(dict.fromkeys(self.problems), key=lambda one: (files.index(one.file), one.line))
            raise FileError(sentence, found, tuple(wants))


def split(sentence: str) -> tuple[str, str]:
    """Take a sentence apart into what is wrong and what to do."""
    what, _, remedy = sentence.rpartition("; ")
    return (what, remedy) if what else (remedy, "")


def graph_path(key: Key, edges: Any = None) -> str:
    """Return the path in the graph of what stands at a key of a document; "" for the whole.

    Args:
      key: where.
      edges: gives the label of the edge at a key, if it is known.
    """
    nodes: list[str] = []
    rest = list(key)
    while rest[:1] == ["nodes"] and len(rest) > 1:
        nodes.append(str(rest[1]))
        rest = rest[2:]
        if rest[:1] == ["graph"]:
            rest = rest[1:]
    path = "/".join(nodes)
    match rest:
        case ["edges", int() as number, *_]:
            label = edges((*key[: key.index("edges", -len(rest))], "edges", number)) if edges else ""
            return label or (f"{path}/edges[{number}]" if path else f"edges[{number}]")
        case ["inside", str() as inner, "parameters", str() as name, *_]:
            return f"{path}/{inner}.{name}"
        case ["inside", str() as inner, *_]:
            return f"{path}/{inner}"
        case ["gate", *_]:
            return path
        case ["parameters" | "inputs" | "outputs" | "events" | "slots" | "promotes", str() as name, *_]:
            return f"{path}.{name}" if path else name
        case ["facts", int() as number, *_]:
            return f"facts[{number}]"
        case ["groups", str() as name, *_]:
            return f'group "{name}"'
        case ["monitors", str() as name, *_]:
            return f'monitor "{name}"'
        case [name, *_]:
            return f"{path}.{name}" if path else str(name)
    return path
