"""Whether the code of a node type may send modifiers of its own (rule A4): what the words in it show.

A modifier is sent by `activity=...` in a send or trigger, or by a token that the code makes. Code may also hide that
well, so "no" means "not that its code shows". Depends on node types.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from types import CodeType, FunctionType, ModuleType
from typing import Any, Final

from hfg.nodetypes.node import Node, NodeType

__all__ = ["makes_tokens", "sets_modifiers", "words"]

_MOST_FUNCTIONS: Final = 200  # code that calls more is not read to its end


def sets_modifiers(kind: NodeType) -> bool:
    """Return whether the type's code, or what it calls of its own package, speaks of modifiers or of tokens."""
    return _speaks_of(kind, frozenset({"activity", "Token"}))


def makes_tokens(kind: NodeType) -> bool:
    """Return whether the code speaks of tokens, which have modifiers."""
    return _speaks_of(kind, frozenset({"Token"}))


@functools.lru_cache(maxsize=8192)
def _speaks_of(kind: NodeType, telling: frozenset[str]) -> bool:
    package = kind.module.partition(".")[0]
    waiting = list(_functions(kind))
    seen: set[int] = set()
    while waiting:
        function = waiting.pop()
        if id(function) in seen:
            continue
        seen.add(id(function))
        if len(seen) > _MOST_FUNCTIONS:
            return True
        spoken = set(words(function.__code__))
        if spoken & telling:
            return True
        waiting += [one for one in _called(function, spoken) if (one.__module__ or "").partition(".")[0] == package]
    return False


def _functions(kind: NodeType) -> Iterator[FunctionType]:
    """The code that a user wrote for the type."""
    function = getattr(kind.origin, "function", None)
    if isinstance(function, FunctionType):
        yield function
    if isinstance(kind.origin, type):
        for base in kind.origin.__mro__:
            if base not in (Node, object) and base.__module__.partition(".")[0] != "typing":
                for value in vars(base).values():
                    yield from _behind(value)


def _behind(value: Any) -> Iterator[FunctionType]:
    """The function that a member of a class is, or holds: a method, property, slot or wrapper."""
    for held in (value, *(getattr(value, name, None) for name in ("__func__", "fget", "handler", "__wrapped__"))):
        if isinstance(held, FunctionType):
            yield held


def words(code: CodeType) -> Iterator[str]:
    """Yield names and texts in a function and in those inside it."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from words(constant)
        elif isinstance(constant, str):
            yield constant
        elif isinstance(constant, tuple):
            yield from (one for one in constant if isinstance(one, str))  # the keywords of a call


def _called(function: FunctionType, spoken: set[str]) -> Iterator[FunctionType]:
    """The functions that it refers to by name, in its module, in modules it names, or around it."""
    cells = [cell.cell_contents for cell in function.__closure__ or () if _is_filled(cell)]
    found = [function.__globals__.get(name) for name in spoken]
    for value in (*found, *cells):
        if isinstance(value, FunctionType):
            yield value
        elif isinstance(value, ModuleType):
            yield from (one for name in spoken if isinstance(one := vars(value).get(name), FunctionType))
        elif isinstance(value, type) and not issubclass(value, Node):
            yield from (one for one in vars(value).values() if isinstance(one, FunctionType))


def _is_filled(cell: Any) -> bool:
    try:
        _ = cell.cell_contents
    except ValueError:
        return False
    return True
