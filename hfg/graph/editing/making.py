"""Makes nodes and values of plain data (rule R4). Depends on the registry and on encoding."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import msgspec

from hfg import registry
from hfg.encoding import Find, decode, has_tag
from hfg.errors import EncodingError, GraphError, HfgError
from hfg.graph.editing.commands import Replace
from hfg.nodetypes.node import Node
from hfg.ports import ParameterSpec
from hfg.types import accepts


def made(reference: str, parameters: dict[str, Any], path: str, find: Find | None = None) -> Node:
    """Make a node of a type that is found by name.

    Raises:
      GraphError: the type does not exist, or a parameter is refused.
    """
    try:
        kind = registry.find(reference)
    except HfgError as error:
        raise GraphError(f'node "{path}": {error}') from error
    specs = kind._type.parameters
    values = {name: fitting(specs[name], value, find) if name in specs else value for name, value in parameters.items()}
    try:
        node: Node = kind(**values)
    except (TypeError, ValueError) as error:
        raise GraphError(f'node "{path}": {error}') from error
    return node


def as_meant(value: object, hint: object, find: Find | None = None) -> object:
    """Return the value of a type that data represents: a tuple for a list, a path for a string.

    Data that represents no such value is returned as it is, for the caller to refuse.
    """
    return _meant(value, partial(decode, hint=hint, find=find), lambda one: accepts(one, hint))


def fitting(spec: ParameterSpec, value: object, find: Find | None = None) -> object:
    """Do the same for the value of a parameter, which may have limits."""
    return _meant(value, partial(spec.decode, find=find), lambda one: spec.check(one) is None)


def _meant(value: object, decoded: Callable[[object], object], fits: Callable[[object], bool]) -> object:
    if not has_tag(value) and fits(value):
        return value
    try:
        found = decoded(value)
    except EncodingError:
        return value
    return found if fits(found) else value


def kept(old: Node, command: Replace) -> dict[str, Any]:
    """Return the parameters of a new node: those that are given, and those that the old node has, too.

    Raises:
      GraphError: the type does not exist, or refuses the value of one of them.
    """
    try:
        specs = registry.find(command.type)._type.parameters
    except HfgError as error:
        raise GraphError(f'node "{command.path}": {error}') from error
    values = {}
    for name, value in old._parameters.items():
        both = name in specs and specs[name].is_given and old._type.parameters[name].is_given
        if not both or name in command.parameters:
            continue
        values[name] = _as_now(specs[name], value)
        problem = specs[name].check(values[name])
        if problem is not None:
            raise GraphError(
                f'"{command.path}" cannot be replaced by {command.type} with its parameters as they are: "{name}" '
                f"{problem}; set it before, or give another value with the command"
            )
    return values | command.parameters


def _as_now(spec: ParameterSpec, value: object) -> object:
    """Convert a value of a class that a reload has made again, an enum or a dataclass, to the new class."""
    if spec.check(value) is None:
        return value
    try:
        plain = msgspec.to_builtins(value)
    except (TypeError, ValueError, RecursionError):
        return value
    found = fitting(spec, plain)
    return value if found is plain else found
