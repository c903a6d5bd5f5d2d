"""What a path leads to (rule G3): "subgraph/node" a node, "subgraph/node.port" a port. Stands on levels."""

from __future__ import annotations

from typing import Any

from hfg.errors import GraphError
from hfg.graph.structure.level import Level
from hfg.graph.structure.naming import suggest
from hfg.graph.structure.subgraph import inside
from hfg.nodetype import Node
from hfg.ports import Port

__all__ = ["candidates", "find", "same_port"]


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


def _port(node: Node, name: str, path: str) -> Port:
    found = candidates(node, name)
    if len(found) == 1:
        return found[0]
    if found:
        ways = " or ".join(f'node.ports.{port.kind}s["{name}"]' for port in found)
        raise GraphError(
            f'"{path}" is ambiguous: "{node.place.path}" has an {" and an ".join(port.kind for port in found)} of '
            f"this name; write {ways}"
        )
    kind = node._type
    known = [*kind.inputs, *kind.outputs, *kind.events, *kind.slots, *kind.parameters]
    raise GraphError(
        f'there is no "{path}": "{node.place.path}" has no port "{name}"; {suggest(name, dict.fromkeys(known))}'
    )


def candidates(node: Node, name: str) -> list[Port]:
    """Give all ports of a node that have this name; automatic ones too."""
    found: list[Port] = []
    for ports in (node.ports.inputs, node.ports.outputs, node.ports.events, node.ports.slots, node.ports.parameters):
        try:
            found.append(ports[name])
        except KeyError:
            continue
    return found


def same_port(node: Node, like: Port) -> Port:
    """Give the port of a node that has the kind and name of another's.

    Raises:
      UsageError: it has none.
    """
    port: Port = getattr(node.ports, f"{like.kind}s")[like.name]
    return port
