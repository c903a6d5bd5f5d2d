"""Runs the tasks that the code of nodes starts by `start_soon`: children of their nodes (rules X1, X3, R5).

Each runs as the code of an async node does, so it can be left behind at the end of the run, and nothing outlives that.
"""

from __future__ import annotations

import asyncio
import contextvars
from collections.abc import Coroutine
from functools import partial
from typing import Any

from hfg.base.clock import current_clock, current_elapsed
from hfg.base.logs import current_log, node_log
from hfg.engine.executing.code import CodeRunner
from hfg.engine.executing.eager_task import EagerTask
from hfg.engine.executing.pump import Pump
from hfg.engine.model import Core, Doing, Task
from hfg.engine.model.core import PENDING
from hfg.engine.model.current import current_firing, current_task, run_as
from hfg.engine.model.running_node import DISABLED, ENDED, TORN_DOWN, RunningNode
from hfg.engine.rules import doing as do_activity
from hfg.engine.rules import errors
from hfg.errors import NodeError, NotRunning, UsageError

__all__ = ["TaskRunner"]

_OF_THE_RUN: tuple[contextvars.ContextVar[Any], ...] = (current_clock, current_elapsed, current_log)


class TaskRunner:
    """Runs the tasks of the nodes of one engine.

    Attributes:
      under_way: all of them, including those of nodes that an edit has removed.
    """

    def __init__(self, engine: Pump, core: Core, code: CodeRunner) -> None:
        self._engine = engine
        self._core = core
        self._code = code
        self.under_way: dict[Task, None] = {}
        self._problems: list[NodeError] = []

    def start(self, worker: RunningNode, coroutine: Coroutine[Any, Any, Any], doing: Doing | None = None) -> None:
        """Run a coroutine as a child task of a node, starting in the loop's next pass.

        Args:
          worker: of the node.
          coroutine: what is run.
          doing: it is the node's do-activity, which no code has started (A15).

        Raises:
          UsageError: the node is in a thread, or the call comes from one.
          NotRunning: the node is not set up, or the run is over.
        """
        name = getattr(coroutine, "__name__", type(coroutine).__name__)
        refusal = self._refusal(worker, name)
        if refusal is not None:
            coroutine.close()
            raise refusal
        if doing is None:
            _not_again(worker)
        if worker.blocked & DISABLED and not worker.lifecycle.opening:
            coroutine.close()  # the current firing of a node that was disabled meanwhile has no effects (F10)
            return
        task = Task(worker, name, coroutine, doing)
        worker.need_tasks().begin(task)
        if doing is not None:
            doing.begin(task)
        self.under_way[task] = None
        self._engine.soon(partial(self._begin, task, self._context(task)))

    def _refusal(self, worker: RunningNode, name: str) -> Exception | None:
        call = f'"{worker.path}" cannot start_soon({name}(...))'
        if worker.group.threaded:
            return UsageError(
                f'{call}, for its group "{worker.group.name}" is a thread and async code runs on the loop; leave out '
                "group=, or send an event to a node on the loop that starts it"
            )
        if not self._engine.on_loop():
            return UsageError(
                f"{call} from a thread, for async code runs on the loop; call it where the thread is awaited"
            )
        if self._core.over:
            return NotRunning(f"{call}, for the run is over; await it in teardown() itself")
        if not worker.lifecycle.is_up:
            return NotRunning(f"{call} while it is torn down; await it in teardown(), or start it in setup()")
        return None

    def _context(self, task: Task) -> contextvars.Context:
        """Return the context of the code that has started it, with the task as its own code."""
        context = contextvars.copy_context() if task.doing is None else self._code.context.copy()
        for one in _OF_THE_RUN:
            context.run(one.set, self._code.context[one])
        context.run(run_as, task.worker)
        context.run(current_firing.set, None)
        context.run(current_task.set, task)
        return context

    def _begin(self, task: Task, context: contextvars.Context) -> None:
        """Start it; it may end in its first step."""
        code, core = self._code, self._core
        if task not in self.under_way:
            return  # it was left behind
        if core.over or (task.doing is not None and task.worker.blocked & TORN_DOWN):
            task.cancel()  # the run is over, or an edit has removed its node
        if task.cancelled:
            self._over(task, None, None)
            return
        worker = task.worker
        eager_task = EagerTask(
            code.loop, f"hfg {worker.path} {task.name}", code.context, context, self._engine.give_way
        )
        task.run_in(eager_task)
        core.current = worker
        if task.doing is not None:
            do_activity.begun(worker)
        try:
            result = eager_task.start(task.coroutine, partial(self._over, task))
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            self._over(task, None, error)
        else:
            if result is not PENDING:
                self._over(task, result, None)
        finally:
            core.current = None

    def limit(self, task: Task, limit_s: float) -> None:
        """Abandon a cancelled task if it takes longer; at the end of a run, one limit holds for all (X3)."""
        if task in self.under_way and not self._core.over:
            task.limit = self._core.after(limit_s, partial(self._give_up, task, limit_s))

    def _give_up(self, task: Task, limit_s: float) -> None:
        """It resists: its code runs no further, its node does not wait for it, and the report names it."""
        words = f"it was cancelled and did not end within {limit_s:g} s"
        problem = NodeError(task.worker.path, task.what, words)
        self._core.errors.append(problem)
        node_log(task.worker.path).error(
            "%s; it is left behind: do not catch CancelledError, or raise it again after cleaning up", problem
        )
        self._end(task, None, None)

    def _over(self, task: Task, result: object, error: BaseException | None) -> None:
        """It has ended."""
        self._core.current = None
        if task in self.under_way:
            self._engine.guard(partial(self._end, task, result, error))
            if self._core.over:
                self._code.came_back.set()
            else:
                self._engine.go_on()

    def _end(self, task: Task, result: object, error: BaseException | None) -> None:
        worker = task.worker
        del self.under_way[task]
        if task.limit is not None:
            task.limit.cancel()
        if task.eager_task is None:
            task.coroutine.close()
        else:
            task.eager_task.drop()
        failure = None if isinstance(error, asyncio.CancelledError) else error
        if task.doing is not None:
            failure = do_activity.over(worker, task, result, error)
        if failure is not None:
            self._failed(task, failure)
        worker.need_tasks().over(task)
        if task.doing is not None:
            do_activity.go_on(worker)

    def _failed(self, task: Task, error: BaseException) -> None:
        """The policy of its node decides (X1); the error of a cancelled task is reported with other errors (X3)."""
        worker = task.worker
        what = task.what + (", after its end" if worker.blocked & ENDED else "")
        if self._core.over:
            self._problems.append(errors.as_node_error(worker, what, error))
        elif task.cancelled and worker.need_tasks().ending and not worker.blocked & DISABLED:
            worker.need_tasks().problems.append(errors.as_node_error(worker, what, error))
        else:
            errors.fail_beside(worker, what, error)

    # --- the end ----------------------------------------------------------------------------------------------------

    def cancel_all(self) -> None:
        """The run is over."""
        for task in list(self.under_way):
            task.cancel()

    def leave_behind(self, seconds: float) -> list[NodeError]:
        """Do not wait for tasks that do not end. Return what failed meanwhile, and what did not end."""
        problems, self._problems = self._problems, []
        for task in list(self.under_way):
            worker = task.worker
            words = f"it was cancelled and did not end within {seconds:.1f} s"
            problems.append(NodeError(worker.path, task.what, words))
            self._end(task, None, None)
        return problems


def _not_again(worker: RunningNode) -> None:
    """A firing that has started a task cannot be retried (X1), like one that has sent a signal."""
    if current_task.get() is not None:
        return
    firing = current_firing.get()
    if firing is not None and firing.worker is worker:
        firing.attempts.mark_triggered()
    elif worker.attempts is not None:
        worker.attempts.mark_triggered()
