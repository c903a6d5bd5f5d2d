"""Compares the inside of a subgraph with the one that its type builds: differences in values need no second copy.

Commands and graph files name the type, and then parameters, switches and groups of nodes inside. If more than these
differ, they contain the whole inside.
"""

from __future__ import annotations

from typing import Any

import msgspec

from hfg.base.values import same
from hfg.graph.structure.edge import Edge, end_path
from hfg.graph.structure.level import Level
from hfg.graph.structure.operators import NamedOperator
from hfg.graph.structure.subgraph import is_box
from hfg.nodetypes.node import Node

__all__ = ["differ_in_values_only", "nodes_inside"]


def nodes_inside(level: Level) -> dict[str, Node]:
    """Return all nodes inside a subgraph by their paths from there."""
    prefix = f"{level.path}/"
    return {node.place.path.removeprefix(prefix): node for one in level.walk() for node in one.nodes.values()}


def differ_in_values_only(level: Level, other: Level) -> bool:
    """Return whether all differences are parameters that can be set, switches and groups."""
    if not same([_shape(one, level) for one in level.walk()], [_shape(one, other) for one in other.walk()]):
        return False
    pairs = zip(nodes_inside(level).values(), nodes_inside(other).values(), strict=True)
    return all(_differ_in_values_only(one, two) for one, two in pairs)


def _differ_in_values_only(one: Node, other: Node) -> bool:
    here, there = one._options, other._options
    if msgspec.structs.replace(there, enabled=here.enabled, group=here.group) != here:
        return False
    fixed = [name for name, spec in one._type.parameters.items() if spec.is_given and not spec.is_port]
    return all(same(one._parameters[name], other._parameters[name]) for name in fixed)


def _from(level: Level, path: str) -> str:
    """Return the rest of a path inside a subgraph, with the character before it; other paths as they are."""
    return path[len(level.path) :] if path.startswith((f"{level.path}/", f"{level.path}.")) else path


def _shape(level: Level, within: Level) -> tuple[Any, ...]:
    """Return everything else that lies at a level, as data that can be compared."""
    return (
        [(name, node._type.reference or _kind(node)) for name, node in level.nodes.items()],
        [
            (_from(within, end_path(edge.source)), _from(within, end_path(edge.target)), _said(edge))
            for edge in level.edges
        ],
        [
            (_from(within, gate.target.place.path), _from(within, gate.by.place.path), gate.idle_rate_hz)
            for gate in level.gates
        ],
        {name: [_from(within, port.path) for port in ports] for name, ports in level.promotions.by_name.items()},
    )


def _kind(node: Node) -> object:
    """Return what identifies a type without a name: a subgraph gets another one each time it is built."""
    return node._type.qualname if is_box(node) else node._type


def _said(edge: Edge) -> dict[str, Any]:
    """Return the options of an edge; operators without a name are made anew each time and count as equal."""
    said = edge.options.said()
    if "through" in said:
        said["through"] = [one if isinstance(one, NamedOperator) else None for one in said["through"]]
    return said
