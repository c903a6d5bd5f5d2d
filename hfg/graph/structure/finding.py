"""What a path leads to (rule G3): a node, a port behind a dot, the side of a subgraph's port that looks into it.

Depends on levels.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hfg.errors import GraphError
from hfg.graph.structure.level import Level, inside
from hfg.graph.structure.naming import suggest
from hfg.graph.structure.subgraph import is_box
from hfg.nodetypes.node import Node
from hfg.ports import InnerSource, InnerTarget, Port

__all__ = ["candidates", "find", "inner_side", "same_port", "split_inner"]


def find(level: Level, path: str) -> Any:  # noqa: ANN401 - of a path type checkers know nothing
    """Follow a path to a node or, behind a dot, to a port.

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
            raise GraphError(f'there is no "{path}": "{box.place.path}" is no subgraph, so nothing is inside it')
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
      GraphError: something else stands behind the port.
    """
    port, dot, side = name.partition(".")
    if side == "sent":  # the event beside an output is a port of its own
        return name, False
    if side != ("inner" if dot else ""):
        raise GraphError(f'there is no "{path}": behind a port only ".inner" may follow, behind an output ".sent"')
    return port, bool(dot)


def inner_side(node: Node, found: Sequence[Port], path: str) -> InnerSource[Any] | InnerTarget[Any]:
    """Return the side of a subgraph's port that looks into it; of several the first.

    Raises:
      GraphError: the node is no subgraph, or has no such port.
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
