"""Finds node types by reference, "module:qualname", and returns the reference of a type.

Depends on `node` and `functions`.
"""

from __future__ import annotations

import difflib
import importlib
import inspect
import sys
from typing import Any

from hfg.errors import TargetError
from hfg.nodetypes.description import look_up
from hfg.nodetypes.functions import NodeFunction
from hfg.nodetypes.node import Node

__all__ = ["NotANodeType", "find", "reference_of"]


class NotANodeType(TargetError):
    """The reference is malformed or names something else; installing a package would not help."""


def find(reference: str) -> type[Node] | NodeFunction[..., Any]:
    """Import the module and return the node type; call it with parameters to make a node.

    Raises:
      TargetError: there is no such module or name, or the object is not a node type.
    """
    module, colon, qualname = reference.partition(":")
    if not (module and colon and qualname):
        raise NotANodeType(
            f'"{reference}" is not a reference to a node type; write "module:name", as in "my_robot.nodes:MapLookup"'
        )
    try:
        importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise TargetError(
            f'node type "{reference}": no module named "{error.name}"; install the package, or add its folder '
            "to sys.path"
        ) from error
    except Exception as error:
        raise TargetError(
            f'node type "{reference}": importing "{module}" failed ({type(error).__name__}: {error})'
        ) from error
    found = look_up(module, qualname)
    if isinstance(found, NodeFunction) or (inspect.isclass(found) and issubclass(found, Node)):
        return found
    if found is None:
        raise TargetError(f'node type "{reference}": module "{module}" has no "{qualname}"{_meant(module, qualname)}')
    raise NotANodeType(
        f'"{reference}" is {found!r}, not a node type; derive it from hfg.Node, or decorate it with hfg.node'
    )


def _meant(module: str, name: str) -> str:
    """Return which name of a module was probably meant."""
    there = sys.modules[module]
    known = {*dir(there), *getattr(there, "__all__", ())}
    near = difflib.get_close_matches(name, [one for one in known if not one.startswith("_")], n=1)
    return f' (did you mean "{near[0]}"?)' if near else ""


def reference_of(node_type: Node | type[Node] | NodeFunction[..., Any]) -> str | None:
    """Return the reference of a type, or of a node's type; None if it cannot be found by name."""
    return node_type._type.reference
