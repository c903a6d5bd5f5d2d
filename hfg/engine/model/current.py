"""Whose code runs, where `asyncio` cannot tell: in which of several firings, or in which task of a node.

Context variables, so that they hold in whatever that code starts by itself. Stands on `running_node`.
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
