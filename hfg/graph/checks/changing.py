"""Node types whose code changes what it takes (rule T1): read from the source of their process functions.

Names that the function rebinds may refer to copies and are ignored. Depends on `flat`.
"""

from __future__ import annotations

import ast
import dis
import inspect
import textwrap
from collections.abc import Callable, Iterator
from functools import lru_cache
from itertools import islice
from types import CodeType, FunctionType
from typing import Any, Final

from hfg.errors import Problem
from hfg.graph.flat import FlatGraph, FlatNode
from hfg.nodetypes.description import NodeType
from hfg.nodetypes.node import Node

_STORES: Final = frozenset(
    dis.opmap[name] for name in ("STORE_SUBSCR", "DELETE_SUBSCR", "STORE_SLICE", "STORE_ATTR") if name in dis.opmap
)
_CHANGING: Final = frozenset(
    {"append", "extend", "insert", "remove", "pop", "clear", "sort", "reverse", "add", "discard", "update", "popitem"}
    | {"setdefault", "fill", "put", "resize"}
)
"""Methods that change what they belong to, and whose result nobody uses where that is meant."""


def changed_inputs(whole: FlatGraph) -> list[Problem]:
    """Node types that write into a value that they have taken; each told once."""
    first: dict[NodeType, FlatNode] = {}
    for flat in whole.walk():
        for node in flat.nodes:
            first.setdefault(node.node._type, node)
    return [problem for node in first.values() for problem in _found_in(node)]


def _found_in(node: FlatNode) -> list[Problem]:
    """Return the problem of a node's type: the first input that its code writes into."""
    kind = node.node._type
    if kind.process_kind == "none":
        return []
    inputs = frozenset(name for name, spec in kind.inputs.items() if not spec.token)
    return [
        Problem(
            path=node.path,
            severity="warning",
            what=f'its code changes what it takes by "{name}"',
            why="a value that is shared is not changed: its sender, other nodes and the trace see it change, too "
            "(rule T1)",
            remedy=f"change a copy in line {line}, as in {name} = {name}.copy(); a run with debug=True refuses it",
            check="changes-input",
        )
        for name, line in islice(_changes(_function(node.node), inputs), 1)
    ]


def _function(node: Node) -> Callable[..., Any] | None:
    """Return the function that runs for a firing, if it was written in Python."""
    kind = node._type
    found = inspect.unwrap(kind.origin.function) if kind.is_function else getattr(type(node), "process", None)
    return found if inspect.isfunction(found) else None


def _changes(function: Callable[..., Any] | None, inputs: frozenset[str]) -> Iterator[tuple[str, int]]:
    if not isinstance(function, FunctionType) or not inputs or not _may_change(function.__code__):
        return
    first = function.__code__.co_firstlineno
    for name, line in _found(function):
        if name in inputs:
            yield name, first + line - 1


def _may_change(code: CodeType) -> bool:
    """Whether it is worth reading: most functions change nothing at all, and that their bytecode says at once."""
    return bool(
        _STORES.intersection(code.co_code[::2])
        or _CHANGING.intersection(code.co_names)
        or any(isinstance(one, tuple) and "out" in one for one in code.co_consts)
    )


@lru_cache(maxsize=1000)
def _found(function: Callable[..., Any]) -> tuple[tuple[str, int], ...]:
    """Names whose values the function changes and never binds itself, with the lines."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, SyntaxError, TypeError):
        return ()
    bound = {one.id for one in ast.walk(tree) if isinstance(one, ast.Name) and not isinstance(one.ctx, ast.Load)}
    changed = sorted((getattr(one, "lineno", 0), name) for one in ast.walk(tree) for name in _changed_by(one))
    return tuple((name, line) for line, name in changed if name not in bound)


def _changed_by(one: ast.AST) -> Iterator[str]:
    """The names whose values this part of a function changes."""
    if isinstance(one, ast.Subscript | ast.Attribute) and not isinstance(one.ctx, ast.Load):
        inside: ast.AST = one
        while isinstance(inside, ast.Subscript | ast.Attribute):
            inside = inside.value
        if isinstance(inside, ast.Name):
            yield inside.id
    elif isinstance(one, ast.Expr) and isinstance(one.value, ast.Call):
        called = one.value.func
        if isinstance(called, ast.Attribute) and called.attr in _CHANGING and isinstance(called.value, ast.Name):
            yield called.value.id
    elif isinstance(one, ast.keyword) and one.arg == "out" and isinstance(one.value, ast.Name):
        yield one.value.id
