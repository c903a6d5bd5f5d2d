"""Reads the annotations of a function: its types, how it runs, and where `Token` and None occur.

Depends on errors, tokens and the terms of `description`, not on classes of nodes.
"""

from __future__ import annotations

import functools
import inspect
import types
import typing
from collections import abc
from typing import Any, Final, NoReturn

from hfg.base.token import Token
from hfg.errors import DeclarationError
from hfg.nodetypes.description import ProcessKind

_NONE: Final = type(None)
_SYNC_ITERATORS: Final = (abc.Iterator, abc.Generator)
_ASYNC_ITERATORS: Final = (abc.AsyncIterator, abc.AsyncGenerator)

MISSING: Final = inspect.Parameter.empty


def hints_of(function: Any, where: str) -> dict[str, Any]:
    """Resolve the annotations of a callable, keeping metadata.

    Raises:
      DeclarationError: a name in them does not exist at run time.
    """
    target = function
    while isinstance(target, functools.partial):
        target = target.func
    if inspect.isclass(target):
        hints = hints_of(target.__init__, where)
        return {**hints, "return": target}
    if not hasattr(target, "__annotations__") and not inspect.isroutine(target):
        target = target.__call__  # a callable object
    return _resolve(target, where)


def hints_of_class(cls: type, where: str) -> dict[str, Any]:
    """Resolve the annotations of a class body, keeping metadata; raises the same errors as `hints_of`."""
    return _resolve(cls, where)


def _resolve(target: Any, where: str) -> dict[str, Any]:
    try:
        return typing.get_type_hints(target, include_extras=True)
    except NameError as error:
        missing = error.name
        users = [
            name
            for name, hint in getattr(target, "__annotations__", {}).items()
            if isinstance(hint, str) and str(missing) in hint
        ]
        place = f'the annotation of "{users[0]}"' if users else "an annotation"
        raise DeclarationError(
            f'{where}: "{missing}" in {place} cannot be found at run time; '
            "define it at module level before the node type, and import it outside `if TYPE_CHECKING:`"
        ) from None
    except TypeError as error:
        if not hasattr(target, "__annotations__"):  # C functions have none
            return {}
        raise DeclarationError(f"{where}: cannot resolve its annotations ({error})") from error
    except Exception as error:
        raise DeclarationError(f"{where}: cannot resolve its annotations ({type(error).__name__}: {error})") from error


def kind_of(function: Any) -> ProcessKind:
    """Return how a callable runs, judged by its kind; annotations may refine this."""
    while isinstance(function, functools.partial):
        function = function.func
    candidates = (
        (function,) if inspect.isroutine(function) or inspect.isclass(function) else (function, type(function).__call__)
    )
    if any(map(inspect.isasyncgenfunction, candidates)):
        return "async generator"
    if any(map(inspect.isgeneratorfunction, candidates)):
        return "generator"
    if any(map(inspect.iscoroutinefunction, candidates)):
        return "async"
    return "function"


def split_token(hint: Any) -> tuple[Any, bool]:
    """Remove `Token[...]` from a type. Return the type of its value, and whether it was there."""
    bare = _without_none(hint)
    if bare is Token:
        return Any, True
    if typing.get_origin(bare) is Token:
        return typing.get_args(bare)[0], True
    return hint, False


def _without_none(hint: Any) -> Any:
    """Return a union without None, which means silence in an output (rule T2)."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        members = [member for member in typing.get_args(hint) if member is not _NONE]
        if len(members) < len(typing.get_args(hint)):
            return typing.Union[tuple(members)]  # noqa: UP007 - known at run time only
    return hint


def output_type(hint: Any) -> Any:
    """Return the type that an output with this annotation sends; None for no output."""
    hint = _without_none(hint)
    return None if hint in (None, _NONE, NoReturn, typing.Never) else split_token(hint)[0]


def result_of(hint: Any, kind: ProcessKind, has_inputs: bool) -> tuple[Any, ProcessKind]:
    """Remove iterators and awaitables from the return annotation.

    A function without inputs that returns an iterator is a generator, too.
    """
    origin, arguments = typing.get_origin(hint) or hint, typing.get_args(hint)
    first = arguments[0] if arguments else Any
    if kind == "generator" and origin in (*_SYNC_ITERATORS, abc.Iterable):
        return output_type(first), kind
    if kind == "async generator" and origin in (*_ASYNC_ITERATORS, abc.AsyncIterable):
        return output_type(first), kind
    if kind == "function" and not has_inputs and origin in _SYNC_ITERATORS:
        return output_type(first), "generator"
    if kind == "function" and not has_inputs and origin in _ASYNC_ITERATORS:
        return output_type(first), "async generator"
    if kind == "function" and origin in (abc.Awaitable, abc.Coroutine):
        return output_type(arguments[-1] if arguments else Any), "async"
    return output_type(hint), kind


def is_iterator(hint: Any) -> bool:
    """Return whether an annotation promises a sequence of values."""
    return (typing.get_origin(hint) or hint) in (*_SYNC_ITERATORS, *_ASYNC_ITERATORS)


def function_name(function: Any) -> str:
    """Return the name of a function for messages."""
    while isinstance(function, functools.partial):
        function = function.func
    return str(getattr(function, "__name__", type(function).__name__))
