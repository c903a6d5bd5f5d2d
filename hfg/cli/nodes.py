"""`hfg nodes [MODULE]`: lists node types, with what goes in and out.

Stands on the node types' floor, `target` and `show`.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterable, Iterator
from importlib.metadata import entry_points
from importlib.util import find_spec
from types import ModuleType
from typing import Annotated, Any

import typer

from hfg.cli import show
from hfg.cli.target import load_module
from hfg.errors import TargetError
from hfg.functions import FunctionNode, NodeFunction
from hfg.graph import Subgraph
from hfg.nodetype import Node, NodeType
from hfg.types import describe

__all__ = ["nodes"]

_BASES = (Node, Subgraph, FunctionNode)
_LIBRARY = "hfg.nodes"


def nodes(
    module: Annotated[str | None, typer.Argument(help="module or file.py; without it, all that is installed")] = None,
    json: Annotated[bool, typer.Option("--json", help="Write the node types as JSON.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show hfg's own frames in tracebacks.")] = False,
) -> int:
    """List the node types of a module, or of the standard library and what other packages have installed."""
    show.set_debug(debug)
    found = [kind for loaded in _modules(module) for kind in _node_types(loaded)]
    if json:
        show.json([_described(kind) for kind in found])
    elif found:
        rows = [
            (
                _named(kind),
                _ports(kind.inputs, kind.slots),
                _ports(kind.outputs, kind.events),
                _ports(kind.parameters),
                _summary(kind),
            )
            for kind in found
        ]
        show.table("", ("node type", "inputs, slots()", "outputs, events()", "parameters", "what it does"), rows)
    elif module is None:
        sys.stdout.write("no node types are installed; name a module or a file: hfg nodes robot.py\n")
    else:
        sys.stdout.write(f"no node types in {module}\n")
    return 0


def _modules(named: str | None) -> Iterator[ModuleType]:
    """What is named, else all that is installed; what fails of that is told and left out."""
    if named is not None:
        yield load_module(named)
        return
    for place in _installed():
        try:
            yield load_module(place)
        except TargetError as error:
            show.sentence(str(error))


def _installed() -> Iterator[str]:
    """The standard library, and modules that other distributions name in the entry-point group `hfg.nodes`."""
    if find_spec(_LIBRARY) is not None:
        yield _LIBRARY
    for entry in sorted(entry_points(group=_LIBRARY), key=lambda entry: entry.name):
        yield entry.module


def _node_types(module: ModuleType) -> Iterator[NodeType]:
    """The types that a module, or a package and what lies in it, declares; each once, in order."""
    seen: list[NodeType] = []
    for name, value in vars(module).items():
        is_type = isinstance(value, NodeFunction) or (
            inspect.isclass(value) and issubclass(value, Node) and value not in _BASES
        )
        if name.startswith("_") or not is_type:
            continue
        kind: NodeType = value._type
        if f"{kind.module}.".startswith(f"{module.__name__}.") and all(kind is not other for other in seen):
            seen.append(kind)
            yield kind


def _named(kind: NodeType) -> str:
    return kind.reference or f"{kind.module}:{kind.qualname}"


def _summary(kind: NodeType) -> str:
    return kind.doc.partition("\n")[0]


def _ports(*groups: Iterable[str]) -> str:
    synchronous, *asynchronous = groups
    return ", ".join([*synchronous, *(f"{name}()" for group in asynchronous for name in group)])


def _described(kind: NodeType) -> dict[str, Any]:
    """What a program may want to know of a type; types as text."""
    return {
        "reference": _named(kind),
        "name": kind.name,
        "doc": kind.doc,
        "source": kind.is_source,
        "subgraph": kind.is_subgraph,
        "inputs": [
            {"name": one.name, "type": describe(one.type), "optional": one.optional} for one in kind.inputs.values()
        ],
        "outputs": [{"name": one.name, "type": describe(one.type)} for one in kind.outputs.values()],
        "events": [{"name": one.name, "type": describe(one.type)} for one in kind.events.values()],
        "slots": [
            {"name": one.name, "type": describe(one.type), "while_active": one.while_active}
            for one in kind.slots.values()
        ],
        "parameters": [
            {
                "name": one.name,
                "type": describe(one.type),
                "default": one.default,
                "unit": one.unit,
                "limits": [repr(limit) for limit in one.limits],
            }
            for one in kind.parameters.values()
        ],
    }
