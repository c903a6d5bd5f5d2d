"""The same mission as a classic state machine, to compare: perception stays a data flow graph, one node decides.

robot ─── control ─── mission ─── driving
│         (a node)    (states)    (what is done in them)
└──── compare         (counts and measures both)

`mission` and `driving` know nothing of graphs. The state machine is that of the package `transitions`: `pip install
'hfg[examples]'`.
"""

from examples.fetch_delivery.machine.mission import Mission
from examples.fetch_delivery.machine.robot import Robot

__all__ = ["Mission", "Robot"]
