"""The fast path of async functions that really wait: started at once, and their value leaves when it is there.

While such a node waits, its wave waits too, so there is nothing to fuse; this only avoids deciding everything again
at each firing. Only a shortening, as in `slots`: everything else is left to `firing.step`. Depends on `firing`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any, cast

from hfg.engine.model.core import PENDING
from hfg.engine.model.running_node import RunningNode
from hfg.engine.rules import firing
from hfg.engine.rules.releasing import release
from hfg.ports.edges import SyncEdge

__all__ = ["waiting_step"]

Step = Callable[[RunningNode], None]


def waiting_step(worker: RunningNode) -> Step:
    """The step of an async function whose inputs are all fed by outputs; else the interpreted one."""
    edges = worker.live_inputs
    if worker.type.result == "fields" or worker.listeners or not all(type(edge) is SyncEdge for edge in edges):
        return firing.step
    inputs, unset, count = worker.inputs, worker.unset, len(edges)
    held, pipelined = worker.shape.sequential, worker.shape.pipelined
    call = _waiting_call(worker)

    def step(worker: RunningNode) -> None:
        if worker.special or not worker.fireable or inputs.missing or worker.busy:
            firing.step(worker)
            return
        stamp = -inf  # a node may set any stamp (T5)
        arguments = list(unset)
        for edge in edges:
            token: Any = edge.token
            if token.activity:
                firing.step(worker)
                return
            if token.stamp > stamp:
                stamp = token.stamp
            arguments[edge.position] = token.value
        for edge in edges:
            edge.token = None
        inputs.missing = count
        worker.fire_plainly(held, stamp)
        if pipelined:
            release(pipelined)
        call(arguments)

    return step


def _waiting_call(worker: RunningNode) -> Callable[[list[Any]], None]:
    """Return what starts the function in the node's eager task, and lets the firing end when its value is there."""
    core, process = worker.core, cast("Callable[..., Any]", worker.process)
    current: Any = None  # the eager task for which `late` was made
    late: Any = None

    def leave(result: object, error: BaseException | None) -> None:
        if error is None:
            firing.complete_firing(worker, result)
        else:
            firing.when_done(worker)(result, error)

    def call(arguments: list[Any]) -> None:
        nonlocal current, late
        eager_task: Any = worker.execution.eager_task
        if eager_task is not current:
            current, late = eager_task, core.code.late(worker, leave)
        core.running_node = worker
        try:
            result = eager_task.start(process(*arguments), late)
        except Exception as error:
            leave(None, error)
            return
        if result is PENDING:
            worker.begin_async()
        else:
            leave(result, None)

    return call
