"""Setting a gate, and every reason to refuse one (rule A11). Depends on levels."""

from __future__ import annotations

from hfg.errors import GraphError
from hfg.graph.structure.gates import Gate
from hfg.graph.structure.level import Level
from hfg.graph.structure.naming import path_of
from hfg.graph.structure.pointing import meant, node_at
from hfg.graph.structure.refusals import Refusable
from hfg.nodetypes.node import Node

__all__ = ["refuse_gate", "set_gate"]


def set_gate(level: Level, target: Node | str, by: Node | str | None, idle_rate_hz: float | None) -> Gate:
    """Couple the work of a node to the activity of another; either may be given by its path.

    Raises:
      GraphError: it cannot be; nothing was changed.
    """
    level.need_rest("gating")
    gate = Gate(target, by, idle_rate_hz)  # type: ignore[arg-type]  # what else it is, is refused
    with Refusable(target):
        gate = Gate(meant(level, target, node_at), meant(level, by, node_at), idle_rate_hz)
        refuse_gate(level, gate)
        level.gates.append(gate)
    return gate


def refuse_gate(level: Level, gate: Gate) -> None:
    """Raise if the gate cannot be; changes nothing.

    Raises:
      GraphError: what is given is no node of this graph, or is gated already; or the rate is none.
    """
    for node in (gate.target, gate.by):
        if not isinstance(node, Node):
            raise GraphError(
                f"a gate couples nodes, got {node!r}; give nodes or their paths, as in graph.gate(detector, by=fetch)"
            )
        if not level.holds(node):
            raise GraphError(
                f'a gate couples nodes of one graph, but "{path_of(node)}" is not in {level.title}; add it first'
            )
    name, rate = path_of(gate.target), gate.idle_rate_hz
    if gate.target in level.whole.gated:
        raise GraphError(f'"{name}" has a gate already; put what both gates mean into one state node or subgraph')
    is_number = isinstance(rate, int | float) and type(rate) is not bool
    if rate is not None and not (is_number and rate > 0):
        raise GraphError(f'the gate of "{name}": idle_rate_hz must be a number above 0, or None to rest, got {rate!r}')
