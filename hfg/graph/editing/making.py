"""Makes the nodes that commands name: by reference, with parameters as data (rule R4). Stands on the registry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec

from hfg import registry
from hfg.errors import GraphError, HfgError
from hfg.graph.editing.commands import Replace
from hfg.nodetype import Node
from hfg.ports import ParameterSpec
from hfg.types import accepts

__all__ = ["as_meant", "fitting", "kept", "made"]


def made(reference: str, parameters: dict[str, Any], path: str) -> Node:
    """Make a node of a type that is found by name.

    Raises:
      GraphError: there is no such type, or a parameter is refused.
    """
    try:
        kind = registry.find(reference)
    except HfgError as error:
        raise GraphError(f'node "{path}": {error}') from error
    specs = kind._type.parameters
    values = {name: fitting(specs[name], value) if name in specs else value for name, value in parameters.items()}
    try:
        node: Node = kind(**values)
    except (TypeError, ValueError) as error:
        raise GraphError(f'node "{path}": {error}') from error
    return node


def as_meant(value: object, hint: object) -> object:
    """What came over a wire may have lost its type: a list stands for a tuple, a text for an enum's member."""
    return _converted(value, hint, lambda one: accepts(one, hint))


def fitting(spec: ParameterSpec, value: object) -> object:
    """The same for a value of a parameter, which may have limits."""
    return _converted(value, spec.type, lambda one: spec.check(one) is None)


def _converted(value: object, hint: Any, fits: Callable[[object], bool]) -> object:  # noqa: ANN401 - any type
    """A value as one of the type; what cannot be one is left as it is, for whoever checks it."""
    if fits(value):
        return value
    try:
        converted = msgspec.convert(value, hint)
    except Exception:  # types of users raise what they like
        return value
    return converted if fits(converted) else value


def kept(old: Node, command: Replace) -> dict[str, Any]:
    """The parameters of the new node: those that are given, and of the old one those that both have.

    Raises:
      GraphError: there is no such type, or it does not take the value of one of them.
    """
    try:
        specs = registry.find(command.type)._type.parameters
    except HfgError as error:
        raise GraphError(f'node "{command.path}": {error}') from error
    values = {}
    for name, value in old._parameters.items():
        if name not in specs or specs[name].trigger or name in command.parameters:
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
    """A value of a type that a reload has made anew, an enum or a dataclass, in that type."""
    if spec.check(value) is None:
        return value
    try:
        plain = msgspec.to_builtins(value)
    except (TypeError, ValueError, RecursionError):
        return value
    found = fitting(spec, plain)
    return value if found is plain else found
