"""Hot reload: the types of a changed module replace those of its nodes (rule R4).

What the module defines is exchanged in place; if anything about it fails, the module is as it was. Stands on
`commands`; whoever carries the commands out keeps parameters, edges and gates.
"""

from __future__ import annotations

import linecache
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import CodeType, ModuleType
from typing import Any

from hfg.errors import GraphError
from hfg.graph.boxes import is_box
from hfg.graph.commands import Replace
from hfg.graph.structure import Graph

__all__ = ["reloaded"]


@contextmanager
def reloaded(graph: Graph, module: str | ModuleType) -> Iterator[list[Replace]]:
    """Run a module's source again and give the commands that let its nodes follow; on an exception all is as before.

    Raises:
      GraphError: the module is not imported, has no source, or its source fails.
    """
    name = module if isinstance(module, str) else module.__name__
    found = sys.modules.get(name)
    if found is None:
        raise GraphError(
            f'module "{name}" cannot be reloaded: it is not imported, so no node of the graph is from there'
        )
    commands = [Replace(node.place.path, reference) for node, reference in _nodes_of(graph, name)]
    code = _compiled(found)
    before = dict(vars(found))
    try:
        _run(code, found)
        yield commands
    except BaseException:
        vars(found).clear()
        vars(found).update(before)
        raise


def _run(code: CodeType, module: ModuleType) -> None:
    own = vars(module)
    for name in [name for name in own if not name.startswith("__")]:
        del own[name]  # or what is gone from the source would go on
    try:
        exec(code, own)
    except Exception as error:
        raise GraphError(
            f'module "{module.__name__}" cannot be reloaded: running it failed ({type(error).__name__}: {error}); '
            "the graph goes on with what it has"
        ) from error


def _nodes_of(graph: Graph, module: str) -> Iterator[tuple[Any, str]]:
    """Give the nodes whose types are of a module, and by what references; not those inside such a subgraph."""
    waiting: list[Any] = list(graph.nodes.values())
    while waiting:
        node = waiting.pop(0)
        reference = node._type.reference
        if reference is not None and reference.startswith(f"{module}:"):
            yield node, reference
        elif is_box(node):
            waiting += node._graph.nodes.values()


def _compiled(module: ModuleType) -> CodeType:
    """Compile what the file holds now; a compiled copy from the same second would be taken for new."""
    spec = module.__spec__
    loader: Any = None if spec is None else spec.loader
    source = getattr(loader, "get_source", lambda name: None)(module.__name__)
    if source is None or spec is None or spec.origin is None:
        raise GraphError(f'module "{module.__name__}" cannot be reloaded: it has no source that could have changed')
    linecache.checkcache(spec.origin)
    try:
        return compile(source, spec.origin, "exec")
    except SyntaxError as error:
        raise GraphError(
            f'module "{module.__name__}" cannot be reloaded: {error.msg} in line {error.lineno} of {spec.origin}; '
            "the graph goes on with what it has"
        ) from error
