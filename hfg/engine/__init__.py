"""Running graphs: where asyncio begins.

The wings, each of which knows those above it in this list, never those below:

    model       what a run is made of: nodes (workers), subgraphs (scopes), ready queues, and the state they share
    rules       what the rules decide: firing, sending, releasing, activity, ending; plain functions that never wait
    fusion      fast paths: what the rules prescribe for common shapes, in fewer steps
    runtime     what waits: the loop, the code of nodes, threads, clocks, beginning and ending
    observing   who looks at a run: listeners, taps, statistics, reports
    editing     what changes or holds a run while it goes on: edits, pause, steps, breakpoints
    face        what users hold in their hands: a run, its feeds and readers
"""

from hfg.engine.face.run import Run
from hfg.engine.face.running import run, run_async, running
from hfg.engine.observing.glance import Glance, NodeGlance
from hfg.engine.observing.report import EdgeReport, NodeReport, Report
from hfg.engine.observing.statistics import EdgeStatistics, GroupStatistics, NodeStatistics, Statistics, Times
from hfg.engine.runtime.virtual import VirtualTimeLoop

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
    "run",
    "run_async",
    "running",
]
