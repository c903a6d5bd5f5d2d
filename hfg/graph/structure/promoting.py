"""Promoting a parameter: letting one of the subgraph stand for one inside (rule G3). Depends on levels and types."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hfg.errors import GraphError
from hfg.graph.structure.edge import end_path
from hfg.graph.structure.level import Level, inside
from hfg.graph.structure.refusals import Refusable
from hfg.ports import ParameterPort
from hfg.types import describe, why_not

__all__ = ["promote", "refuse_promotion", "refuse_standing", "stands_for"]


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
            f'"{outer.path}" is no parameter of the subgraph whose inside this is ({level.title}); '
            "call graph.promote in build() with a parameter of self"
        )
    if inner.graph is not level.face:
        raise GraphError(f'"{inner.path}" cannot be promoted, for its node is not in {level.title}; add it there first')
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
            f'"{outer.path}" cannot stand for "{inner.path}", which its node alone sets; connect that to an output of '
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
