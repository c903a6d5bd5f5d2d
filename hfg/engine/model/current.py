"""Whose code runs, if `asyncio` does not know it: that of which firing, or of which task of a node.

These are context variables, so they also hold in tasks that this code starts itself.
"""

from __future__ import annotations

from contextvars import ContextVar

from hfg.engine.model.concurrent import ConcurrentFiring
from hfg.engine.model.running_node import RunningNode
from hfg.engine.model.tasks import Task

__all__ = ["current_firing", "current_task"]

current_firing: ContextVar[ConcurrentFiring[RunningNode] | None] = ContextVar("hfg.firing", default=None)
"""Whose code runs: set around the code of each firing that goes on beside others."""

current_task: ContextVar[Task[RunningNode] | None] = ContextVar("hfg.task", default=None)
"""Whose code runs, if it is that of a task; also in the tasks that it starts by itself."""
