"""Makes the nodes that commands name: by reference, with parameters as data (rule R4). Stands on the registry."""

from __future__ import annotations

from typing import Any

import msgspec

from hfg import registry
from hfg.errors import GraphError, HfgError
from hfg.graph.commands import Replace
from hfg.nodetype import Node
from hfg.types import accepts

__all__ = ["as_meant", "fitting", "kept", "made"]


def made(reference: str, parameters: dict[str, Any], path: str) -> Any:
    """Make a node of a type that is found by name.

    Raises:
      GraphError: there is no such type, or a parameter is refused.
    """
    try:
        kind: Any = registry.find(reference)
    except HfgError as error:
        raise GraphError(f'node "{path}": {error}') from error
    specs = kind._type.parameters
    values = {name: fitting(specs[name], value) if name in specs else value for name, value in parameters.items()}
    try:
        return kind(**values)
    except (TypeError, ValueError) as error:
        raise GraphError(f'node "{path}": {error}') from error


def as_meant(value: Any, hint: Any) -> Any:
    """The same for a value of any type; one that does not fit is left, for whoever checks it."""
    if accepts(value, hint):
        return value
    try:
        converted = msgspec.convert(value, hint)
    except Exception:
        return value
    return converted if accepts(converted, hint) else value


def fitting(spec: Any, value: Any) -> Any:
    """What came over a wire may have lost its type: a list stands for a tuple, a text for an enum's member."""
    if spec.check(value) is None:
        return value
    try:
        converted = msgspec.convert(value, spec.type)
    except Exception:
        return value  # the parameter says what is wrong with it
    return value if spec.check(converted) is not None else converted


def kept(old: Node, command: Replace) -> dict[str, Any]:
    """The parameters of the new node: those that are given, and of the old one those that both have.

    Raises:
      GraphError: there is no such type, or it does not take the value of one of them.
    """
    try:
        specs: Any = registry.find(command.type)._type.parameters
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


def _as_now(spec: Any, value: Any) -> Any:
    """A value of a type that a reload has made anew, an enum or a dataclass, in that type."""
    if spec.check(value) is None:
        return value
    try:
        return fitting(spec, msgspec.to_builtins(value))
    except Exception:
        return value
