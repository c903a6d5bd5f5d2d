"""What the model asks of a node below the class of nodes, which is `worker.RunningNode`; and what a timer is.

A run is a web: a node knows its group, its subgraphs and the run, and each of these knows its nodes. Imports go one way
all the same, since what stands below the class of nodes is generic in it: `NodeT`. `hfg.engine.model` gives the names
with it filled in.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from hfg.engine.model.ending import Ending

__all__ = ["Node", "NodeT", "Timer"]


class Timer(Protocol):
    """A call that has not happened yet."""

    def cancel(self) -> None:
        """Forget it."""

    def recount(self, counts: bool) -> None:
        """Whether it could start something, so that quiet waits for it."""


class _Counts(Protocol):
    """What of the run is counted by what a node has under way."""

    tasks: int
    waiting_room: int
    full_edges: int

    @property
    def suspects(self) -> dict[Any, None]: ...

    def begin_async(self) -> None: ...

    def end_async(self) -> None: ...


class _Watched(Protocol):
    def tell_watchers(self) -> None: ...


class Node(Protocol):
    """What firings, tasks, subgraphs, gates and borders ask of a node."""

    path: str
    type: Any
    options: Any
    active: bool
    ending: Ending | None
    in_edges: tuple[Any, ...]
    slot_edges: tuple[Any, ...]
    out_edges: tuple[tuple[Any, ...], ...]
    around: tuple[Any, ...]
    within: Any
    gates: list[Any]

    @property
    def core(self) -> _Counts:
        """The run."""

    def lie_in(self, around: tuple[Any, ...]) -> None:
        """These subgraphs are around it, outermost first."""

    @property
    def be_gated(self) -> Callable[[Any], None]:
        """It works only while the state of this gate is active."""

    @property
    def lie_within(self) -> Callable[[Any], None]:
        """G4: the innermost subgraph around it that iterates is this one's."""

    def moves_by_itself(self) -> bool:
        """Whether something of it is under way or will be, without anybody else."""

    @property
    def room(self) -> _Watched:
        """F8: who waits until code of it is over."""


NodeT = TypeVar("NodeT", bound=Node)
"""The class of nodes, to what stands below it."""
