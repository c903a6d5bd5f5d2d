"""Whose code it is that asks: on the loop, in a task of an async node, in a thread, or inside a fused wave.

Nothing is noted for it while nodes fire but what other parts need anyway. Stands on `code` and `groups`.
"""

from __future__ import annotations

import inspect

from hfg.base.logs import Log, Logger
from hfg.engine.executing.code import whose_code
from hfg.engine.executing.groups import current_job
from hfg.engine.model import Core, RunningNode

__all__ = ["log_of_running_code", "speaker"]


def log_of_running_code(core: Core) -> Logger:
    """Give the log of the node whose code calls this; that of all nodes, if it is nobody's."""
    worker = speaker(core)
    if worker is None or worker.node is None:
        return Log("hfg.node")
    log: Logger = worker.node.log
    return log


def speaker(core: Core) -> RunningNode | None:
    """Give the node of a run whose code calls this, if any."""
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
