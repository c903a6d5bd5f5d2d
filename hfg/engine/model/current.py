"""Whose code runs: that of which node, firing or task.

These are context variables, so they also hold in tasks that this code starts itself.
"""

from __future__ import annotations

from contextvars import ContextVar

from hfg.engine.model.concurrent import ConcurrentFiring
from hfg.engine.model.running_node import RunningNode
from hfg.engine.model.tasks import Task

__all__ = ["current_firing", "current_task", "run_as", "whose_code"]

current_firing: ContextVar[ConcurrentFiring[RunningNode] | None] = ContextVar("hfg.firing", default=None)
"""The firing whose code runs, if its node allows several at a time."""

current_task: ContextVar[Task[RunningNode] | None] = ContextVar("hfg.task", default=None)
"""The task of a node whose code runs, directly or in an asyncio task that it has started."""

_code_of: ContextVar[RunningNode | None] = ContextVar("hfg.code_of", default=None)


def whose_code() -> RunningNode | None:
    """Return the async node whose code, or a task of which, is the caller."""
    return _code_of.get()


def run_as(worker: RunningNode) -> None:
    """From now on, in this context, the code of this async node runs."""
    _code_of.set(worker)
