"""The options of an edge as plain data, and back; commands and graph files use the same format.

Values on an edge and what operators are given become data; operators go by the names of their functions.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias, cast

from hfg.errors import EncodingError, GraphError
from hfg.graph.editing.commands import Operator
from hfg.graph.structure.edge import Edge, TargetEnd, type_of
from hfg.graph.structure.operators import NamedOperator, find_operator
from hfg.graph.structure.options import EdgeGiven

Convert: TypeAlias = Callable[[Any, Any], Any]
"""Makes data of a value, or a value of data; takes the type as well."""


def edge_as_data(edge: Edge, encode: Convert) -> EdgeGiven[Any, Operator]:
    """Return the options of an edge.

    Raises:
      GraphError: an operator has no name, or a value is not plain data; the message does not name the edge.
    """
    said = edge.options.said()
    if "initial" in said:
        try:
            said["initial"] = tuple(encode(one, type_of(edge.target)) for one in said["initial"])
        except EncodingError as error:
            raise GraphError(f"an initial value is not plain data: {error}; use another") from error
    if "through" in said:
        said["through"] = tuple(_operator_as_data(one, encode) for one in said["through"])
    return said


def _operator_as_data(operator: object, encode: Convert) -> Operator:
    reference = operator.made_by.reference if isinstance(operator, NamedOperator) else None
    if not isinstance(operator, NamedOperator) or reference is None:
        raise GraphError(
            f"its operator {operator!r:.80} cannot be found by name, so make it by a function at the top of a module "
            "with @hfg.operator, or by one of reactivex, as in hfg.operator(ops.debounce)(0.2)"
        )
    try:
        arguments = tuple(encode(one, Any) for one in operator.arguments)
        return Operator(reference, arguments, {name: encode(one, Any) for name, one in operator.parameters.items()})
    except EncodingError as error:
        raise GraphError(f"its operator {operator!r:.80} is not made of plain data: {error}; give it others") from error


def edge_as_meant(
    said: EdgeGiven[Any, Operator], target: TargetEnd, where: str, decode: Convert
) -> EdgeGiven[Any, NamedOperator]:
    """Return the options that an edge is given; an error names the edge if a value is not even a list.

    Raises:
      GraphError: an operator is not said by name, or cannot be made; the message begins with `where`.
    """
    found = cast(EdgeGiven[Any, Any], dict(said))
    if isinstance(said.get("initial"), tuple | list):
        found["initial"] = tuple(decode(one, type_of(target)) for one in said["initial"])
    if "through" in said:
        found["through"] = _operators(said["through"], where, decode)
    return found


def _operators(said: Any, where: str, decode: Convert) -> tuple[NamedOperator, ...]:  # noqa: ANN401 - commands are written by hand
    if not isinstance(said, tuple | list):
        raise GraphError(f"{where}: through takes several operators, got {said!r}; write ([...])")
    for one in said:
        if not isinstance(one, Operator):
            raise GraphError(
                f"{where}: a command says operators by name, got {one!r}; "
                'write commands.Operator("reactivex.operators:debounce", (0.2,))'
            )
    return tuple(
        find_operator(
            one.type,
            tuple(decode(value, Any) for value in one.arguments),
            {name: decode(value, Any) for name, value in one.parameters.items()},
            where,
        )
        for one in said
    )
