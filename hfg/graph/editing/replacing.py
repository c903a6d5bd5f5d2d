"""Puts a node of another type in the place of a node: name, options, edges, gates, facts and notes stay (rule R4).

Depends on `steps`.
"""

from __future__ import annotations

from typing import Any

from hfg.errors import GraphError, HfgError
from hfg.graph.editing.changes import EdgeChange, EdgeSwap, FactsMoved, GateChange, NodeChange, NodeSwap
from hfg.graph.editing.steps import Promoted, Steps, edges_of
from hfg.graph.structure.adding import add, need_fitting
from hfg.graph.structure.declaring import refuse_standing
from hfg.graph.structure.edge import Edge, SourceEnd
from hfg.graph.structure.gates import Gate
from hfg.graph.structure.level import Level, level_of
from hfg.graph.structure.paths import same_port
from hfg.graph.structure.subgraph import is_box
from hfg.nodetypes.node import Node
from hfg.ports import Port


def replace(steps: Steps, old: Node, new: Node) -> list[tuple[Level, Edge]]:
    """Replace a node by one that is in no graph yet.

    Returns:
      Its edges, to be checked when all commands have been carried out: the node at their other end may be replaced by
      a later command of the same edit, and only then do their types match.

    Raises:
      GraphError: the new node lacks a port that is in use, or cannot have the options.
    """
    around = level_of(old.place.graph)
    edges = edges_of(around, old)
    others = [Edge(_port_of(one.source, old, new), _port_of(one.target, old, new), one.options) for one in edges]
    if is_box(old) or is_box(new):
        _replace_box(steps, around, old, new, others)
    else:
        need_fitting(new, old.place.path, old._options)
        steps.do(NodeSwap(old, new))
        for edge, other in zip(edges, others, strict=True):
            steps.do(EdgeSwap(around, edge, other))
        for level in steps.gated_levels():
            for gate in [gate for gate in level.gates if old in (gate.target, gate.by)]:
                position = level.gates.listed.index(gate)
                steps.do(GateChange(level, gate, position, added=False))
                steps.do(GateChange(level, _gate_of(gate, old, new), position, added=True))
        steps.set_promotions(around, _promoted_by(around, around.promotions.by_name, old, new))
        notes = dict(steps.root.whole.notes.get(old, {}))
        steps.set_notes(old, {})
        steps.set_notes(new, notes)
    return [(around, other) for other in others]


def _replace_box(steps: Steps, around: Level, old: Node, new: Node, edges: list[Edge]) -> None:
    """Remove a node and add the other: the inner graph of a subgraph is built again, so its nodes are others."""
    name, options = old.place.name, old._options
    position = around.members.position(name)
    spots = [around.connections.position(edge) for edge in edges_of(around, old)]
    gates = [(level, gate) for level in steps.gated_levels() for gate in level.gates if old in (gate.target, gate.by)]
    promoted = around.promotions.copied()
    notes = dict(steps.root.whole.notes.get(old, {}))
    steps.remove(old)
    add(around, new, name, options.said())
    added = NodeChange.of(new, added=True)
    steps.changes.append(added)
    steps.do(added.inverse())  # the new node is last; it moves to the place of the old one
    steps.do(NodeChange(around, name, new, added.options, position, added.inside, added=True))
    for spot, edge in zip(spots, edges, strict=True):
        steps.do(EdgeChange(around, edge, spot, added=True))
    steps.do(FactsMoved(steps.root.whole.facts, old, new))
    for level, gate in gates:
        steps.do(GateChange(level, _gate_of(gate, old, new), len(level.gates.listed), added=True))
    steps.set_promotions(around, _promoted_by(around, promoted, old, new))
    steps.set_notes(new, notes)


def _port_of(end: SourceEnd, old: Node, new: Node) -> Any:  # noqa: ANN401 - a port of the same kind
    """Return the port of the new node that replaces one of the old."""
    if not isinstance(end, Port) or end.node is not old:
        return end
    try:
        return same_port(new, end)
    except HfgError as error:
        where = old._place or new._place
        raise GraphError(
            f'"{where.path if where else old._type.name}" cannot be replaced by {new._type.qualname}, which has no '
            f'{end.kind} "{end.name}", and that is in use; disconnect it first, or choose a type that has it'
        ) from error


def _gate_of(gate: Gate, old: Node, new: Node) -> Gate:
    target, by = (new if one is old else one for one in (gate.target, gate.by))
    return Gate(target, by, gate.idle_rate_hz)


def _promoted_by(around: Level, promoted: Promoted, old: Node, new: Node) -> Promoted:
    """Replace the parameters of the old node among promoted ones by those of the new node."""
    found: Promoted = {}
    for name, ports in promoted.items():
        found[name] = [_port_of(port, old, new) for port in ports]
        for port in found[name]:
            if port.node is new and around.owner is not None:
                refuse_standing(around.owner.ports.parameters[name], port)
    return found
