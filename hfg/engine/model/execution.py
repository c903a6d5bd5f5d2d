"""What executes the code of a node: a task on the loop or a job of a thread, and how long it may take (R1, X2).

Stands on `contracts`.
"""

from __future__ import annotations

from typing import Any

from hfg.engine.model.contracts import Timer
from hfg.errors import EngineInternalError

__all__ = ["Execution"]


class Execution:
    """The code of one node that is under way, but for firings beside others (F14) and tasks.

    Attributes:
      in_flight: it waits on the loop, or is in a thread.
      job: what a thread does for it, perhaps with others of its region.
      eager_task: the dormant task that its coroutines run in; None: the next one makes another.
      generator: what a source draws its next values from; None: it has ended, or begins at its next firing.
      limit_timer: how long the firing may take.
      taken: the values that the firing has taken, if the event `failed` is to tell them (X1).
    """

    __slots__ = ("eager_task", "generator", "in_flight", "job", "limit_timer", "taken")

    def __init__(self) -> None:
        self.in_flight = False
        self.job: Any = None
        self.eager_task: Any = None
        self.generator: Any = None
        self.limit_timer: Timer | None = None
        self.taken: dict[str, Any] | None = None

    def run_in(self, eager_task: object) -> None:
        """Its coroutines run in this task from now on; None: what goes on in the last one does so without the node."""
        self.eager_task = eager_task

    def exchange(self, other: Execution) -> None:
        """The code that runs in the task of another node is this one's: each has the other's task from now on."""
        self.eager_task, other.eager_task = other.eager_task, self.eager_task

    def take_job(self, job: object) -> None:
        """A thread works for it."""
        self.job = job

    def draw_from(self, generator: object) -> None:
        """Take the next values from this generator."""
        self.generator = generator

    def close_generator(self) -> object:
        """Take no more values; gives back what they came from."""
        generator, self.generator = self.generator, None
        return generator

    def limit(self, timer: Timer) -> None:
        """X2: the firing may take as long as this timer."""
        assert self.limit_timer is None, "one firing has one limit"
        self.limit_timer = timer

    def end_limit(self) -> None:
        """The firing is over, in time or not."""
        timer, self.limit_timer = self.limit_timer, None
        if timer is not None:
            timer.cancel()

    def remember(self, taken: dict[str, Any]) -> None:
        """The firing has taken these values."""
        self.taken = taken

    def recall(self) -> dict[str, Any]:
        """What the firing had taken; it is over, and holds that no longer."""
        taken, self.taken = self.taken, None
        return taken or {}

    def check_invariants(self, path: str) -> None:
        """What is limited is under way.

        Raises:
          EngineInternalError: it is not.
        """
        if self.limit_timer is not None and not self.in_flight:
            raise EngineInternalError(f'node "{path}": its firing has a limit, but none of its code is under way (X2)')
