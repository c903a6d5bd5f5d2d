"""The do-activity of a node: one coroutine that begins with its activity and is cancelled with it (rule A15).

It is a task of the node; `model.tasks.Doing` says whether it is due, and this module when it begins and what follows
its end. Nodes whose type has no `do` never come here. Depends on `sending`.
"""

from __future__ import annotations

import asyncio
from functools import partial

from hfg.engine.model import Doing, Task
from hfg.engine.model.current import current_task
from hfg.engine.model.running_node import BACKOFF, DISABLED, TORN_DOWN, RunningNode
from hfg.engine.rules.modifiers import derive_scopes
from hfg.engine.rules.sending import trigger_from_task
from hfg.trace import DoEnded, DoOutcome, DoStarted

__all__ = ["afresh", "begun", "entered", "entering", "go_on", "has", "leave", "over"]

_NOT_NOW = DISABLED | BACKOFF | TORN_DOWN


def has(worker: RunningNode) -> bool:
    """Whether its node has a do-activity."""
    return worker.node is not None and worker.scope is None and "do" in worker.type.hooks


def _of(worker: RunningNode) -> Doing:
    return worker.need_tasks().doing


def entering(worker: RunningNode) -> None:
    """A(v) has become 1; its `on_activated` comes first."""
    _of(worker).enter()


def entered(worker: RunningNode) -> None:
    """Its `on_activated` is over."""
    _of(worker).entered()
    go_on(worker)


def leave(worker: RunningNode) -> None:
    """A(v) has become 0; one that does not end at once sees nothing of the next activity."""
    doing = _of(worker)
    doing.leave()
    if doing.task is not None:
        worker.node._outdated = partial(_is_current, doing.task)


def _is_current(task: Task) -> bool:
    return current_task.get() is task


def afresh(worker: RunningNode) -> None:
    """The node has been set up again: if it is active its do-activity begins again too."""
    if has(worker):
        _of(worker).be_due(worker.active)
        go_on(worker)


def go_on(worker: RunningNode) -> None:
    """Begin the do-activity if it is due, and neither the last one nor the state of its node keeps it back."""
    tasks, core = worker.need_tasks(), worker.core
    if not tasks.doing.may_begin or tasks.ending or not worker.lifecycle.is_up or worker.lifecycle.opening:
        return
    if worker.blocked & _NOT_NOW or core.over:
        return
    core.runtime.start_task(worker, worker.node.do(), tasks.doing)


def begun(worker: RunningNode) -> None:
    """Its first step is about to be taken."""
    core = worker.core
    if core.trace_changes is not None:
        core.trace_changes(DoStarted(core.now(), worker.path))


def over(worker: RunningNode, task: Task, result: object, error: BaseException | None) -> BaseException | None:
    """It has ended: report it, with its result if it ended by itself. Return its error."""
    core = worker.core
    worker.need_tasks().doing.over()
    worker.node._outdated = None
    outcome: DoOutcome = "completed" if error is None else "failed"
    if task.cancelled and isinstance(error, asyncio.CancelledError | None):
        outcome = "cancelled"
    if (
        core.trace_changes is not None and not core.over and task.eager_task is not None
    ):  # else it was cancelled before it began
        core.trace_changes(DoEnded(core.now(), worker.path, outcome))
    if outcome == "completed":
        try:
            _complete(worker, result)
        except Exception as failure:
            return failure
    return error if outcome == "failed" else None


def _complete(worker: RunningNode, result: object) -> None:
    event = worker.events.get("completed")
    if event is not None:
        trigger_from_task(event, result)
        derive_scopes(worker.core)
