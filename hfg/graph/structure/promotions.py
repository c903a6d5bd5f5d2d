"""Promotion: a parameter of a subgraph that stands for parameters inside (rule G3). Stands on ports and types."""

from __future__ import annotations

from typing import Any

from hfg.errors import GraphError
from hfg.graph.structure.edges import end_path
from hfg.ports import ParameterPort
from hfg.types import describe, why_not

__all__ = ["refuse_promotion", "refuse_standing"]


def refuse_promotion(graph: Any, outer: Any, inner: Any) -> None:
    """Raise if the parameter of the subgraph cannot stand for the one inside; changes nothing.

    Raises:
      GraphError: one is no parameter or in the wrong place, the inner one is taken, or the types do not fit.
    """
    for port, role in ((outer, "first"), (inner, "second")):
        if not isinstance(port, ParameterPort):
            raise GraphError(
                f"promote joins two parameters, got {port!r} as the {role}; "
                'write graph.promote(self.speed, node.ports.parameters["limit"])'
            )
    if graph._owner is None or outer.node is not graph._owner:
        raise GraphError(
            f'"{outer.path}" is no parameter of the subgraph whose inside this is ({graph._title}); '
            "call graph.promote in build() with a parameter of self"
        )
    if inner.graph is not graph:
        raise GraphError(
            f'"{inner.path}" cannot be promoted, for its node is not in {graph._title}; add it there first'
        )
    if any(port is inner for ports in graph._promoted.values() for port in ports):
        raise GraphError(
            f'"{inner.path}" is promoted already; '
            "one parameter of the subgraph may stand for several inside, but not the reverse"
        )
    if inner in graph._into:
        raise GraphError(
            f'"{inner.path}" is set by the edge from "{end_path(graph._into[inner].source)}" and cannot be promoted '
            "too; "
            "leave out one of the two"
        )
    refuse_standing(outer, inner)


def refuse_standing(outer: Any, inner: Any) -> None:
    """Raise if the one inside cannot take what the parameter of the subgraph takes.

    Raises:
      GraphError: the types do not fit, or the present value is out of the inner one's limits.
    """
    reason = why_not(outer.type, inner.type)
    if reason is not None:
        raise GraphError(
            f'"{outer.path}" is {describe(outer.type)}, but "{inner.path}" takes {describe(inner.type)} ({reason}); '
            "give both one type"
        )
    problem = inner.spec.check(outer.value)
    if problem is not None:
        raise GraphError(f'"{outer.path}" cannot stand for "{inner.path}": {problem}; change its value or the limits')
