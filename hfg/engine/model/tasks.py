"""Tasks that the code of one node has started by `start_soon` (rules X1, X3, R5): what the rules know of them.

They are beside the node's firings: none waits for them, but quiet and the node's teardown do. Plain state; what makes
them go on is `executing.tasks`, and both exist only where somebody has started one.
"""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from typing import Any, Generic

from hfg.engine.model.contracts import NodeT
from hfg.errors import NodeError

__all__ = ["Doing", "Task", "Tasks"]


class Task(Generic[NodeT]):
    """One of them.

    Attributes:
      worker: whose code has started it.
      name: of its coroutine function.
      coroutine: what it runs.
      eager_task: what carries it once it has begun.
      cancelled: its node is torn down or switched off, the run is over, or a do-activity is to end with A(v).
      doing: of a do-activity.
    """

    __slots__ = ("cancelled", "coroutine", "doing", "eager_task", "name", "worker")

    def __init__(
        self, worker: NodeT, name: str, coroutine: Coroutine[Any, Any, Any], doing: Doing[NodeT] | None = None
    ) -> None:
        self.worker = worker
        self.doing = doing
        self.name = name
        self.coroutine = coroutine
        self.eager_task: Any = None
        self.cancelled = False

    @property
    def what(self) -> str:
        """What it is called where it fails."""
        return f'task "{self.name}"' if self.doing is None else "do()"

    def run_in(self, eager_task: object) -> None:
        """It begins."""
        self.eager_task = eager_task

    def is_current(self) -> bool:
        """Whether the code that asks is its own, and not that of something which it has started by itself."""
        return self.eager_task is not None and self.eager_task.is_current()

    def cancel(self) -> None:
        """Let it end: at what it waits for, or before it has begun."""
        self.cancelled = True
        if self.eager_task is not None:
            self.eager_task.cancel()


class Doing(Generic[NodeT]):
    """The do-activity of one node (A15): never two at once.

    Attributes:
      task: the one under way, which may be about to end.
      due: it is to begin: A(v) has become 1, or the node was set up anew while A(v) is 1.
      entering: how many `on_activated` hooks it has to wait for.
    """

    __slots__ = ("due", "entering", "task")

    def __init__(self) -> None:
        self.task: Task[NodeT] | None = None
        self.due = False
        self.entering = 0

    def enter(self) -> None:
        """A(v) has become 1; `on_activated` comes first."""
        self.due = True
        self.entering += 1

    def entered(self) -> None:
        """One `on_activated` is over."""
        self.entering -= 1

    def leave(self) -> None:
        """A(v) has become 0."""
        self.due = False
        if self.task is not None and not self.task.cancelled:
            self.task.cancel()

    def be_due(self, due: bool) -> None:
        """The node has been set up; whether it is active."""
        self.due = due

    def may_begin(self) -> bool:
        """Whether it is to begin, as far as it knows itself."""
        return self.due and not self.entering and self.task is None

    def begin(self, task: Task[NodeT]) -> None:
        """It has begun."""
        self.due = False
        self.task = task

    def over(self) -> None:
        """It has ended."""
        self.task = None


class Tasks(Generic[NodeT]):
    """Those of one node that are under way.

    Attributes:
      waiting_room: how many wait until a queue has room (F8).
      problems: what those failed with that were cancelled, for whoever ends them.
      doing: the do-activity of the node, which most types do not have.
    """

    __slots__ = ("_on_rest", "_under_way", "_worker", "doing", "problems", "waiting_room")

    def __init__(self, worker: NodeT) -> None:
        self._worker = worker
        self._under_way: dict[Task[NodeT], None] = {}
        self._on_rest: list[Callable[[], None]] = []
        self.waiting_room = 0
        self.problems: list[NodeError] = []
        self.doing: Doing[NodeT] = Doing()

    def __len__(self) -> int:
        return len(self._under_way)

    @property
    def names(self) -> tuple[str, ...]:
        """What they are called, in the order in which they began."""
        return tuple(task.name for task in self._under_way)

    @property
    def move(self) -> bool:
        """Whether one of them does not only wait for room."""
        return len(self._under_way) > self.waiting_room

    @property
    def ending(self) -> bool:
        """Whether somebody waits until all of them have ended."""
        return bool(self._on_rest)

    def begin(self, task: Task[NodeT]) -> None:
        """One more."""
        self._under_way[task] = None
        self._worker.core.tasks += 1

    def over(self, task: Task[NodeT]) -> None:
        """One less; behind the last one those have their turn who wait for that."""
        del self._under_way[task]
        self._worker.core.tasks -= 1
        if not self._under_way:
            waiting, self._on_rest = self._on_rest, []
            for callback in waiting:
                callback()

    def wait_for_room(self, how_many: int) -> None:
        """F8: so many more of them await `trigger_wait`."""
        self.waiting_room += how_many
        self._worker.core.waiting_room += how_many
        self._worker.core.suspects[self._worker] = None

    def cancel(self) -> None:
        """Let all of them end; what is about to has been told once, and may take its time."""
        for task in list(self._under_way):
            if not task.cancelled:
                task.cancel()

    def end(self, then: Callable[[], None]) -> bool:
        """Let all of them end; whether there are any, which `then` follows."""
        if not self._under_way:
            return False
        self._on_rest.append(then)
        self.cancel()
        return True

    def take_problem(self) -> NodeError | None:
        """What the first of them failed with that failed as it was cancelled."""
        problems, self.problems = self.problems, []
        return problems[0] if problems else None
