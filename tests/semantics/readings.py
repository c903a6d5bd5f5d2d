"""Engine and oracle as two readers of the rules: the same small graph for both, and what to read off a run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import hfg
from hfg.testing import Recorder, recorder, reference_run
from hfg.trace import FiringStarted, TokenSent

Perform: TypeAlias = Callable[[Callable[[], hfg.Graph], Callable[[Recorder], Any]], Any]
"""Runs what a function builds under many schedules and gives what is read off each run, the same for all."""

SEEDS = range(8)


def by_engine(graph: hfg.Graph, seed: int) -> Recorder:
    seen = recorder()
    try:
        hfg.run(graph, clock="virtual", policy="random", seed=seed, trace=seen)
    except hfg.errors.RunError:
        assert seen.outcome is not None
    return seen


def by_oracle(graph: hfg.Graph, seed: int) -> Recorder:
    seen = recorder()
    seen.extend(reference_run(graph, seed=seed, max_moves=5000).events)
    return seen


def under_every_schedule(reader: Callable[[hfg.Graph, int], Recorder]) -> Perform:
    def perform(build: Callable[[], hfg.Graph], read: Callable[[Recorder], Any]) -> Any:
        found = [read(reader(build(), seed)) for seed in SEEDS]
        assert all(one == found[0] for one in found), found
        return found[0]

    return perform


def starts(seen: Recorder, node: str, *, kind: str | None = None) -> list[float]:
    """When the firings of a node began."""
    return [
        round(event.time, 6) for event in seen.of(FiringStarted) if event.node == node and kind in (None, event.kind)
    ]


def signs(seen: Recorder, edge: str) -> list[tuple[Any, int]]:
    return [(token.value, token.activity) for token in seen.tokens(edge)]


def sent(seen: Recorder, edge: str) -> list[tuple[float, Any]]:
    """When what was put on an edge."""
    return [(round(event.time, 6), event.token.value) for event in seen.of(TokenSent) if event.edge == edge]
