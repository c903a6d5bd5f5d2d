"""Monitors: conditions over a run in the model's own words, judged while it runs.

formulas     what is true at a point: activity, values, firings, and what was true before
compiling    a formula as one function
properties   patterns over formulas, and what judges them
watching     lets them be judged in a run
facts        the facts that are stated in the graph, in debug runs

Examples:
  >>> from hfg import monitors as m
  >>> print(m.leads_to(m.sent("fetch.done"), m.sent("deliver.done") | m.sent("mission.report"), within_s=300))
  leads_to(sent(fetch.done), (sent(deliver.done) | sent(mission.report)), within_s=300)
"""

from hfg.monitors.formulas import (
    Formula,
    active,
    at_least,
    fired,
    once,
    previously,
    sent,
    since,
    throughout,
)
from hfg.monitors.properties import Property, Verdict, always, eventually, leads_to, never, precedes, until
from hfg.monitors.watching import Monitors, Seen, Violation, watch

__all__ = [
    "Formula",
    "Monitors",
    "Property",
    "Seen",
    "Verdict",
    "Violation",
    "active",
    "always",
    "at_least",
    "eventually",
    "fired",
    "leads_to",
    "never",
    "once",
    "precedes",
    "previously",
    "sent",
    "since",
    "throughout",
    "until",
    "watch",
]
