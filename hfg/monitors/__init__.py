"""Monitors: conditions over a run in the model's own words, judged while it runs.

formulas     what is true at a point: activity, values, firings, and what was true before
compiling    a formula as one function
properties   patterns over formulas, and what judges them
parsing      reads them from text
margins      how far a run is from violating a property
violations   what has shown that a property does not hold
listening    one of them in a run: what it hears, and its judge
gathering    one over several processes: its points are judged in the order of their times
watching     lets them be judged in a run; needs the engine, so it is imported when it is used
judging      judges each run of a graph by the monitors that the graph declares
facts        the facts that are stated in the graph, in debug runs

Examples:
  >>> from hfg import monitors as m
  >>> print(m.leads_to(m.sent("fetch.done"), m.sent("deliver.done") | m.sent("mission.report"), within_s=300))
  leads_to(sent(fetch.done), sent(deliver.done) | sent(mission.report), within_s=300)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hfg.base.lazy import on_demand
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
from hfg.monitors.margins import measured
from hfg.monitors.parsing import parse
from hfg.monitors.properties import Property, Verdict, always, eventually, leads_to, never, precedes, until

if TYPE_CHECKING:
    from hfg.monitors.judging import declared
    from hfg.monitors.violations import Seen, Violation
    from hfg.monitors.watching import Monitors, watch
else:
    __getattr__ = on_demand(
        __name__, {"judging": ("declared",), "violations": ("Seen", "Violation"), "watching": ("Monitors", "watch")}
    )

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
    "declared",
    "eventually",
    "fired",
    "leads_to",
    "measured",
    "never",
    "once",
    "parse",
    "precedes",
    "previously",
    "sent",
    "since",
    "throughout",
    "until",
    "watch",
]
