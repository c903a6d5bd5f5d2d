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
    """The parameters of the new node: those that are given, and of the old one what the new one takes."""
    try:
        specs: Any = registry.find(command.type)._type.parameters
    except HfgError as error:
        raise GraphError(f'node "{command.path}": {error}') from error
    values = {
        name: value
        for name, value in old._parameters.items()
        if name in specs and not specs[name].trigger and specs[name].check(value) is None
    }
    return values | command.parameters
