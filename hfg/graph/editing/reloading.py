"""Hot reload: the types of a changed module replace those of its nodes (rule R4).

The source runs in a new module, so that code in progress, and old types that are still in use, continue with the old
one. If anything about it fails, all is as before. Depends on `commands`; the code that carries them out keeps
parameters, edges and gates.
"""

from __future__ import annotations

import importlib.util
import linecache
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import CodeType, ModuleType
from typing import Any
from weakref import WeakKeyDictionary

from hfg.errors import GraphError
from hfg.graph.editing.commands import Replace
from hfg.graph.structure.level import HasLevel, inside, level_of
from hfg.nodetypes.functions import NodeFunction
from hfg.nodetypes.node import Node

_once_known_as: WeakKeyDictionary[Any, str] = WeakKeyDictionary()
"""The references of types that were reloaded: nothing has them any more, but undo brings their nodes back."""


@contextmanager
def reloaded(graph: HasLevel, module: str | ModuleType) -> Iterator[list[Replace]]:
    """Run a module's source again and give the commands that let its nodes follow; on an exception all is as before.

    Raises:
      GraphError: the module is not imported, has no source, or its source fails.
    """
    if not isinstance(module, str | ModuleType):
        raise GraphError(f'reload takes a module or its name, as in run.reload("robot.nodes"), got {module!r:.80}')
    name = module if isinstance(module, str) else module.__name__
    old = sys.modules.get(name)
    if old is None:
        named = f'; name the module, "{name[:-3]}", not its file' if name.endswith(".py") else ""
        raise GraphError(
            f'module "{name}" cannot be reloaded: it is not imported, so no node of the graph is from there{named}'
        )
    commands = [Replace(node.place.path, reference) for node, reference in _nodes_of(graph, name)]
    code = _compiled(old)
    known_as = dict(_types_in(old, name))
    new = importlib.util.module_from_spec(old.__spec__)  # type: ignore[arg-type]  # or there would be no code
    for inner in [inner for inner in sys.modules if inner.rpartition(".")[0] == name]:
        setattr(new, inner.rpartition(".")[2], sys.modules[inner])
    sys.modules[name] = new
    try:
        _run(code, new)
        yield commands
    except BaseException:
        sys.modules[name] = old
        raise
    _once_known_as.update(known_as)
    package, _, last = name.rpartition(".")
    if package in sys.modules:
        setattr(sys.modules[package], last, new)
    old.__class__ = _Reloaded


class _Reloaded(ModuleType):
    """What a module becomes when it is reloaded: whoever holds it sees the new one, but for its own functions."""

    def __getattribute__(self, name: str) -> object:
        new = _newest(self)
        return super().__getattribute__(name) if new is self else getattr(new, name)

    def __setattr__(self, name: str, value: object) -> None:
        new = _newest(self)
        super().__setattr__(name, value) if new is self else setattr(new, name, value)

    def __delattr__(self, name: str) -> None:
        new = _newest(self)
        super().__delattr__(name) if new is self else delattr(new, name)


def _newest(module: ModuleType) -> ModuleType:
    """Return the current module of this name, or this one if there is none."""
    return sys.modules.get(object.__getattribute__(module, "__name__"), module)


def _run(code: CodeType, module: ModuleType) -> None:
    try:
        exec(code, vars(module))
    except (Exception, SystemExit) as error:
        raise GraphError(
            f'module "{module.__name__}" cannot be reloaded: running it failed ({type(error).__name__}: {error}); '
            "the graph keeps its nodes"
        ) from error


def _nodes_of(graph: HasLevel, module: str) -> Iterator[tuple[Node, str]]:
    """Yield the nodes whose types are of a module, and by what references; not those inside such a subgraph."""
    waiting = list(level_of(graph).nodes.values())
    while waiting:
        node = waiting.pop(0)
        reference = node._type.reference or _once_known_as.get(node._type.origin)
        if reference is not None and reference.startswith(f"{module}:"):
            yield node, reference
        elif (inner := inside(node)) is not None:
            waiting += inner.nodes.values()


def _types_in(owner: object, module: str) -> Iterator[tuple[Any, str]]:
    """Yield the node types of a module, those inside its classes too, and their references."""
    for value in list(vars(owner).values()):
        if isinstance(value, NodeFunction) or (isinstance(value, type) and issubclass(value, Node)):
            reference = value._type.reference
            if reference is not None and reference.startswith(f"{module}:"):
                yield value, reference
        if isinstance(value, type) and value.__module__ == module and value is not owner:
            yield from _types_in(value, module)


def _compiled(module: ModuleType) -> CodeType:
    """Compile what the file holds now; a compiled copy from the same second would be taken for new."""
    spec = module.__spec__
    loader: Any = None if spec is None else spec.loader
    try:
        source = getattr(loader, "get_source", lambda name: None)(module.__name__)
    except (ImportError, OSError, SyntaxError, ValueError) as error:  # it is gone, or in no encoding of Python's
        raise _cannot(module, str(error.__cause__ or error)) from error
    if source is None or spec is None or spec.origin is None:
        raise _cannot(module, "it has no source that could have changed")
    linecache.checkcache(spec.origin)
    try:
        return compile(source, spec.origin, "exec")
    except SyntaxError as error:
        raise _cannot(module, f"{error.msg} in line {error.lineno} of {spec.origin}") from error
    except ValueError as error:  # it holds what no source may
        raise _cannot(module, f"{error} in {spec.origin}") from error


def _cannot(module: ModuleType, why: str) -> GraphError:
    return GraphError(f'module "{module.__name__}" cannot be reloaded: {why}; the graph keeps its nodes')
