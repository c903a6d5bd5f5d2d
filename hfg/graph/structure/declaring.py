"""What can be declared besides nodes and edges: ports of the graph, groups, gates and promotions (P10, R1, A11, G3).

Each is refused where it is declared, with every reason; a refused declaration changes nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Literal

from hfg.errors import GraphError
from hfg.graph.structure.edge import end_path
from hfg.graph.structure.gates import Gate
from hfg.graph.structure.given import group_spec
from hfg.graph.structure.level import Level, inside
from hfg.graph.structure.membership import set_options
from hfg.graph.structure.naming import need_name, path_of, suggest
from hfg.graph.structure.options import GroupGiven, GroupSpec, in_group
from hfg.graph.structure.paths import meant, node_at
from hfg.graph.structure.refusals import Refusable
from hfg.nodetypes.node import Node
from hfg.ports import ParameterPort
from hfg.types import describe, is_hint, why_not


def need_new_port(level: Level, kind: Literal["input", "output"], name: str, hint: object) -> None:
    """Refuse a port that cannot be, and any change of a running graph.

    Raises:
      GraphError: the name is taken or not allowed, the type is not a type, or this is the inside of a subgraph.
    """
    level.need_rest("declaring a port")
    if level.owner is not None:
        raise GraphError(
            f'the graph inside "{level.path}" has the ports of its subgraph; '
            f"declare `{name} = hfg.{kind.title()}(...)` in its class"
        )
    need_name(f"an {kind} of the graph", name)
    if level.ports.is_taken(name):
        raise GraphError(f'{level.title} has a port "{name}" already; choose another name')
    if not is_hint(hint):
        raise GraphError(
            f'the type of {kind} "{name}" is {hint!r:.80}, which is not a type; write graph.{kind}("{name}", int)'
        )


def declare_group(level: Level, name: str, given: GroupGiven) -> GroupSpec:
    """Declare a group of the whole graph.

    Raises:
      GraphError: a value is out of its range, or the group is declared otherwise already.
    """
    level.need_rest("declaring a group")
    groups = level.whole.groups
    declared: GroupSpec | None = None
    with Refusable(name):
        declared = group_spec(name, given)
        groups.declare(declared)
    # One that is refused while refusals are kept is there nevertheless, so that nodes in it are not refused as well.
    return declared if declared is not None else groups.by_name.setdefault(str(name), GroupSpec(str(name)))


def move(level: Level, node: Node | str, group: object) -> None:
    """Let a node run in another group.

    Raises:
      GraphError: the node is not in the graph, or the group is not declared; nothing was changed.
    """
    level.need_rest("moving a node")
    node = meant(level, node, node_at)
    if not isinstance(node, Node):
        raise GraphError(f"graph.move takes a node of the graph, got {node!r}; give the node or its path")
    if not level.holds(node):
        raise GraphError(f'"{path_of(node)}" is not in {level.title}, so it cannot be moved there; add it first')
    known = level.whole.groups.by_name
    if group is not None and not (isinstance(group, str) and group in known):
        hint = suggest(group, known) if isinstance(group, str) else f"it has {', '.join(known)}"
        raise GraphError(
            f'"{path_of(node)}" cannot move to group {group!r}, which is not declared: {hint}; '
            'declare it first, as in graph.group("vision", threads=1)'
        )
    set_options(node, in_group(node._options, group))


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
      GraphError: one of the two is not a node of this graph, the target already has a gate, or the rate is invalid.
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


def promote(level: Level, outer: ParameterPort[Any], inner: ParameterPort[Any]) -> None:
    """Let a parameter of the subgraph stand for one inside, which takes its value now.

    Raises:
      GraphError: the two cannot be one; nothing was changed.
    """
    level.need_rest("promoting a parameter")
    with Refusable(outer):
        refuse_promotion(level, outer, inner)
        inner.value = outer.value
        level.promotions.add(outer.name, inner)


def refuse_promotion(level: Level, outer: ParameterPort[Any], inner: ParameterPort[Any]) -> None:
    """Raise if a parameter of the subgraph cannot stand for one inside.

    Raises:
      GraphError: the two cannot be one.
    """
    for port, role in ((outer, "first"), (inner, "second")):
        if not isinstance(port, ParameterPort):
            raise GraphError(
                f"promote joins two parameters, got {port!r} as the {role}; "
                'write graph.promote(self.speed, node.ports.parameters["limit"])'
            )
    if level.owner is None or outer.node is not level.owner:
        raise GraphError(
            f'"{outer.path}" is not a parameter of the subgraph whose inside this is ({level.title}); '
            "call graph.promote in build() with a parameter of self"
        )
    if inner.graph is not level.face:
        raise GraphError(f'cannot promote "{inner.path}": its node is not in {level.title}; add the node there first')
    if level.promotions.has(inner):
        raise GraphError(
            f'"{inner.path}" is promoted already; '
            "one parameter of the subgraph may stand for several inside, but not the reverse"
        )
    edge = level.connections.into.get(inner)
    if edge is not None:
        raise GraphError(
            f'"{inner.path}" is set by the edge from "{end_path(edge.source)}" and cannot be promoted too; '
            "leave out one of the two"
        )
    refuse_standing(outer, inner)


def refuse_standing(outer: ParameterPort[Any], inner: ParameterPort[Any]) -> None:
    """Raise if the one inside cannot take what the parameter of the subgraph takes.

    Raises:
      GraphError: the types do not fit, or the present value is out of the inner one's limits.
    """
    if inner.spec.read_only:
        raise GraphError(
            f'"{outer.path}" cannot stand for "{inner.path}", which only its node sets; connect it to an output of '
            "the subgraph"
        )
    reason = why_not(outer.type, inner.type)
    if reason is not None:
        raise GraphError(
            f'"{outer.path}" is {describe(outer.type)}, but "{inner.path}" takes {describe(inner.type)} ({reason}); '
            "give both one type"
        )
    problem = inner.spec.check(outer.value)
    if problem is not None:
        raise GraphError(f'"{outer.path}" cannot stand for "{inner.path}": {problem}; change its value or the limits')


def stands_for(port: ParameterPort[Any]) -> Iterator[ParameterPort[Any]]:
    """Yield a parameter and all those inside that it stands for."""
    waiting = [port]
    while waiting:
        one = waiting.pop()
        yield one
        inner = inside(one.node)
        if inner is not None:
            waiting += inner.promotions.of(one.name)
