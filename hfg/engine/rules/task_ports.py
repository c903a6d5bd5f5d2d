"""Sendings of the tasks of a node, which are independent of its firings (rules F3, T5, A3).

Installed on a node's ports when its code has started one by `start_soon`; others pay nothing. Depends on `sending`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, TypeAlias

from hfg.engine.model import RunningEvent, RunningNode
from hfg.engine.model.current import current_task
from hfg.engine.rules.sending import trigger_from_task
from hfg.errors import UsageError

__all__ = ["refusing", "triggering"]

_Emit: TypeAlias = Callable[[Any, int | None, float | None], Any]


def refusing(worker: RunningNode, position: int, emit: _Emit) -> _Emit:
    """What writes to an output of a worker: its firings do, its tasks may not (F3)."""

    def write(value: Any, activity: int | None, stamp: float | None) -> Any:
        task = current_task.get()
        if task is not None and task.worker is worker:
            raise UsageError(
                f'output "{worker.path}.{worker.out_names[position]}" was written by the task "{task.name}": outputs '
                "belong to process() and end(); trigger an event instead"
            )
        return emit(value, activity, stamp)

    return write


def triggering(event: RunningEvent, emit: _Emit) -> _Emit:
    """What triggers an event of a worker: for its tasks each signal is a sending of its own."""
    worker = event.worker
    host = worker.core.runtime

    def send(value: Any, activity: int | None, stamp: float | None) -> Any:
        task = current_task.get()
        if task is None or task.worker is not worker:
            return emit(value, activity, stamp)
        if task.doing is not None and task.cancelled and activity is None:
            activity = 0  # what there is of activity by now is not that of its attempt (A15)
        if host.on_loop():
            trigger_from_task(event, value, activity, stamp)
        else:  # from a thread that the task has started
            host.bring_in(partial(trigger_from_task, event, value, activity, stamp))
        return None

    return send
