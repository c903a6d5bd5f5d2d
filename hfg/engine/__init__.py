"""Running graphs. `docs/engine.md` shows it from above, with the way of a token through it.

The wings, each of which imports from those above it in this list and names nothing below; observing and editing stand
side by side and know nothing of each other:

    model       what a run is made of: nodes (workers), subgraphs (scopes), ready queues, and the state they share
    rules       what the rules decide: firing, sending, releasing, activity, ending; plain functions that never wait
    fusion      fast paths: what the rules prescribe for common shapes, in fewer steps
    executing   where asyncio begins: the code of nodes on the loop, in tasks and in threads, and the clocks
    runtime     one run from its beginning to its end: the loop that drives it, its plan, what leads into it
    observing   who looks at a run: listeners, taps, statistics, reports
    editing     what changes or holds a run while it goes on: edits, pause, steps, breakpoints
    face        what users hold in their hands: a run, its feeds and readers; composes all the others

What has to go the other way is called by a table that is declared below and filled from above: `core.Host` and
`core.Code` (deciding needs somebody who waits), `core.RuleCallbacks` (a rule that ends in another one further up), and
`callbacks.Callbacks` (who stands on an engine wants to be told).
"""

from hfg.engine.executing.punctual import PunctualLoop
from hfg.engine.executing.virtual import VirtualTimeLoop
from hfg.engine.face.run import Run
from hfg.engine.face.running import run, run_async, running
from hfg.engine.fusion.explaining import Explanation
from hfg.engine.observing.glance import Glance, MonitorGlance, NodeGlance
from hfg.engine.observing.report import EdgeReport, NodeReport, Report
from hfg.engine.observing.statistics import EdgeStatistics, GroupStatistics, NodeStatistics, Statistics, Times

__all__ = [
    "EdgeReport",
    "EdgeStatistics",
    "Explanation",
    "Glance",
    "GroupStatistics",
    "MonitorGlance",
    "NodeGlance",
    "NodeReport",
    "NodeStatistics",
    "PunctualLoop",
    "Report",
    "Run",
    "Statistics",
    "Times",
    "VirtualTimeLoop",
    "run",
    "run_async",
    "running",
]
