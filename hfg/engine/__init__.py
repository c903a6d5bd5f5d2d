"""Running graphs: where asyncio begins.

Which module stands on which; imports go down only:

    run         the face: run, run_async, running
    outside     feeds, readers, signals        engine      the loop, time, quiet, the trace
    lifetime    beginning and ending           code        coroutines and threads
    upstairs    ties the deciding modules together
    iteration   plan  ports  rx                carrier  virtual  watchdog  report
    steps       short ways for common shapes   quiet       growing, ending, stalling
    watched     the same while somebody looks  consumers   who listens to the trace
    glance      the few that a table shows     statistics  numbers while it runs
    meters      what measures the code of nodes
    errors      what a failure brings          activity    what a change of A(v) brings
    firing      what a node does next          builtin_slots  subgraphs  lifecycle
    wiring      which edges are live
    sending     what leaves a node
    core  worker  scopes  groups  settings     the state of a run
"""

from hfg.engine.glance import Glance, NodeGlance, glance
from hfg.engine.report import EdgeReport, NodeReport, Report
from hfg.engine.run import Run
from hfg.engine.running import run, run_async, running
from hfg.engine.statistics import EdgeStatistics, GroupStatistics, NodeStatistics, Statistics, Times
from hfg.engine.virtual import VirtualTimeLoop

__all__ = [
    "EdgeReport",
    "EdgeStatistics",
    "Glance",
    "GroupStatistics",
    "NodeGlance",
    "NodeReport",
    "NodeStatistics",
    "Report",
    "Run",
    "Statistics",
    "Times",
    "VirtualTimeLoop",
    "glance",
    "run",
    "run_async",
    "running",
]
