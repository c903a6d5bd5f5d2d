"""Which errors are tried again: the names in `retry_on` (rule X1). Imports nothing for them."""

from __future__ import annotations

import builtins
import sys
from collections.abc import Iterable
from typing import Any, TypeAlias

from hfg.errors import GraphError

Errors: TypeAlias = "Iterable[type[Exception] | str] | type[Exception] | str"


def error_names(where: str, given: object, *, retries: object) -> tuple[str, ...]:
    """Return the names of errors, which may be given as classes or by name; nothing is imported for them.

    A name is compared with those of the error that was raised and of its bases, so one of a module that is not loaded
    does no harm, and a graph file brings no code with it.

    Raises:
      GraphError: one of them is not an error, or nothing is tried again at all; the message begins with `where`.
    """
    if isinstance(given, str | type):
        given = (given,)
    if not isinstance(given, Iterable):
        raise GraphError(f"{where}: retry_on takes errors, as in retry_on=(ConnectionError,), got {given!r}")
    names = tuple(_error_name(where, error) for error in given)
    if names and not retries:
        raise GraphError(
            f"{where}: retry_on=({', '.join(names)},) says which errors are tried again, and retries=0 tries none; "
            "add retries=3"
        )
    return names


def _error_name(where: str, error: object) -> str:
    """Name one error; what has no module in its name is built in."""
    if isinstance(error, str):
        module, _, name = error.rpartition(":")
        if module and module not in sys.modules:
            return error  # what raises it brings its module, and until then nothing can
        found: Any = sys.modules[module] if module else builtins
        for part in name.split("."):
            found = getattr(found, "__dict__", {}).get(part)  # which runs no code, as getattr might
        if found is None:
            raise GraphError(
                f'{where}: retry_on names "{error}", and there is no such error; built-in ones are written '
                '"ConnectionError", others with their module, "my_robot.nodes:NoAnswer"'
            )
    else:
        found = error
    if not isinstance(found, type) or not issubclass(found, Exception):
        raise GraphError(
            f"{where}: retry_on takes classes of errors, as in retry_on=(ConnectionError,), got {error!r}"
            + (", which ends a task or the program on purpose and is not tried again" if _is_exit(found) else "")
        )
    return found.__qualname__ if found.__module__ == "builtins" else f"{found.__module__}:{found.__qualname__}"


def _is_exit(found: object) -> bool:
    return isinstance(found, type) and issubclass(found, BaseException)
