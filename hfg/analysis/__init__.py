"""Analyses of a graph before it runs.

reading    what the code of a node type may send         game       activity as a token game
searching  its states, and which places go together      proving    proofs and counter-examples
report     the analysis of activity, for users
"""

from hfg.analysis.proving import Step, Verdict
from hfg.analysis.report import ActivityReport, Region, analyse_activity

__all__ = ["ActivityReport", "Region", "Step", "Verdict", "analyse_activity"]
