"""Copies of nodes; of a subgraph as it is now, not as its `build` would make it. Depends on levels."""

from __future__ import annotations

from typing import Any, TypeVar, cast

from hfg.graph.structure.edge import Edge
from hfg.graph.structure.facts import Fact
from hfg.graph.structure.gates import Gate
from hfg.graph.structure.level import Level, inside
from hfg.graph.structure.membership import leave, open_box, set_options
from hfg.graph.structure.paths import same_port
from hfg.graph.structure.subgraph import is_box
from hfg.nodetypes.node import Node
from hfg.ports import InnerSource, InnerTarget, Port

End = TypeVar("End")


def copy_of(node: Node, around: Level) -> tuple[Node, Level | None]:
    """Return a node of the same type and parameters that is in no graph, and for a subgraph a copy of its inside."""
    copies: dict[object, Node] = {}
    first = copies[node] = node._copy()
    set_options(first, node._options)  # they decide whether an input takes only one edge
    waiting = [(node, first, around)]
    levels: list[tuple[Level, Level]] = []
    boxes: list[tuple[Node, Level]] = []
    while waiting:  # without recursion, for subgraphs may be as deep as they like
        old, new, outer = waiting.pop()
        old_level = inside(old)
        if old_level is None or not is_box(new):
            continue
        new_level = outer.make_inside(new)
        levels.append((old_level, new_level))
        boxes.append((new, new_level))
        for name, inner in old_level.nodes.items():
            copy = copies[inner] = inner._copy()
            set_options(copy, inner._options)
            new_level.members.append(name, copy)
            waiting.append((inner, copy, new_level))
    for box, new_level in boxes[1:]:  # whoever adds the first gives it its inside
        open_box(box, new_level)
    for old_level, new_level in levels:
        _connect(old_level, new_level, copies)
    new_facts = [fact for fact in around.whole.facts if all(node in copies for node in fact.nodes)]
    around.whole.facts += [Fact(fact.claim, tuple(copies[node] for node in fact.nodes)) for fact in new_facts]
    leave(first)
    return first, levels[0][1] if levels else None


def _connect(old: Level, new: Level, copies: dict[object, Node]) -> None:
    """Declare the same edges, gates and promotions between the copies."""
    for edge in old.edges:
        new.connections.append(Edge(_end(edge.source, copies), _end(edge.target, copies), edge.options))
    for gate in old.gates:
        if gate.target in copies:
            new.gates.append(Gate(copies[gate.target], copies.get(gate.by, gate.by), gate.idle_rate_hz))
    new.promotions.become(
        {name: [_end(port, copies) for port in ports] for name, ports in old.promotions.by_name.items()}
    )


def _end(end: End, copies: dict[object, Node]) -> End:
    """Return what an end is among the copies; the whole graph's own ports, and observables, are what they are."""
    found: Any = end
    if isinstance(end, InnerSource | InnerTarget):
        relay: Any = same_port(copies[end.outer.node], end.outer)
        found = relay.inner
    elif isinstance(end, Port) and end.node in copies:
        found = same_port(copies[end.node], end)
    return cast(End, found)  # of the same kind, because the nodes have the same type
