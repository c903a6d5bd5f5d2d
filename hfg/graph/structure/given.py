"""Checks what is given as options, and makes `EdgeOptions`, `NodeOptions` and a `GroupSpec` of it.

Equal options are one object: ten thousand nodes with nothing special share theirs. Depends on `options` and errors.
"""

from __future__ import annotations

import builtins
import contextlib
import functools
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from hfg import errors
from hfg.base.controls import name_problem
from hfg.errors import GraphError
from hfg.graph.structure.option import declared, refuse_values, unknown
from hfg.graph.structure.options import ACTIVE, PLAIN, PLAIN_NODE, EdgeOptions, GroupSpec, NodeOptions

# --- edges ---


def edge_options(where: Callable[[], str], given: Mapping[str, Any]) -> EdgeOptions:
    """Check the options of an edge and return the object shared by all edges that have the same.

    Raises:
      ConnectionError: a value is out of its range, or the options contradict each other; the message begins with what
        `where` gives.
    """
    if not given:
        return PLAIN
    if len(given) == 1 and given.get("active") is True:
        return ACTIVE
    at = where()
    if (wrong := unknown(EdgeOptions, given, "graph.connect")) is not None:
        raise errors.ConnectionError(f"{at}: {wrong}")
    said = dict(given)
    for name, one in declared(EdgeOptions).items():
        if name in said and isinstance(one.default, tuple):
            said[name] = _listed(at, name, said[name], one.option.expects)
    refuse_values(EdgeOptions, at, said, errors.ConnectionError)
    for operator in said.get("through", ()):
        if not callable(operator):
            raise errors.ConnectionError(
                f"{at}: through takes reactivex operators such as ops.debounce(0.2), got {operator!r}"
            )
    if said.get("overflow") == "latest":
        said["capacity"] = _capacity_of_latest(at, said.get("capacity"))
    options = EdgeOptions(**said)
    _need_growing(at, options)
    return options if options.initial or options.through else _shared(options)


@functools.lru_cache(maxsize=1024)
def _shared(options: EdgeOptions) -> EdgeOptions:
    return options


def _capacity_of_latest(at: str, capacity: int | None) -> int:
    """`latest` means a capacity of 1 (rule P5)."""
    if capacity not in (None, 1, PLAIN.capacity):
        raise errors.ConnectionError(
            f'{at}: overflow="latest" keeps one signal, got capacity={capacity}; '
            'leave capacity out, or use overflow="drop_oldest"'
        )
    return 1


def _need_growing(at: str, options: EdgeOptions) -> None:
    limit, overflow = options.capacity_limit, options.overflow
    if limit is None:
        return
    if limit < options.capacity:
        raise errors.ConnectionError(
            f"{at}: capacity_limit must be a whole number from {options.capacity} on, got {limit!r}"
        )
    if overflow != "wait":
        raise errors.ConnectionError(
            f'{at}: capacity_limit bounds how far overflow="wait" may grow, '
            f'got overflow="{overflow}", which never grows; leave one of them out'
        )


def _listed(at: str, name: str, given: object, example: str) -> tuple[Any, ...]:
    """Return several things, in order; a single one is the likely slip."""
    if not isinstance(given, Iterable) or isinstance(given, str):
        raise errors.ConnectionError(f"{at}: {name} takes a list, as in {name}={example}, got {given!r}")
    return tuple(given)


# --- nodes ---


def node_options(where: str, given: Mapping[str, Any]) -> NodeOptions:
    """Check the options of a node and return the object shared by all nodes that have the same, checked once.

    Raises:
      GraphError: a value is out of its range; the message begins with `where`.
    """
    if not given:
        return PLAIN_NODE
    if (wrong := unknown(NodeOptions, given, "graph.add")) is not None:
        raise GraphError(f"{where}: {wrong}")
    said = dict(given)
    if "retry_on" in said:
        said["retry_on"] = _error_names(where, said["retry_on"], retries=said.get("retries", 0))
    with contextlib.suppress(GraphError, TypeError):  # TypeError: one that cannot be hashed, so it is invalid
        return _right_options(**said)
    return _checked(where, said)  # which refuses them in the name of the node


@functools.lru_cache(maxsize=1024, typed=True)
def _right_options(**said: Any) -> NodeOptions:  # noqa: ANN401 - each checked by its name
    return _checked("", said)


def _checked(where: str, said: dict[str, Any]) -> NodeOptions:
    refuse_values(NodeOptions, where, said, GraphError)
    return NodeOptions(**said)


def _error_names(where: str, given: object, *, retries: object) -> tuple[str, ...]:
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


# --- groups ---


def group_spec(name: str, given: Mapping[str, Any]) -> GroupSpec:
    """Check the options of a group.

    Raises:
      GraphError: a value is out of its range.
    """
    if type(name) is not str or not name:
        raise GraphError(f"a group needs a name, got {name!r}")
    problem = name_problem(name)
    if problem is not None:
        raise GraphError(f"a group {problem}")
    at = f'group "{name}"'
    if (wrong := unknown(GroupSpec, given, "graph.group")) is not None:
        raise GraphError(f"{at}: {wrong}")
    said = {one: value for one, value in given.items() if value is not None}
    if isinstance(said.get("ledger"), os.PathLike):
        said["ledger"] = os.fspath(said["ledger"])
    refuse_values(GroupSpec, at, said, GraphError)
    process = said["process"] = said.get("process", False) or bool(said.get("host"))
    said.setdefault("threads", 0 if process or name == "loop" else 1)
    if name == "loop":
        _need_nothing_own(at, said["threads"], process)
    _need_process(at, said, process)
    return GroupSpec(name, **said)


def _need_nothing_own(at: str, threads: int, process: bool) -> None:
    if threads:
        raise GraphError(
            f'{at}: it is the event loop itself and takes no thread; declare another, graph.group("work", threads=1)'
        )
    if process:
        raise GraphError(
            f'{at}: it is the event loop of the program itself; declare another, graph.group("vision", process=True)'
        )


def _need_process(at: str, said: Mapping[str, Any], process: bool) -> None:
    if process:
        return
    if said.get("may_misalign"):
        raise GraphError(
            f"{at}: may_misalign says what follows from the death of the group's process: True or False, and with "
            "process=True; got True"
        )
    if said.get("ledger"):
        raise GraphError(f"{at}: ledger= keeps what a process has done, and this group has none; add process=True")
