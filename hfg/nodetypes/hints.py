"""What the annotations of a function say: its types, how it runs, and where `Token` and None stand.

Stands on errors, tokens and the words of `description`; knows no class of nodes.
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

__all__ = [
    "MISSING",
    "function_name",
    "hints_of",
    "hints_of_class",
    "is_iterator",
    "kind_of",
    "output_type",
    "result_of",
    "split_token",
]

_NONE: Final = type(None)
_SYNC_ITERATORS: Final = (abc.Iterator, abc.Generator)
_ASYNC_ITERATORS: Final = (abc.AsyncIterator, abc.AsyncGenerator)

MISSING: Final = inspect.Parameter.empty


def hints_of(function: Any, where: str) -> dict[str, Any]:
    """Resolve the annotations of a callable, metadata kept.

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
        target = target.__call__  # an object that can be called
    return _resolve(target, where)


def hints_of_class(cls: type, where: str) -> dict[str, Any]:
    """Resolve the annotations of a class body, metadata kept; the errors are those of `hints_of`."""
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
        if not hasattr(target, "__annotations__"):  # a function of a C library has none
            return {}
        raise DeclarationError(f"{where}: its annotations cannot be read ({error})") from error
    except Exception as error:
        raise DeclarationError(f"{where}: its annotations cannot be read ({type(error).__name__}: {error})") from error


def kind_of(function: Any) -> ProcessKind:
    """Say how a callable runs by what it is; annotations may say more."""
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
    """Take `Token[...]` off: its value's type, and whether it was there."""
    bare = _without_none(hint)
    if bare is Token:
        return Any, True
    if typing.get_origin(bare) is Token:
        return typing.get_args(bare)[0], True
    return hint, False


def _without_none(hint: Any) -> Any:
    """Take None out of a union: None in an output is silence (rule T2)."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        members = [member for member in typing.get_args(hint) if member is not _NONE]
        if len(members) < len(typing.get_args(hint)):
            return typing.Union[tuple(members)]  # noqa: UP007 - known at run time only
    return hint


def output_type(hint: Any) -> Any:
    """Give what an output annotated like this sends; None for no output."""
    hint = _without_none(hint)
    return None if hint in (None, _NONE, NoReturn, typing.Never) else split_token(hint)[0]


def result_of(hint: Any, kind: ProcessKind, has_inputs: bool) -> tuple[Any, ProcessKind]:
    """Take iterators and awaitables off the return annotation.

    A function that gives an iterator and has no inputs is a generator too.
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
    """Say whether an annotation promises one value after the other."""
    return (typing.get_origin(hint) or hint) in (*_SYNC_ITERATORS, *_ASYNC_ITERATORS)


def function_name(function: Any) -> str:
    """Give what to call a function in messages."""
    while isinstance(function, functools.partial):
        function = function.func
    return str(getattr(function, "__name__", type(function).__name__))
