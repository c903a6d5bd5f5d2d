"""Comparing two runs, or runs of two versions of a graph: scores, tokens, counts, activity, the graphs.

sides      what is known of each side: of a recording, of a report, or of runs that are made for it
tokens     the first token that differs, port by port
comparing  one side against the other
page       the result as a page
"""

from hfg.comparing.comparing import Comparison, compare
from hfg.comparing.page import page
from hfg.comparing.sides import Side, read_recording, read_report, run_both

__all__ = ["Comparison", "Side", "compare", "page", "read_recording", "read_report", "run_both"]
