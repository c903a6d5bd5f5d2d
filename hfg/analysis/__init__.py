"""Analyses of a graph before it runs.

bags       what one firing or call may send             sources    the functions of node types
walking    every way through a method                   reading    what the code of a node type may send
game       activity as a token game
searching  its states, and which places go together      proving    proofs and counter-examples
reach      what activity reaches, region by region       findings   what is probably a mistake
diagram    the states, and what leads where              wording    a report in words
report     the analysis of activity, for users
response   response times on one processor         waves        what a source causes
timing     deadlines of a graph                    profile      durations that a run has measured
"""

from hfg.analysis.diagram import StateDiagram
from hfg.analysis.profile import Measured, Profile
from hfg.analysis.proving import Region, Step, Verdict
from hfg.analysis.report import ActivityReport, analyse_activity
from hfg.analysis.timing import PathTime, TimeReport, analyse_time

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
