"""Help for tests of nodes and graphs, and the oracle that hfg itself is tested against.

    firing         fire one node without a graph
    values         Hypothesis: values of the type hints of ports and parameters
    samples        files of many kinds, for nodes that read some
    trying         fire a node type with such values, and check it against its declaration
    usable         the same for many types, in processes of their own
    diagrams       token diagrams: drive a node by lines of characters
    recording      a recorder for traces
    invariants     what holds in every run
    activity       play a counter-example of the analysis of activity in the engine
    exploring      run a graph under many schedules, give the smallest that fails
    judging        run a graph under monitors
    strategies     Hypothesis: graphs, tokens, schedules      making, plans: their basis
    nodes          small deterministic node types
    reference      the oracle: the rules as a machine of permitted moves
    conformance    replay the trace of a run on the oracle
    transports     the tests that any transport passes
    pytest_plugin  fixtures and the `rule` mark

Sees all of hfg; nothing of hfg sees it. Modules that need hypothesis are imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from hfg.base.lazy import on_demand
from hfg.testing import diagrams, invariants
from hfg.testing.activity import ActivityReplay, replay_activity
from hfg.testing.conformance import Divergence, Replay, replay
from hfg.testing.exploring import Exploration, ScheduleFailure, explore
from hfg.testing.firing import Firing, fire
from hfg.testing.judging import judge_run
from hfg.testing.recording import Recorder, recorder
from hfg.testing.reference import ReferenceMachine, ReferenceReport, reference_run

if TYPE_CHECKING:
    from hfg.testing.strategies import graphs, schedules, tokens
    from hfg.testing.trying import NotUsable, Trial, try_type
    from hfg.testing.values import values_of

__all__ = [
    "ActivityReplay",
    "Divergence",
    "Exploration",
    "Firing",
    "NotUsable",
    "Recorder",
    "ReferenceMachine",
    "ReferenceReport",
    "Replay",
    "ScheduleFailure",
    "Trial",
    "diagrams",
    "explore",
    "fire",
    "graphs",
    "invariants",
    "judge_run",
    "recorder",
    "reference_run",
    "replay",
    "replay_activity",
    "schedules",
    "tokens",
    "try_type",
    "values_of",
]

# what needs hypothesis
if not TYPE_CHECKING:
    __getattr__ = on_demand(
        __name__,
        {
            "strategies": ("graphs", "schedules", "tokens"),
            "trying": ("NotUsable", "Trial", "try_type"),
            "values": ("values_of",),
        },
    )
