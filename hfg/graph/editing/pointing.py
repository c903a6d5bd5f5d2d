"""What the paths in commands point at: nodes, ports of the right direction, inner sides (rule G3).

Stands on `naming` and `structure`.
"""

from __future__ import annotations

from typing import Any

from hfg.errors import GraphError
from hfg.graph.graph import Graph
from hfg.graph.structure.boxes import is_box
from hfg.graph.structure.naming import candidates, find, need_name, suggest
from hfg.nodetype import Node
from hfg.ports import ParameterPort

__all__ = ["graph_and_name", "node_at", "parameter_at", "source_at", "target_at"]

_SOURCES = ("output", "event", "parameter")
_TARGETS = ("input", "slot", "parameter")


def graph_and_name(graph: Graph, path: str) -> tuple[Graph, str]:
    """Give the graph in which a new node's path lies, and its name there.

    Raises:
      GraphError: the subgraph does not exist, or the name is not allowed.
    """
    if not isinstance(path, str):
        raise GraphError(f'a path is a text such as "fetch/go_to", got {path!r}')
    around, slash, name = path.rpartition("/")
    need_name("a node", name)
    if not slash:
        return graph, name
    box: Any = node_at(graph, around)
    if not is_box(box):
        raise GraphError(f'"{path}" cannot be: "{around}" is no subgraph, so nothing is inside it')
    return box._graph, name


def node_at(graph: Graph, path: str) -> Any:
    """Find a node.

    Raises:
      GraphError: there is none.
    """
    found = find(graph, path)
    if not isinstance(found, Node):
        raise GraphError(f'"{path}" is {found!r}, no node; name a node, as in "fetch/go_to"')
    return found


def parameter_at(graph: Graph, path: str) -> ParameterPort[Any]:
    """Find a parameter.

    Raises:
      GraphError: there is none.
    """
    node_path, name = _split(graph, path, "a parameter")
    node = node_at(graph, node_path)
    parameters: Any = node.ports.parameters
    if name not in parameters:
        raise GraphError(f'there is no "{path}": "{node_path}" has no parameter "{name}"; {suggest(name, parameters)}')
    port: ParameterPort[Any] = parameters[name]
    return port


def source_at(graph: Graph, path: str) -> Any:
    """Find where an edge may begin; direction tells an output from an input of the same name.

    Raises:
      GraphError: there is no such port.
    """
    return _end(graph, path, _SOURCES)


def target_at(graph: Graph, path: str) -> Any:
    """Find where an edge may end.

    Raises:
      GraphError: there is no such port.
    """
    return _end(graph, path, _TARGETS)


def _end(graph: Graph, path: str, kinds: tuple[str, ...]) -> Any:
    if path in (boundary := graph._boundary_ports()):
        return boundary[path]
    node_path, name = _split(graph, path, "a port")
    port, inner, rest = name.partition(".")
    if rest != ("inner" if inner else ""):
        raise GraphError(f'there is no "{path}": behind a port only ".inner" may follow')
    try:
        node = node_at(graph, node_path)
    except GraphError:
        find(graph, path)  # says the same of the whole path
        raise
    found = candidates(node, port)
    if inner:
        relays = [one for one in found if is_box(node) and one.kind not in kinds and one.kind != "parameter"]
        if relays:
            return relays[0].inner  # type: ignore[attr-defined]
        raise GraphError(f'there is no "{path}": only ports of a subgraph have a side that looks into it')
    fitting = [one for one in found if one.kind in kinds]
    if fitting or found:
        return (fitting or found)[0]  # of the wrong direction: the refusal of the edge says so
    return find(graph, path)  # says what there is


def _split(graph: Graph, path: str, what: str) -> tuple[str, str]:
    if not isinstance(path, str):
        raise GraphError(f'a path is a text such as "fetch/go_to.goal", got {path!r}')
    boxes, slash, last = path.rpartition("/")
    node, dot, port = last.partition(".")
    if not dot:
        find(graph, path)  # a path that leads nowhere says so
        raise GraphError(f'"{path}" is no {what.removeprefix("a ")}; name {what} of a node, as in "{path}.name"')
    return f"{boxes}{slash}{node}", port
