"""Running graphs: where asyncio begins.

Which module stands on which; imports go down only:

    run       the face: run, run_async, running
    outside   feeds, readers, signals          engine    pump, timers, coroutines, threads
    plan  ports  iteration  rx  carrier  virtual  watchdog  report
    steps     short ways for common shapes     quiet     growing, ending, stalling
    firing    what a node does next            lifecycle, errors, activity, subgraphs, builtin_slots
    sending   what leaves a node               wiring    which edges are live
    core  worker  scopes  groups               the state of a run
"""

from hfg.engine.report import EdgeReport, NodeReport, Report
from hfg.engine.run import Run, run, run_async, running
from hfg.engine.virtual import VirtualTimeLoop

__all__ = ["EdgeReport", "NodeReport", "Report", "Run", "VirtualTimeLoop", "run", "run_async", "running"]
