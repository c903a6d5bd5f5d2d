"""What paths point at where a certain thing is meant: nodes, ports of the right direction, inner sides (rule G3).

A path stands wherever the thing itself could be given, in calls as in commands. Depends on `finding`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hfg.errors import GraphError
from hfg.graph.structure.edge import PortEnd
from hfg.graph.structure.finding import candidates, find, inner_side, split_inner
from hfg.graph.structure.level import Level, inside
from hfg.graph.structure.naming import need_name, suggest
from hfg.nodetypes.node import Node
from hfg.ports import ParameterPort

__all__ = ["level_and_name", "meant", "node_at", "parameter_at", "source_at", "target_at"]

_SOURCES = ("output", "event", "parameter")
_TARGETS = ("input", "slot", "parameter")


def level_and_name(level: Level, path: str) -> tuple[Level, str]:
    """Return the level at which a new node's path lies, and its name there.

    Raises:
      GraphError: the subgraph does not exist, or the name is not allowed.
    """
    if not isinstance(path, str):
        raise GraphError(f'a path is a text such as "fetch/go_to", got {path!r}')
    around, slash, name = path.rpartition("/")
    need_name("a node", name)
    if not slash:
        return level, name
    inner = inside(node_at(level, around))
    if inner is None:
        raise GraphError(f'"{path}" cannot be: "{around}" is no subgraph, so nothing is inside it')
    return inner, name


def meant(level: Level, what: Any, at: Callable[[Level, str], Any]) -> Any:  # noqa: ANN401 - whatever `at` finds
    """Return what was named by its path, or is given itself.

    Args:
      level: from where the path leads.
      what: a path, or anything else, which is given back as it is.
      at: what finds it, `node_at` or another of these.

    Raises:
      GraphError: the path leads nowhere.
    """
    return at(level, what) if isinstance(what, str) else what


def node_at(level: Level, path: str) -> Node:
    """Find a node.

    Raises:
      GraphError: there is none.
    """
    found = find(level, path)
    if not isinstance(found, Node):
        raise GraphError(f'"{path}" is {found!r}, no node; name a node, as in "fetch/go_to"')
    return found


def parameter_at(level: Level, path: str) -> ParameterPort[Any]:
    """Find a parameter.

    Raises:
      GraphError: there is none.
    """
    node_path, name = _split(level, path, "a parameter")
    node = node_at(level, node_path)
    parameters = node.ports.parameters
    if name not in parameters:
        raise GraphError(f'there is no "{path}": "{node_path}" has no parameter "{name}"; {suggest(name, parameters)}')
    return parameters[name]


def source_at(level: Level, path: str) -> PortEnd:
    """Find where an edge may begin; direction tells an output from an input of the same name.

    Raises:
      GraphError: there is no such port.
    """
    return _end(level, path, _SOURCES)


def target_at(level: Level, path: str) -> PortEnd:
    """Find where an edge may end.

    Raises:
      GraphError: there is no such port.
    """
    return _end(level, path, _TARGETS)


def _end(level: Level, path: str, kinds: tuple[str, ...]) -> PortEnd:
    if path in (boundary := level.ports.by_name()):
        return boundary[path]
    node_path, name = _split(level, path, "a port")
    port, inner = split_inner(name, path)
    try:
        node = node_at(level, node_path)
    except GraphError:
        try:
            find(level, path)  # says the same of the whole path
        except GraphError as whole:
            raise whole from None
        raise
    found = candidates(node, port)
    if inner:
        return inner_side(node, [one for one in found if one.kind not in kinds], path)
    fitting = [one for one in found if one.kind in kinds]
    if fitting or found:
        return (fitting or found)[0]  # of the wrong direction: the refusal of the edge says so
    nothing: PortEnd = find(level, path)  # says what there is instead
    return nothing


def _split(level: Level, path: str, what: str) -> tuple[str, str]:
    if not isinstance(path, str):
        raise GraphError(f'a path is a text such as "fetch/go_to.goal", got {path!r}')
    boxes, slash, last = path.rpartition("/")
    node, dot, port = last.partition(".")
    if not dot:
        find(level, path)  # a path that leads nowhere says so
        raise GraphError(f'"{path}" is no {what.removeprefix("a ")}; name {what} of a node, as in "{path}.name"')
    return f"{boxes}{slash}{node}", port
