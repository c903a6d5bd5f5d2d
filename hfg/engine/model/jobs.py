"""Calls that threads make for running nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeAlias

from hfg.engine.model.contracts import NodeT

__all__ = ["Done", "Job"]

Done: TypeAlias = "Callable[[Any, BaseException | None], None]"
"""Receives the result of a node's code, and what it raised."""


@dataclass(slots=True, eq=False)
class Job(Generic[NodeT]):
    """A call for a thread, and its outcome."""

    worker: NodeT
    owner: Callable[[Job[NodeT]], None]  # receives the job when it is back, on the loop
    call: Callable[..., Any]
    arguments: tuple[Any, ...]
    done: Done
    began: float = 0.0  # if the policy of its group shares time
    time_hold: Any = None  # prevents virtual time from passing until it is back (R6)
    lane: Any = None  # the thread that runs it
    result: Any = None
    error: BaseException | None = None

    def begin(self, lane: object, now: float) -> None:
        """A thread receives it."""
        self.lane = lane
        self.began = now

    def run(self) -> None:
        """Make the call, in the thread."""
        try:
            self.result = self.call(*self.arguments)
        except BaseException as error:
            self.error = error

    def keep_time(self, hold: object) -> None:
        """This prevents virtual time from passing until the job is back; None: nothing does any more."""
        self.time_hold = hold

    def disown(self) -> None:
        """Ignore its outcome."""
        self.owner = _ignore


def _ignore(_job: Job[Any]) -> None:
    """Receives a job that was given up."""
