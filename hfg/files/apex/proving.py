"""Builds what was converted, so that the report is about a graph that there is, not one that might be.

What is refused, a value beyond a limit or an edge between types that do not fit, becomes a part of the report and goes
to the notes. Depends on `building` and `report`.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from hfg.errors import FileError
from hfg.files.apex.report import ConversionReport
from hfg.files.apex.table import rule_of
from hfg.files.building import build
from hfg.files.missing import MissingNode
from hfg.graph import Graph
from hfg.graph.editing.document import BoxDocument, Document, EdgeDocument, NodeDocument
from hfg.graph.structure.level import level_of
from hfg.graph.structure.paths import node_at
from hfg.nodetypes.node import Node

_BARE: Final = ("activated", "deactivated", "processed", "failed", "timeout")


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
    if _give_signals_values(document, report, graph):
        build(document, beside)
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


def _give_signals_values(document: Document, report: ConversionReport, graph: Graph) -> bool:
    """Make values of signals that go into inputs, and say whether there were any.

    In CS::APEX such a token carries a message without content, and a node passes it on like any other. A signal without
    a value cannot be passed on here: the nodes after this one would be silent.
    """
    found = False
    for prefix, box in _boxes(document, ""):
        for edge in [one for one in box.edges if _is_bare(graph, prefix, one)]:
            name = _unused(f"{edge.source.replace('.', '_')}_as_value", box.nodes)
            box.nodes[name] = NodeDocument(type="hfg.nodes.values:BoolOnTrigger", parameters={"value": True})
            place = box.edges.index(edge)
            box.edges[place : place + 1] = [
                EdgeDocument(edge.source, f"{name}.trigger", active=edge.active),
                EdgeDocument(f"{name}.given", edge.target, active=edge.active),
            ]
            found = True
            for one in report.connections:
                if one.target == f"{prefix}{edge.source} -> {edge.target}":
                    one.differs(f'the signal has no value, so "{name}" makes the value true of it')
    return found


def _is_bare(graph: Graph, prefix: str, edge: EdgeDocument) -> bool:
    """Return whether a signal without a value goes into an input."""
    name, _, port = edge.source.rpartition(".")
    target, _, into = edge.target.rpartition(".")
    if not target:
        return False
    level = level_of(graph)
    node = node_at(level, f"{prefix}{target}")
    if isinstance(node, MissingNode) or not _takes(node, into):
        return False
    if not name:
        return port == "start" and not prefix
    source = node_at(level, f"{prefix}{name}")
    events = source._type.events
    if isinstance(source, MissingNode) or port in source._type.outputs:
        return False
    return port in _BARE or (port in events and events[port].type is None)


def _takes(node: Node, port: str) -> bool:
    return any(port in (name, spec.name) for name, spec in node._type.inputs.items())


def _unused(name: str, taken: Any) -> str:
    return next(one for number in itertools.count() if (one := name if not number else f"{name}_{number}") not in taken)


def _name_there(kind: str, parameter: str) -> str:
    rule = rule_of(kind)
    names = () if rule is None else rule.parameters
    return next((name for name in names if rule and (goes := rule.parameter(name)) and goes.to == parameter), parameter)


def _boxes(box: BoxDocument, prefix: str) -> Iterator[tuple[str, BoxDocument]]:
    yield prefix, box
    for name, node in box.nodes.items():
        if node.graph is not None:
            yield from _boxes(node.graph, f"{prefix}{name}/")
