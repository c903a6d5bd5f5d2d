"""`--arg count=3`: arguments of the function that builds a graph, read by its type hints.

Depends on the types; runs nothing.
"""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Sequence
from typing import Any

from hfg.encoding import read_text
from hfg.errors import EncodingError, TargetError
from hfg.types import accepts, describe

_PLAIN = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)


def builder_arguments(place: str, builder: Callable[..., Any], given: Sequence[str]) -> dict[str, Any]:
    """Read what a function is to be called with.

    Args:
      place: where the function is, for messages.
      builder: the function.
      given: "name=value" each.

    Raises:
      TargetError: the function has no such argument, an argument is missing, or a value is not of its type.
    """
    parameters = inspect.signature(builder).parameters
    name_of = f"{place}: {getattr(builder, '__name__', builder)}()"
    known = {name: one for name, one in parameters.items() if one.kind in _PLAIN}
    hints = _hints(builder)
    arguments: dict[str, Any] = {}
    for setting in given:
        name, equals, text = setting.partition("=")
        if not equals or not name.strip():
            raise TargetError(f'--arg "{setting}" gives nothing: write --arg NAME=VALUE')
        name = name.strip()
        if name not in known:
            raise TargetError(f'{name_of} has no argument "{name}"; {_there_are(known, hints)}')
        arguments[name] = _value(name_of, name, text, hints.get(name, _type_of_default(known[name])))
    missing = [name for name, one in known.items() if one.default is one.empty and name not in arguments]
    if missing:
        raise TargetError(f"{name_of} needs a value for {missing[0]}: write --arg {missing[0]}=VALUE")
    return arguments


def _hints(builder: Callable[..., Any]) -> dict[str, Any]:
    try:
        return typing.get_type_hints(builder)
    except Exception:  # names that exist only for type checkers: then the defaults show the types
        return {}


def _type_of_default(parameter: inspect.Parameter) -> Any:
    return Any if parameter.default in (parameter.empty, None) else type(parameter.default)


def _there_are(known: dict[str, inspect.Parameter], hints: dict[str, Any]) -> str:
    names = [f"{name}: {describe(hints.get(name, _type_of_default(one)))}" for name, one in known.items()]
    return f"it has {', '.join(names)}" if names else "it takes none"


def _value(where: str, name: str, text: str, hint: Any) -> Any:
    try:
        return read_text(text, hint, where=f'{where}: argument "{name}"')
    except EncodingError:
        made = _made(hint, text)
        if made is not None and accepts(made, hint):
            return made
    words = "true or false" if hint is bool else f"of type {describe(hint)}"
    raise TargetError(f'{where}: argument "{name}" must be {words}, got {text!r:.80}')


def _made(hint: Any, value: Any) -> Any:
    """Return what a class such as Path makes of a string; None if it makes nothing."""
    if not isinstance(hint, type) or not isinstance(value, str) or issubclass(hint, bool | int | float):
        return None
    make: Any = hint
    try:
        return make(value)
    except Exception:  # of a user
        return None
