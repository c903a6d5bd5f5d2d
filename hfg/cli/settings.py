"""`--param path=value`: finds the parameter, reads the value by its declared type and sets it.

Depends on the graph floor.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable
from typing import Any

from hfg.errors import EncodingError, GraphError, TargetError
from hfg.graph import Graph
from hfg.ports import ParameterPort


def set_parameters(graph: Graph, settings: Iterable[str]) -> None:
    """Set parameters of a graph's nodes before it runs.

    Args:
      graph: whose nodes have the parameters.
      settings: "path/of/node.parameter=value" each; a text needs no quotes where the parameter is a text.

    Raises:
      TargetError: there is no such node or parameter, or the value does not fit it.
    """
    for setting in settings:
        path, equals, text = setting.partition("=")
        place, dot, name = path.strip().rpartition(".")
        if not equals or not dot or not place or not name:
            raise TargetError(f'--param "{setting}" sets nothing: write --param node.parameter=value')
        node = _node(graph, place)
        ports = node.ports.parameters
        if name not in ports and not node._type.is_there:
            raise TargetError(
                f'parameter "{place}.{name}" cannot be set: the type "{node._type.reference}" is not there; hfg check '
                "says why"
            )
        if name not in ports:
            there = ", ".join(ports) or "none"
            raise TargetError(f'node "{place}" has no parameter "{name}"; it has {there}')
        _set(ports[name], f"{place}.{name}", text)


def _node(graph: Graph, path: str) -> Any:
    try:
        found = graph[path]
    except (GraphError, LookupError):
        found = None
    if found is None or not hasattr(found, "ports"):
        raise TargetError(f'graph "{graph.name}" has no node "{path}"; it has {", ".join(graph.nodes) or "none"}')
    return found


def _set(port: ParameterPort[Any], path: str, text: str) -> None:
    try:
        value = port.spec.read_text(text)
    except EncodingError as error:
        wrong = port.spec.check(_literal(text))
        raise TargetError(str(error) if wrong is None else f'parameter "{path}" {wrong}') from None
    complaint = port.spec.check(value)
    if complaint is not None:
        raise TargetError(f'parameter "{path}" {complaint}')
    try:
        port.value = value
    except ValueError as error:  # only its node sets it, or one inside a subgraph refuses
        raise TargetError(str(error)) from error


def _literal(text: str) -> Any:
    """Return the value that the string looks like, for a message."""
    try:
        return ast.literal_eval(text.strip())
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return text
