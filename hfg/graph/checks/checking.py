"""What only the whole shows: every check is a function over the flat graph that gives what it finds.

An error keeps the graph from running as its structure says; warnings and hints are reported and the graph runs. Layers
above add their own with `also`. Depends on `flat`, `edges`, `flow` and `nodes`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final, TypeAlias

from hfg.base.hooks import hooks
from hfg.errors import SEVERITIES, Problem
from hfg.graph.checks.changing import changed_inputs
from hfg.graph.checks.edges import borders, joined_edges, promotions, unseen_parameters
from hfg.graph.checks.flow import (
    endless_sources,
    filling_rings,
    signal_rings,
    silent_events,
    synchronous_rings,
    unconnected_graph,
    unconnected_inputs,
    unfed_slots,
    waiting_rings,
)
from hfg.graph.checks.ledgers import kept_groups
from hfg.graph.checks.monitors import monitors
from hfg.graph.checks.nodes import (
    async_in_threads,
    concurrent_firings,
    empty_subgraphs,
    limits_without_effect,
    missing_process,
    names,
    unknown_attributes,
    unknown_groups,
    unused_scheduling,
)
from hfg.graph.checks.processes import process_borders
from hfg.graph.flat import FlatGraph, flatten
from hfg.graph.structure.level import HasLevel

Check: TypeAlias = Callable[[FlatGraph], Iterable[Problem]]

_OF_EACH_LEVEL: Final[list[Check]] = [
    unknown_groups,
    async_in_threads,
    missing_process,
    limits_without_effect,
    unknown_attributes,
    empty_subgraphs,
    concurrent_firings,
    joined_edges,
    unseen_parameters,
    synchronous_rings,
    borders,
    unconnected_inputs,
    unconnected_graph,
    signal_rings,
    filling_rings,
    silent_events,
    endless_sources,
    unfed_slots,
    waiting_rings,
]
_OF_THE_WHOLE: Final[list[Check]] = [
    unused_scheduling,
    names,
    promotions,
    changed_inputs,
    process_borders,
    kept_groups,
    monitors,
]


def also(check: Check) -> Check:
    """Add a check, of the graph and of each that iterates inside it."""
    _OF_EACH_LEVEL.append(check)
    return check


def check(graph: HasLevel) -> list[Problem]:
    """Check a whole graph; the worst first."""
    return check_flat(flatten(graph))


def check_flat(flat: FlatGraph) -> list[Problem]:
    """Check a graph that is flattened already; the worst first."""
    hooks.add_checks()
    problems = list(flat.findings)
    for one in flat.walk():
        for look in _OF_EACH_LEVEL:
            problems += look(one)
    for look in _OF_THE_WHOLE:
        problems += look(flat)
    return sorted(problems, key=lambda problem: SEVERITIES.index(problem.severity))
