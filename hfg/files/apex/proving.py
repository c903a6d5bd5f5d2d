"""Builds what was converted, so that the report is about a graph that there is, not one that might be.

What is refused, a value beyond a limit or an edge between types that do not fit, becomes a part of the report and goes
to the notes. Stands on `building` and `report`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from hfg.errors import FileError
from hfg.files.apex.report import ConversionReport
from hfg.files.apex.table import rule_of
from hfg.files.building import build
from hfg.files.document import BoxDocument, Document
from hfg.files.missing import MissingNode
from hfg.graph.structure.level import level_of
from hfg.graph.structure.pointing import node_at

__all__ = ["prove"]


def prove(document: Document, report: ConversionReport, beside: Path) -> None:
    """Take out what cannot be built, and tell it.

    Raises:
      FileError: something cannot be built that is neither an edge nor a parameter.
    """
    while True:
        try:
            graph = build(document, beside)
        except FileError as error:
            taken = [_take_out(document, report, one.path, one.what) for one in error.problems]
            if not any(taken):
                raise
        else:
            break
    for told in report.nodes:
        node = node_at(level_of(graph), told.target)
        if isinstance(node, MissingNode) and told.state != "missing":
            told.lost(node._type.doc)  # that of a package which is not installed


def _take_out(document: Document, report: ConversionReport, path: str, what: str) -> bool:
    found = False
    for prefix, box in _boxes(document, ""):
        for edge in list(box.edges):
            if f"{edge.source} -> {edge.target}" == path:
                box.edges.remove(edge)
                found = True
                for one in report.connections:
                    if one.target == f"{prefix}{path}":
                        one.lost(what)
                        document.notes.setdefault("csapex connections", []).append(one.source)
        for name, node in box.nodes.items():
            parameter = path.removeprefix(f"{prefix}{name}.")
            if parameter in node.parameters and parameter != path:
                value = node.parameters.pop(parameter)
                found = True
                for one in report.nodes:
                    if one.target == f"{prefix}{name}":
                        there = _name_there(one.kind, parameter)
                        node.notes.setdefault("csapex", {})[there] = value
                        one.differs(f'its parameter "{there}" stays as usual, for {what}')
    return found


def _name_there(kind: str, parameter: str) -> str:
    rule = rule_of(kind)
    names = () if rule is None else rule.parameters
    return next((name for name in names if rule and (goes := rule.parameter(name)) and goes.to == parameter), parameter)


def _boxes(box: BoxDocument, prefix: str) -> Iterator[tuple[str, BoxDocument]]:
    yield prefix, box
    for name, node in box.nodes.items():
        if node.graph is not None:
            yield from _boxes(node.graph, f"{prefix}{name}/")
