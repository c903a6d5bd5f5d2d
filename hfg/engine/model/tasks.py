"""Tasks that the code of one node has started by `start_soon` (rules X1, X3, R5).

They run alongside the node's firings, which do not wait for them; quiet and the node's teardown do. `executing.tasks`
runs them. A node has these records only if it has started a task.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field
from typing import Any, Generic

from hfg.engine.model.contracts import EagerTask, NodeT, Timer
from hfg.errors import NodeError

__all__ = ["Doing", "Task", "Tasks"]


@dataclass(slots=True, eq=False)
class Task(Generic[NodeT]):
    """One task."""

    worker: NodeT  # whose code has started it
    name: str  # of its coroutine function
    coroutine: Coroutine[Any, Any, Any]
    doing: Doing[NodeT] | None = None  # of a do-activity
    eager_task: EagerTask | None = None  # runs it once it has started
    limit: Timer | None = None  # it is left behind when this is over (X3)
    cancelled: bool = False  # by a teardown, by disabling, by the end of the run, or a do-activity by that of A(v)

    @property
    def what(self) -> str:
        """Its name in error messages."""
        return f'task "{self.name}"' if self.doing is None else "do()"

    def run_in(self, eager_task: EagerTask) -> None:
        """It starts."""
        self.eager_task = eager_task

    def is_current(self) -> bool:
        """Return whether the caller is its own code, and not that of a task which it has started itself."""
        return self.eager_task is not None and self.eager_task.is_current()

    def cancel(self) -> None:
        """Cancel it where it waits, or before it starts."""
        first = not self.cancelled
        self.cancelled = True
        if self.eager_task is not None:
            self.eager_task.cancel()
            if first:
                self.worker.core.limit_task(self)


@dataclass(slots=True, eq=False)
class Doing(Generic[NodeT]):
    """The do-activity of one node (A15): at most one at a time."""

    task: Task[NodeT] | None = None  # the one in progress, which may be about to end
    due: bool = False  # it should start: A(v) has become 1, or the node was set up again while A(v) is 1
    entering: int = 0  # `on_activated` hooks that it has to wait for

    def enter(self) -> None:
        """A(v) has become 1; `on_activated` comes first."""
        self.due = True
        self.entering += 1

    def entered(self) -> None:
        """One `on_activated` has ended."""
        self.entering -= 1

    def leave(self) -> None:
        """A(v) has become 0."""
        self.due = False
        if self.task is not None and not self.task.cancelled:
            self.task.cancel()

    def be_due(self, due: bool) -> None:
        """The node has been set up; `due`: it is active."""
        self.due = due

    @property
    def may_begin(self) -> bool:
        """Whether it should start now, as far as it knows itself."""
        return self.due and not self.entering and self.task is None

    def begin(self, task: Task[NodeT]) -> None:
        """It has started."""
        self.due = False
        self.task = task

    def over(self) -> None:
        """It has ended."""
        self.task = None


@dataclass(slots=True, eq=False)
class Tasks(Generic[NodeT]):
    """The tasks of one node that are in progress."""

    _worker: NodeT
    doing: Doing[NodeT] = field(default_factory=Doing)  # most node types have no do-activity
    waiting_room: int = 0  # how many wait until a queue has room (F8)
    problems: list[NodeError] = field(default_factory=list)  # failures of cancelled ones, for the code that ends them
    _in_progress: dict[Task[NodeT], None] = field(default_factory=dict)
    _on_rest: list[Callable[[], None]] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self._in_progress)

    @property
    def names(self) -> tuple[str, ...]:
        """Their names, in the order in which they started."""
        return tuple(task.name for task in self._in_progress)

    @property
    def move(self) -> bool:
        """Whether one of them does more than wait for room."""
        return len(self._in_progress) > self.waiting_room

    @property
    def ending(self) -> bool:
        """Whether something waits until all of them have ended."""
        return bool(self._on_rest)

    def begin(self, task: Task[NodeT]) -> None:
        """Add one."""
        self._in_progress[task] = None
        self._worker.core.tasks += 1

    def over(self, task: Task[NodeT]) -> None:
        """One has ended. After the last one, call the waiting callback."""
        del self._in_progress[task]
        self._worker.core.tasks -= 1
        if not self._in_progress:
            waiting, self._on_rest = self._on_rest, []
            for callback in waiting:
                callback()

    def wait_for_room(self, how_many: int) -> None:
        """Change how many of them await `trigger_wait` (F8)."""
        self.waiting_room += how_many
        self._worker.core.waiting_room += how_many
        self._worker.core.suspects[self._worker] = None

    def cancel(self) -> None:
        """Cancel all of them, each once; one that is ending already may take its time."""
        for task in list(self._in_progress):
            if not task.cancelled:
                task.cancel()

    def end(self, then: Callable[[], None]) -> bool:
        """Cancel all of them. Return whether there are any; `then` follows after the last one."""
        if not self._in_progress:
            return False
        self._on_rest.append(then)
        self.cancel()
        return True

    def take_problem(self) -> NodeError | None:
        """Return the first failure of a cancelled task."""
        problems, self.problems = self.problems, []
        return problems[0] if problems else None
