"""Protocols of the model: of a node, for modules below `running_node.RunningNode`, and of timers and tasks.

A node refers to its group, its subgraphs and the run, and each of these refers to its nodes. Imports still go one way,
because everything below the class of nodes is generic in it: `NodeT`. `hfg.engine.model` has the names with it filled
in.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from typing import Any, Protocol, TypeVar

__all__ = ["EagerTask", "NodeT", "Timer"]


class Timer(Protocol):
    """A call that has not happened yet."""

    def cancel(self) -> None:
        """Do not make the call."""

    def recount(self, counts: bool) -> None:
        """Set whether it could start something, so that quiet waits for it."""


class EagerTask(Protocol):
    """A task that runs a coroutine of a node; see `executing.eager_task`."""

    task: Any

    @property
    def waiting(self) -> bool:
        """Whether a coroutine is in progress."""

    def enter(self, call: Callable[..., object], *arguments: object) -> None:
        """Call something in the context of the coroutines."""

    def start(self, coroutine: Coroutine[Any, Any, Any], done: Callable[[Any, BaseException | None], None]) -> object:
        """Run the first step of a coroutine."""

    def is_current(self) -> bool:
        """Return whether the caller is code that it runs."""

    def cancel(self) -> None:
        """Cancel the coroutine in progress."""

    def drop(self) -> None:
        """Run the coroutine no further."""


class _Counts(Protocol):
    """The run's counts of the work that a node has in progress."""

    tasks: int
    waiting_room: int
    full_edges: int

    @property
    def suspects(self) -> dict[Any, None]: ...

    def begin_async(self) -> None: ...

    def end_async(self) -> None: ...

    def limit_task(self, task: Any) -> None: ...  # noqa: ANN401 (a type of a module above)


class _Watched(Protocol):
    def notify_watchers(self) -> None: ...


class _Node(Protocol):
    """A node as firings, tasks, subgraphs, gates and borders need it; `RunningNode` describes it."""

    path: str
    type: Any
    options: Any
    active: bool
    in_edges: tuple[Any, ...]
    slot_edges: tuple[Any, ...]
    out_edges: tuple[tuple[Any, ...], ...]
    around: tuple[Any, ...]
    within: Any
    gates: list[Any]

    @property
    def core(self) -> _Counts: ...

    @property
    def room(self) -> _Watched: ...

    @property
    def be_gated(self) -> Callable[[Any], None]: ...

    @property
    def be_within(self) -> Callable[[Any], None]: ...

    def enclose(self, around: tuple[Any, ...]) -> None: ...

    def brings_activity(self) -> bool: ...

    def moves_by_itself(self) -> bool: ...


NodeT = TypeVar("NodeT", bound=_Node)
"""The class of nodes, for everything below it."""
