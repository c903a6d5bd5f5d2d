"""Paths (rule G3): finds the nodes, ports and inner sides that they name, in calls as in commands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from hfg.errors import GraphError
from hfg.graph.structure.edge import PortEnd
from hfg.graph.structure.level import Level, inside
from hfg.graph.structure.naming import need_name, suggest
from hfg.graph.structure.subgraph import is_box
from hfg.nodetypes.node import Node
from hfg.ports import InnerSource, InnerTarget, ParameterPort, Port


def find(level: Level, path: str) -> Any:  # noqa: ANN401 - of a path type checkers know nothing
    """Follow a path to a node or, after a dot, to a port.

    Raises:
      GraphError: some part of it does not exist; the message names the first such part and what was probably meant.
    """
    if not isinstance(path, str):
        raise GraphError(f'a path is a text such as "fetch/go_to.goal", got {path!r}')
    *boxes, last = path.split("/")
    around = level
    for name in boxes:
        box = _node(around, name, path)
        within = inside(box)
        if within is None:
            raise GraphError(f'there is no "{path}": "{box.place.path}" is not a subgraph, so nothing is inside it')
        around = within
    name, dot, port = last.partition(".")
    if not dot:
        boundary = around.ports.by_name() if not boxes and name not in around.nodes else {}
        return boundary[name] if name in boundary else _node(around, name, path)
    return _port(_node(around, name, path), port, path)


def _node(level: Level, name: str, path: str) -> Node:
    node = level.nodes.get(name)
    if node is None:
        where = f'"{level.path}"' if level.path else f'graph "{level.name}"'
        raise GraphError(f'there is no "{path}": {where} has no node "{name}"; {suggest(name, level.nodes)}')
    return node


def split_inner(name: str, path: str) -> tuple[str, bool]:
    """Take ".inner" off the name of a port, and say whether it was there.

    Raises:
      GraphError: something else follows the port.
    """
    port, dot, side = name.partition(".")
    if side == "sent":  # the event of an output is a port of its own
        return name, False
    if side != ("inner" if dot else ""):
        raise GraphError(f'there is no "{path}": only ".inner" may follow a port, and ".sent" an output')
    return port, bool(dot)


def inner_side(node: Node, found: Sequence[Port], path: str) -> InnerSource[Any] | InnerTarget[Any]:
    """Return the side of a subgraph's port that looks into it; of several the first.

    Raises:
      GraphError: the node is not a subgraph, or has no such port.
    """
    relays = [one for one in found if is_box(node) and one.kind != "parameter"]
    if relays:
        side: InnerSource[Any] | InnerTarget[Any] = relays[0].inner  # type: ignore[attr-defined]  # all these have one
        return side
    if is_box(node) and not found:
        raise _no_such_port(node, path.removesuffix(".inner").rpartition(".")[2], path)
    raise GraphError(
        f'there is no "{path}": inputs, outputs, events and slots of a subgraph have a side that looks into it, and no '
        "other ports; leave out .inner"
    )


def _port(node: Node, name: str, path: str) -> Port | InnerSource[Any] | InnerTarget[Any]:
    name, inner = split_inner(name, path)
    found = candidates(node, name)
    if inner and len(found) < 2:
        return inner_side(node, found, path)
    if len(found) == 1:
        return found[0]
    if found:
        ways = " or ".join(f'node.ports.{port.kind}s["{name}"]' for port in found)
        raise GraphError(
            f'"{path}" is ambiguous: "{node.place.path}" has an {" and an ".join(port.kind for port in found)} of '
            f"this name; write {ways}"
        )
    raise _no_such_port(node, name, path)


def _no_such_port(node: Node, name: str, path: str) -> GraphError:
    kind = node._type
    if name in kind.vectors:
        vector = kind.vectors[name]
        return GraphError(
            f'"{path}" is a vector of {vector.size} {vector.kind}s; name one of them, as in "{path}[0]", or all by '
            f"node.{name}"
        )
    values = [one for one, spec in kind.parameters.items() if not spec.size]
    known = [*kind.inputs, *kind.outputs, *kind.events, *kind.slots, *values]
    return GraphError(
        f'there is no "{path}": "{node.place.path}" has no port "{name}"; {suggest(name, dict.fromkeys(known))}'
    )


def candidates(node: Node, name: str) -> list[Port]:
    """Return all ports of a node that have this name; automatic ones too."""
    found: list[Port] = []
    for ports in (node.ports.inputs, node.ports.outputs, node.ports.events, node.ports.slots, node.ports.parameters):
        try:
            found.append(ports[name])
        except KeyError:
            continue
    return found


def same_port(node: Node, like: Port) -> Port:
    """Return the port of a node that has the kind and name of another's.

    Raises:
      UsageError: it has none.
    """
    port: Port = getattr(node.ports, f"{like.kind}s")[like.name]
    return port


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
        raise GraphError(f'"{path}" cannot be: "{around}" is not a subgraph, so nothing is inside it')
    return inner, name


def meant(level: Level, what: Any, at: Callable[[Level, str], Any]) -> Any:  # noqa: ANN401 - whatever `at` finds
    """Return what was named by its path, or is given itself.

    Args:
      level: from where the path leads.
      what: a path, or anything else, which is returned as it is.
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
