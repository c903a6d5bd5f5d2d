"""Help for tests of nodes and graphs, and the oracle that hfg itself is tested against.

    firing         fire one node without a graph
    diagrams       token diagrams: drive a node by lines of characters
    recording      a recorder for traces
    invariants     what holds in every run
    exploring      run a graph under many schedules, give the smallest that fails
    strategies     Hypothesis: graphs, tokens, schedules      making, plans: what they stand on
    nodes          small deterministic node types
    reference      the oracle: the rules as a machine of permitted moves
    conformance    replay the trace of a run on the oracle
    waves          the same, and that waves go depth first (R2)
    pytest_plugin  fixtures and the `rule` mark

Sees all of hfg; nothing of hfg sees it. `strategies` needs hypothesis and is imported when it is used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hfg.testing import diagrams, invariants
from hfg.testing.conformance import Divergence, Replay, replay
from hfg.testing.exploring import Exploration, ScheduleFailure, explore
from hfg.testing.firing import Firing, fire
from hfg.testing.recording import Recorder, recorder
from hfg.testing.reference import ReferenceMachine, ReferenceReport, reference_run

if TYPE_CHECKING:
    from hfg.testing.strategies import graphs, schedules, tokens

__all__ = [
    "Divergence",
    "Exploration",
    "Firing",
    "Recorder",
    "ReferenceMachine",
    "ReferenceReport",
    "Replay",
    "ScheduleFailure",
    "diagrams",
    "explore",
    "fire",
    "graphs",
    "invariants",
    "recorder",
    "reference_run",
    "replay",
    "schedules",
    "tokens",
]


def __getattr__(name: str) -> Any:
    if name in ("graphs", "schedules", "tokens"):
        from hfg.testing import strategies

        return getattr(strategies, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
