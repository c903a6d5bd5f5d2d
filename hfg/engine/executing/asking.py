"""Finds the node whose code is the caller: on the loop, in a task of an async node, in a thread, or in a fused wave.

Nothing is recorded for this while nodes fire, except what other parts need anyway.
"""

from __future__ import annotations

import inspect

from hfg.base.logs import Log, Logger
from hfg.engine.executing.groups import current_job
from hfg.engine.model import Core, RunningNode
from hfg.engine.model.current import whose_code

__all__ = ["log_of_running_code", "speaker"]


def log_of_running_code(core: Core) -> Logger:
    """Return the log of the node whose code calls this; that of all nodes, if it is no node's code."""
    worker = speaker(core)
    if worker is None or worker.node is None:
        return Log("hfg.node")
    log: Logger = worker.node.log
    return log


def speaker(core: Core) -> RunningNode | None:
    """Return the node of a run whose code calls this, if any."""
    worker = whose_code()
    if worker is not None:
        return worker
    job = current_job()
    if job is not None:
        worker = job.worker
    elif core.runtime.on_loop():
        worker = core.current or core.running_node
    region = None if worker is None else worker.region
    if region is None or not region.running:
        return worker
    return region.at_work(inspect.currentframe()) or worker
