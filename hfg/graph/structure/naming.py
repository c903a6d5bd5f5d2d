"""Names and paths: which names a node may have, what a path leads to, and what was probably meant (rule G3).

A path is "subgraph/node" or "subgraph/node.port". Stands on errors; looks at nodes and graphs, changes neither.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from typing import Any

from hfg.errors import GraphError
from hfg.graph.structure.boxes import is_box
from hfg.ports import Port

__all__ = ["candidates", "default_name", "find", "need_name", "path_of", "suggest"]


def need_name(what: str, name: object) -> str:
    """Refuse what cannot be part of a path; `what` begins the message.

    Raises:
      GraphError: it is no text, empty, or holds one of the two characters that paths are made of.
    """
    if not isinstance(name, str) or not name:
        raise GraphError(f"{what} needs a name that is a text and not empty, got {name!r}")
    for character in "/.":
        if character in name:
            better = name.replace("/", "_").replace(".", "_")
            raise GraphError(
                f'{what} cannot be named "{name}": "{character}" separates the parts of a path; use "{better}"'
            )
    return name


def default_name(base: str, counts: Mapping[str, int], taken: Mapping[str, Any]) -> tuple[str, int]:
    """Give the type's name, or with _2, _3 in order of adding.

    With it comes how many have it then, which the caller keeps once the node is in.
    """
    number = counts.get(base, 0) + 1
    name = base if number == 1 else f"{base}_{number}"
    while name in taken:  # somebody gave this name by hand
        number += 1
        name = f"{base}_{number}"
    return name, number


def suggest(name: str, known: Iterable[str]) -> str:
    """End a message about an unknown name: what was probably meant, else what there is."""
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    if near:
        return f'did you mean "{near[0]}"?'
    if not names:
        return "there are none"
    shown = ", ".join(f'"{one}"' for one in names[:8])
    return f"there are {shown}" + (f" and {len(names) - 8} more" if len(names) > 8 else "")


def find(graph: Any, path: str) -> Any:
    """Follow a path to a node or, behind a dot, to a port.

    Raises:
      GraphError: some part of it does not exist; the message names the first such part and what was probably meant.
    """
    if not isinstance(path, str):
        raise GraphError(f'a path is a text such as "fetch/go_to.goal", got {path!r}')
    *boxes, last = path.split("/")
    around = graph
    for name in boxes:
        box = _node(around, name, path)
        if not is_box(box):
            raise GraphError(f'there is no "{path}": "{box._place.path}" is no subgraph, so nothing is inside it')
        around = box._graph
    name, dot, port = last.partition(".")
    if not dot:
        boundary = around._boundary_ports() if not boxes and name not in around.nodes else {}
        return boundary[name] if name in boundary else _node(around, name, path)
    return _port(_node(around, name, path), port, path)


def _node(graph: Any, name: str, path: str) -> Any:
    node = graph.nodes.get(name)
    if node is None:
        inside = f'"{graph.path}"' if graph.path else f'graph "{graph.name}"'
        raise GraphError(f'there is no "{path}": {inside} has no node "{name}"; {suggest(name, graph.nodes)}')
    return node


def _port(node: Any, name: str, path: str) -> Port:
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


def candidates(node: Any, name: str) -> list[Port]:
    """Give all ports of a node that have this name; automatic ones too."""
    found: list[Port] = []
    for ports in (node.ports.inputs, node.ports.outputs, node.ports.events, node.ports.slots, node.ports.parameters):
        try:
            found.append(ports[name])
        except KeyError:
            continue
    return found


def path_of(node: Any) -> str:
    """Give the path of a node, for messages; before it is added, its type's name stands for it."""
    name: str = node._type.name if node._place is None else node._place.path
    return name
