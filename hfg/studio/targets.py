"""Where an edge may lead that begins at a port, or where from: with the reason, before the user drops it.

The code that connects (`graph.structure.connecting`) decides, for every port of the level; nothing of it is repeated
here. Depends on the graph.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, Literal, TypeAlias

from hfg.errors import ConnectionError as EdgeRefused
from hfg.errors import GraphError
from hfg.graph import Graph
from hfg.graph.structure.connecting import refuse
from hfg.graph.structure.edge import Edge, PortEnd, end_path, is_port, type_of
from hfg.graph.structure.level import Level, inside, level_of
from hfg.graph.structure.options import PLAIN
from hfg.graph.structure.paths import source_at, target_at
from hfg.nodetypes.node import Node
from hfg.ports import InnerSource, InnerTarget, Port
from hfg.studio.refusing import parts_of
from hfg.types import describe

__all__ = ["Fit", "end_of", "ends_of", "fit_of", "targets"]

Fit: TypeAlias = Literal["expects", "takes", "refused"]
_ANY: Final = (Any, object)


def targets(graph: Graph, port: str, moving: str = "") -> dict[str, Any]:
    """Say of each port of the same level whether an edge may join it to this one: once for all that are alike.

    A reason has {port} for the name of the port, and {from} for where the edge comes from that it has.

    Args:
      graph: a whole graph.
      port: where an edge begins, or ends.
      moving: key of an edge that is being moved, and so is not in the way.

    Raises:
      GraphError: there is no such port.
    """
    fixed, begins, level = end_of(graph, port)
    moved = next((edge for edge in level.edges if edge.label == moving), None)
    found: dict[tuple[tuple[str, str], ...], list[str]] = {}  # hundreds of ports, few reasons
    for other in ends_of(level, sources=not begins):
        if _owner(other) is _owner(fixed) and other is fixed:
            continue
        source, target = (fixed, other) if begins else (other, fixed)
        judged = _judged(level, source, target, moved)
        found.setdefault(tuple((name, _of_any(said, level, other)) for name, said in judged.items()), []).append(
            other.path
        )
    fits: list[dict[str, Any]] = [{**dict(judged), "ports": ports} for judged, ports in found.items()]
    counts = {
        name: sum(len(one["ports"]) for one in fits if one["fit"] == name) for name in ("expects", "takes", "refused")
    }
    return {"sends" if begins else "expects": _text(fixed), "counts": counts, "fits": fits}


def _of_any(said: str, level: Level, port: PortEnd) -> str:
    """Say it of any port: with {port} for its name, and {from} for where its edge comes from."""
    before = level.connections.into.get(port)
    if before is not None:
        said = said.replace(f'"{end_path(before.source)}"', "{from}")
    return said.replace(f'"{port.path}"', "{port}")


def end_of(graph: Graph, path: str) -> tuple[PortEnd, bool, Level]:
    """Find an end of edges; also say whether edges begin there, and at which level they lie.

    Raises:
      GraphError: there is no such port.
    """
    root = level_of(graph)
    try:
        end, begins = source_at(root, path), True
        if not _is_source(end):
            end, begins = target_at(root, path), False
    except GraphError:
        end, begins = target_at(root, path), False
    home = end.graph
    if home is None:
        raise GraphError(f'"{path}" belongs to no graph')
    return end, begins, level_of(home)


def _is_source(end: PortEnd) -> bool:
    return isinstance(end, InnerSource) or (isinstance(end, Port) and end.kind in ("output", "event", "parameter"))


def _judged(level: Level, source: PortEnd, target: PortEnd, moved: Edge | None) -> dict[str, str]:
    try:
        refuse(level, source, target, PLAIN)
        in_the_way = level.connections.into.get(target)
        if moved is None or in_the_way is not moved:
            level.connections.refuse_second(source, target)
    except EdgeRefused as error:
        return {"fit": "refused", **{name: said for name, said in parts_of(error).items() if name != "path"}}
    return {"fit": fit_of(type_of(target)), "expected": describe(type_of(target))}


def fit_of(hint: object) -> Fit:
    """Say how well what fits does fit: what takes anything says nothing about it."""
    return "takes" if hint in _ANY else "expects"


def _owner(end: PortEnd) -> object:
    return end.node


def _text(end: PortEnd) -> str:
    return describe(type_of(end)) if end.type is not None else ""


def ends_of(level: Level, *, sources: bool) -> Iterator[PortEnd]:
    """Yield all ends of a level at which edges begin, or end; automatic ports only if an edge uses them."""
    for node in level.nodes.values():
        yield from _ends_of_node(node, sources=sources)
    if level.owner is not None:
        ports = level.owner.ports
        for port in (*ports.inputs.values(), *ports.slots.values()) if sources else ():
            yield port.inner  # type: ignore[attr-defined]  # of relays
        for port in (*ports.outputs.values(), *ports.events.values()) if not sources else ():
            yield port.inner  # type: ignore[attr-defined]
    else:
        yield from level.ports.inputs.values() if sources else level.ports.outputs.values()
    yield from (level.ports.start,) if sources else (level.ports.stop, level.ports.abort)
    seen = {edge.source if sources else edge.target for edge in level.edges}
    yield from (end for end in seen if is_port(end) and _is_automatic(end))


def _ends_of_node(node: Node, *, sources: bool) -> Iterator[Port]:
    ports = node.ports
    if sources:
        yield from ports.outputs.values()
        yield from ports.events.values()
    else:
        yield from ports.inputs.values()
        yield from ports.slots.values()
    yield from ports.parameters.values()


def _is_automatic(end: PortEnd) -> bool:
    if isinstance(end, InnerSource | InnerTarget) or not isinstance(end.node, Node):
        return False
    kind = end.node._type
    declared = {"event": kind.events, "slot": kind.slots}.get(end.kind)
    return declared is not None and end.name not in declared and inside(end.node) is None
