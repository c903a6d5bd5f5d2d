"""What is said about a node, an edge or a group besides its ends: frozen data, checked when it is given.

Equal options are one object: ten thousand nodes with nothing special share theirs. Stands on errors; knows neither
nodes nor ports.
"""

from __future__ import annotations

import builtins
import contextlib
import functools
import os
import sys
from collections.abc import Callable, Iterable
from typing import Any, Final, Literal, TypeAlias, TypeGuard, TypeVar

import msgspec

from hfg import errors
from hfg.base.controls import name_problem
from hfg.errors import GraphError, HfgError

__all__ = [
    "EdgeOptions",
    "Errors",
    "GroupSpec",
    "NodeOptions",
    "OnError",
    "Overflow",
    "Policy",
    "Release",
    "edge_options",
    "group_spec",
    "in_group",
    "node_options",
]

OnError: TypeAlias = Literal["stop", "skip", "disable", "restart"]
Release: TypeAlias = Literal["auto", "sequential", "pipelined"]
Errors: TypeAlias = "Iterable[type[Exception] | str] | type[Exception] | str"
Overflow: TypeAlias = Literal["wait", "drop_oldest", "drop_newest", "latest", "error"]
Policy: TypeAlias = Literal["fifo", "priority", "deadline", "fair", "random"]

ON_ERROR: Final[tuple[OnError, ...]] = ("stop", "skip", "disable", "restart")
RELEASE: Final[tuple[Release, ...]] = ("auto", "sequential", "pipelined")
OVERFLOW: Final[tuple[Overflow, ...]] = ("wait", "drop_oldest", "drop_newest", "latest", "error")
POLICY: Final[tuple[Policy, ...]] = ("fifo", "priority", "deadline", "fair", "random")
DEFAULT_CAPACITY: Final = 16

Options = TypeVar("Options")


class NodeOptions(msgspec.Struct, frozen=True, kw_only=True):
    """How a node runs; nothing of it belongs to its type.

    Attributes:
      group: where it runs; None is the group of the subgraph around it, at last "loop".
      priority: higher first, in a group with policy "priority" (rule R2).
      max_rate_hz: at most so many firings a second (rule F11).
      on_error: what follows when its code fails (rule X1); the next two are for "restart".
      max_duration_s: the time limit of a firing, and of each attempt at it (rule X2).
      retries: how often a firing that fails is tried again before `on_error` says what follows (rule X1).
      retry_on: names of the errors that are tried again, "ConnectionError" or "my_robot.nodes:NoAnswer"; () is all.
      retry_backoff_s: the pause before the first of them; each further one is twice as long.
      retry_backoff_max_s: no pause is longer.
      retry_jitter: by which part of it a pause may be shorter, by chance: from 0, never, to 1.
      concurrency: how many firings may be under way at once (rule F14).
      ordered: with concurrency: outputs leave in the order in which the firings began, not as they are over.
      release: when the tokens it takes count as processed (rule F5).
      active_for_s: `timeout` is triggered after so long an activity (rule A12).
      deadline_s: how old the oldest token it takes may become, in a group with policy "deadline" (rule R2).
      enabled: whether it is at the start of a run.
      iterate_over: names of a subgraph's inputs that take collections (rule G4).
    """

    group: str | None = None
    priority: int = 0
    max_rate_hz: float | None = None
    on_error: OnError = "stop"
    restart_limit: int = 5
    restart_backoff_s: float = 0.1
    max_duration_s: float | None = None
    retries: int = 0
    retry_on: tuple[str, ...] = ()
    retry_backoff_s: float = 0.1
    retry_backoff_max_s: float = 30.0
    retry_jitter: float = 0.0
    concurrency: int = 1
    ordered: bool = True
    release: Release = "auto"
    active_for_s: float | None = None
    deadline_s: float | None = None
    enabled: bool = True
    iterate_over: tuple[str, ...] = ()


class EdgeOptions(msgspec.Struct, frozen=True, kw_only=True):
    """How an edge transports; all but `active`, `initial` and `buffer` are for event edges (rules P4, P5).

    Attributes:
      active: it also transports activity: the double line of the paper, A(e) = 1.
      capacity: how many untaken signals its queue holds.
      overflow: what happens to more of them; "wait" loses none (rule F8).
      capacity_limit: how far "wait" may let the queue grow; None without end.
      through: reactivex operators before the queue (rule P9).
      initial: values that lie on it at the start (rule P7).
      buffer: of an edge from an output into an input: by how many tokens the producer may run ahead (rule P4).
    """

    active: bool = False
    capacity: int = DEFAULT_CAPACITY
    overflow: Overflow = "wait"
    capacity_limit: int | None = None
    through: tuple[Any, ...] = ()
    initial: tuple[Any, ...] = ()
    buffer: int = 0

    @property
    def for_events(self) -> str | None:
        """The first thing said that only an event edge can have, as written in the call; None if there is none."""
        if self.through:
            return "through=[...]"
        if self.overflow != "wait":
            return f'overflow="{self.overflow}"'
        if self.capacity != DEFAULT_CAPACITY:
            return f"capacity={self.capacity}"
        return None if self.capacity_limit is None else f"capacity_limit={self.capacity_limit}"


class GroupSpec(msgspec.Struct, frozen=True):
    """Where nodes run, and who of them comes first (rules R1, R2).

    Attributes:
      threads: 0 is the event loop, 1 a thread of the group's own; with n of them n of its nodes run at once.
      policy: who runs next when several can.
      seed: for "random"; None is the run's.
      process: its nodes run in a process of its own, on the loop or the threads there.
      host: of that process; "" is the one where the graph is run.
      ledger: what its process has done is kept, so that another goes on from there: True by the run, a path in that
        file, too.
      may_misalign: the run goes on when that process dies, though joins may pair what does not belong together (L2).
    """

    name: str
    threads: int = 0
    policy: Policy = "fifo"
    seed: int | None = None
    process: bool = False
    host: str = ""
    ledger: bool | str = False
    may_misalign: bool = False


_PAUSES: Final = {
    "restart_backoff_s": "0 restarts at once",
    "retry_backoff_s": "0 tries again at once",
    "retry_backoff_max_s": "0 makes no pause at all",
}
PLAIN: Final = EdgeOptions()
ACTIVE: Final = EdgeOptions(active=True)


def node_options(where: str, given: dict[str, Any]) -> NodeOptions:
    """Check the options of a node and give the object shared by all that have the same, which are checked once.

    Raises:
      GraphError: a value is out of its range; the message begins with `where`.
    """
    given["retry_on"] = _error_names(where, given["retry_on"], retries=given["retries"])
    with contextlib.suppress(GraphError, TypeError):  # the second: one that cannot be hashed, and so is none
        return _right_options(**given)
    return _checked(where, given)  # which refuses them in the name of the node


@functools.lru_cache(maxsize=1024, typed=True)
def _right_options(**given: Any) -> NodeOptions:  # noqa: ANN401 - each checked by its name
    return _checked("", given)


def _checked(where: str, given: dict[str, Any]) -> NodeOptions:
    _need_choice(where, "on_error", given["on_error"], ON_ERROR, GraphError)
    _need_choice(where, "release", given["release"], RELEASE, GraphError)
    for name in ("max_rate_hz", "max_duration_s", "active_for_s", "deadline_s"):
        _need_positive(where, name, given[name])
    for name, least in (("priority", None), ("restart_limit", 0), ("retries", 0), ("concurrency", 1)):
        _need_whole(where, name, given[name], least, GraphError)
    _need_pauses(where, given)
    for name in ("enabled", "ordered"):
        if type(given[name]) is not bool:
            raise GraphError(f"{where}: {name} must be True or False, got {given[name]!r}")
    group = given["group"]
    if group is not None and (type(group) is not str or not group):
        raise GraphError(
            f"{where}: group must be the name of a group, got {group!r}; "
            'declare it with graph.group("vision", threads=1)'
        )
    return NodeOptions(**given)


def _error_names(where: str, given: object, *, retries: object) -> tuple[str, ...]:
    """Give the names of errors, which may be given as classes or by name; nothing is imported for them.

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
            f"{where}: retry_on takes classes of errors, as in retry_on=(ConnectionError,), got {error!r}, which is "
            "none" + (": what ends a task or the program on purpose is not tried again" if _is_exit(found) else "")
        )
    return found.__qualname__ if found.__module__ == "builtins" else f"{found.__module__}:{found.__qualname__}"


def _is_exit(found: object) -> bool:
    return isinstance(found, type) and issubclass(found, BaseException)


def _need_pauses(where: str, given: dict[str, Any]) -> None:
    for name, what in _PAUSES.items():
        if not _is_number(given[name]) or given[name] < 0:
            raise GraphError(f"{where}: {name} must be seconds from 0 on, got {given[name]!r}; {what}")
    jitter = given["retry_jitter"]
    if not _is_number(jitter) or not 0 <= jitter <= 1:
        raise GraphError(
            f"{where}: retry_jitter must be a number from 0 to 1, got {jitter!r}; 0.5 makes pauses up to a half shorter"
        )


@functools.lru_cache(maxsize=1024)
def in_group(options: NodeOptions, group: str | None) -> NodeOptions:
    """The same options in another group, or in that of the subgraph around."""
    return msgspec.structs.replace(options, group=group)


def edge_options(where: Callable[[], str], said: dict[str, Any]) -> EdgeOptions:
    """Check the options of an edge, given by name; plain edges share one object, plain active ones another.

    Raises:
      ConnectionError: a value is out of its range, or the options contradict each other; the message begins with what
        `where` gives.
    """
    said["through"] = through = _listed(where, "through", said["through"], "[ops.debounce(0.2)]")
    said["initial"] = initial = _listed(where, "initial", said["initial"], "[0]")
    if (
        not through
        and not initial
        and said["capacity_limit"] is None
        and said["overflow"] == "wait"
        and said["capacity"] == DEFAULT_CAPACITY
        and type(said["buffer"]) is int
        and said["buffer"] == 0
        and type(said["active"]) is bool
    ):
        return ACTIVE if said["active"] else PLAIN
    at = where()
    if type(said["active"]) is not bool:
        raise errors.ConnectionError(f"{at}: active must be True or False, got {said['active']!r}")
    _need_queue(at, said)
    _need_whole(at, "buffer", said["buffer"], 0, errors.ConnectionError)
    broken = next((operator for operator in through if not callable(operator)), None)
    if broken is not None:
        raise errors.ConnectionError(
            f"{at}: through takes reactivex operators such as ops.debounce(0.2), got {broken!r}"
        )
    return EdgeOptions(**said)


def _need_queue(at: str, said: dict[str, Any]) -> None:
    """Check what is said about the queue of an event edge; "latest" means a capacity of 1 (rule P5)."""
    capacity, overflow, limit = said["capacity"], said["overflow"], said["capacity_limit"]
    _need_choice(at, "overflow", overflow, OVERFLOW, errors.ConnectionError)
    _need_whole(at, "capacity", capacity, 1, errors.ConnectionError)
    if overflow == "latest":
        if capacity not in (1, DEFAULT_CAPACITY):
            raise errors.ConnectionError(
                f'{at}: overflow="latest" keeps one signal, got capacity={capacity}; '
                'leave capacity out, or use overflow="drop_oldest"'
            )
        said["capacity"] = 1
    if limit is None:
        return
    _need_whole(at, "capacity_limit", limit, said["capacity"], errors.ConnectionError)
    if overflow != "wait":
        raise errors.ConnectionError(
            f'{at}: capacity_limit bounds how far overflow="wait" may grow, '
            f'got overflow="{overflow}", which never grows; leave one of them out'
        )


def _listed(where: Callable[[], str], name: str, given: object, example: str) -> tuple[Any, ...]:
    """Several things, in order; one alone is the likely slip."""
    if type(given) is tuple:
        return given
    if not isinstance(given, Iterable) or isinstance(given, str):
        raise errors.ConnectionError(f"{where()}: {name} takes a list, as in {name}={example}, got {given!r}")
    return tuple(given)


def group_spec(
    name: str,
    threads: int | None,
    policy: str,
    seed: int | None,
    process: bool = False,
    host: str | None = None,
    ledger: bool | str | os.PathLike[str] = False,
    may_misalign: bool = False,
) -> GroupSpec:
    """Check a group.

    Args:
      name: of the group.
      threads: None is one, but none for "loop" and for a group with a process of its own.
      policy: who runs next.
      seed: for "random".
      process: whether it has a process of its own.
      host: where that is; whoever names one asks for a process.
      ledger: whether what that has done is kept, or in which file.
      may_misalign: whether the run goes on behind a death that may misalign joins.

    Raises:
      GraphError: a value is out of its range.
    """
    if type(name) is not str or not name:
        raise GraphError(f"a group needs a name, got {name!r}")
    problem = name_problem(name)
    if problem is not None:
        raise GraphError(f"a group {problem}")
    at = f'group "{name}"'
    host = "" if host is None else host
    _need_place(at, process, host)
    process = process or bool(host)
    if threads is None:
        threads = 0 if process or name == "loop" else 1
    _need_threads(at, threads)
    if name == "loop":
        _need_nothing_own(at, threads, process)
    ledger = os.fspath(ledger) if isinstance(ledger, os.PathLike) else ledger
    _need_ledger(at, ledger, process)
    _need_process_for(at, may_misalign, process)
    _need_choice(at, "policy", policy, POLICY, GraphError)
    if seed is not None:
        _need_whole(at, "seed", seed, None, GraphError)
    return GroupSpec(name, threads, policy, seed, process, host, ledger, may_misalign)  # type: ignore[arg-type]  # checked above


def _need_place(at: str, process: object, host: object) -> None:
    if type(process) is not bool:
        raise GraphError(f"{at}: process must be True or False, got {process!r}; host= names another host than this")
    if type(host) is not str or "/" in host:
        raise GraphError(f'{at}: host must be the name of an agent, as in host="arm", got {host!r}')


def _need_threads(at: str, threads: object) -> None:
    if type(threads) is not int or threads < 0:
        raise GraphError(
            f"{at}: threads must be 0 (on the loop), 1 (a thread of its own) or the number of its threads, "
            f"got {threads!r}; with n threads up to n of its nodes run at the same time"
        )


def _need_nothing_own(at: str, threads: int, process: bool) -> None:
    if threads:
        raise GraphError(
            f'{at}: it is the event loop itself and takes no thread; declare another, graph.group("work", threads=1)'
        )
    if process:
        raise GraphError(
            f'{at}: it is the event loop of the program itself; declare another, graph.group("vision", process=True)'
        )


def _need_process_for(at: str, may_misalign: object, process: bool) -> None:
    if type(may_misalign) is not bool or (may_misalign and not process):
        raise GraphError(
            f"{at}: may_misalign says what follows from the death of the group's process: True or False, and with "
            f"process=True; got {may_misalign!r}"
        )


def _need_ledger(at: str, ledger: object, process: bool) -> None:
    if type(ledger) is not bool and (type(ledger) is not str or not ledger):
        raise GraphError(
            f'{at}: ledger must be True (kept by the run) or the path of a file, as in ledger="writer.ledger", '
            f"got {ledger!r}"
        )
    if ledger and not process:
        raise GraphError(f"{at}: ledger= keeps what a process has done, and this group has none; add process=True")


def _is_number(value: object) -> TypeGuard[int | float]:
    return isinstance(value, int | float) and type(value) is not bool and value == value  # NaN is none


def _need_choice(where: str, name: str, value: object, choices: tuple[str, ...], error: type[HfgError]) -> None:
    if value not in choices:
        words = ", ".join(f'"{choice}"' for choice in choices)
        raise error(f"{where}: {name} must be one of {words}, got {value!r}")


def _need_whole(where: str, name: str, value: object, least: int | None, error: type[HfgError]) -> None:
    if type(value) is not int or (least is not None and value < least):
        raise error(
            f"{where}: {name} must be a whole number{'' if least is None else f' from {least} on'}, got {value!r}"
        )


def _need_positive(where: str, name: str, value: object) -> None:
    if value is not None and (not _is_number(value) or value <= 0):
        raise GraphError(f"{where}: {name} must be a number above 0, or None for no limit, got {value!r}")
