"""Analyses of a graph before it runs.

bags       what one firing or call may send              sources       the functions of node types
walking    every way through a method                    reading       what the code of a node type may send
words      what the words in it show of modifiers        surroundings  what may end, or not be live
moves      what each node may do                         rules         what may happen to activity
places     where it can be                               spread        where it may come at all
game       activity as a token game                      playing       what follows a state of it
searching  its states, and which places go together      proving       proofs and counter-examples
reach      what activity reaches, region by region       findings      what is probably a mistake
checks     what the first stage shows: adds to the checks of graphs
diagram    the states, and what leads where              wording       a report in words
report     the analysis of activity, for users
response   response times on one processor               waves         what a source causes
timing     deadlines of a graph                          profile       durations that a run has measured
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hfg.base.lazy import on_demand

if TYPE_CHECKING:
    from hfg.analysis.diagram import StateDiagram
    from hfg.analysis.profile import Measured, Profile
    from hfg.analysis.proving import Region, Step, Verdict
    from hfg.analysis.report import ActivityReport, analyse_activity
    from hfg.analysis.timing import PathTime, TimeReport, analyse_time
else:  # every check of a graph imports this package, and needs little of it
    __getattr__ = on_demand(
        __name__,
        {
            "diagram": ("StateDiagram",),
            "profile": ("Measured", "Profile"),
            "proving": ("Region", "Step", "Verdict"),
            "report": ("ActivityReport", "analyse_activity"),
            "timing": ("PathTime", "TimeReport", "analyse_time"),
        },
    )

__all__ = [
    "ActivityReport",
    "Measured",
    "PathTime",
    "Profile",
    "Region",
    "StateDiagram",
    "Step",
    "TimeReport",
    "Verdict",
    "analyse_activity",
    "analyse_time",
]
