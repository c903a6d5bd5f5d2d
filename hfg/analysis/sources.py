"""The functions of node types with their source, and whether code may reach a port. Depends on node types."""

from __future__ import annotations

import ast
import builtins
import functools
import inspect
import linecache
import types
from typing import Any, Final

from hfg.analysis.bags import Unknown
from hfg.analysis.words import words
from hfg.nodetypes.description import NodeType
from hfg.nodetypes.node import Node

MOST_FUNCTIONS: Final = 200
SENDS: Final = frozenset({"trigger", "trigger_wait", "send"})
REACHES_PORTS: Final = frozenset(
    {*SENDS, "getattr", "vars", "ports", "methodcaller", "attrgetter", "__dict__", "_port", "_emit", "_emit_wait"}
)


def own(one: ast.AST, me: str) -> str | None:
    """The name in `self.name`."""
    if isinstance(one, ast.Attribute) and isinstance(one.value, ast.Name) and one.value.id == me:
        return one.attr
    return None


def above(one: ast.expr) -> str | None:
    """The name in `super().name`."""
    if isinstance(one, ast.Attribute) and isinstance(one.value, ast.Call):
        function = one.value.func
        if isinstance(function, ast.Name) and function.id == "super":
            return one.attr
    return None


def function_of(kind: NodeType, name: str) -> types.FunctionType | None:
    """The plain function of a method or slot of the class; none for what `Node` itself has."""
    for owner in kind.origin.__mro__:
        if name in vars(owner):
            return None if owner in (Node, object) else plain(vars(owner)[name])
    return None


def plain(held: Any) -> types.FunctionType | None:
    """Return the function that a member of a class is or holds; None if that is not plain."""
    for one in (held, getattr(held, "__func__", None), getattr(held, "handler", None)):
        if isinstance(one, types.FunctionType):
            inner = inspect.unwrap(one)
            return inner if isinstance(inner, types.FunctionType) else None
    return None


def functions_in(owner: type) -> list[Any]:
    """Return the functions of a class itself, those of properties too."""
    found = [plain(value) for value in vars(owner).values()]
    return found + [value.fget for value in vars(owner).values() if isinstance(value, property)]


def tree_of(function: types.FunctionType) -> ast.FunctionDef | ast.AsyncFunctionDef:
    """Return the syntax tree of a function."""
    code = function.__code__
    lines = linecache.getlines(code.co_filename, function.__globals__)
    found = trees("".join(lines)).get((code.co_name, code.co_firstlineno)) if lines else None
    if found is None:
        raise Unknown("its source is not there")
    return found


@functools.lru_cache(maxsize=256)
def trees(text: str) -> dict[tuple[str, int], ast.FunctionDef | ast.AsyncFunctionDef]:
    """All functions of a source file by name and first line."""
    found = {}
    try:
        tree = ast.parse(text)
    except SyntaxError:
        return {}
    for one in ast.walk(tree):
        if isinstance(one, ast.FunctionDef | ast.AsyncFunctionDef):
            first = min([one.lineno, *(decorator.lineno for decorator in one.decorator_list)])
            found[one.name, first] = one
    return found


def resolved(one: ast.expr, function: types.FunctionType) -> Any:
    """The object that a name means in a function; None if that is not known."""
    if isinstance(one, ast.Name):
        if one.id in function.__code__.co_freevars:
            cell = (function.__closure__ or ())[function.__code__.co_freevars.index(one.id)]
            return cell.cell_contents if cell != types.CellType() else None
        if one.id in function.__code__.co_varnames:
            return None
        return function.__globals__.get(one.id, getattr(builtins, one.id, None))
    if isinstance(one, ast.Attribute):
        held = resolved(one.value, function)
        return inspect.getattr_static(held, one.attr, None) if isinstance(held, types.ModuleType | type) else None
    return None


def is_harmless(called: Any) -> bool:
    """Whether nothing in a function, or in what it calls of its package, names what could reach a port."""
    waiting, seen = code_of(called), set[int]()
    if not waiting:
        return False
    package = (getattr(called, "__module__", None) or "").partition(".")[0]
    while waiting:
        function = waiting.pop()
        if id(function) in seen:
            continue
        seen.add(id(function))
        spoken = set(words(function.__code__))
        if spoken & REACHES_PORTS or len(seen) > MOST_FUNCTIONS:
            return False
        for word in spoken:
            value = function.__globals__.get(word)
            if (getattr(value, "__module__", None) or "").partition(".")[0] == package and value is not Node:
                waiting += code_of(value)
    return True


def code_of(value: Any) -> list[types.FunctionType]:
    """Return the functions that run when a value is called or used."""
    if isinstance(value, types.FunctionType):
        return [value]
    if isinstance(value, type) and not issubclass(value, Node):
        return [one for one in map(plain, vars(value).values()) if one is not None]
    return []
