"""Many random graphs, by `make soak`: engine against oracle, each under its own schedule.

HFG_SOAK_GRAPHS says how many (20,000), HFG_SOAK_SEED where to begin; a failure prints its seed and the smallest
graph found.
"""

from __future__ import annotations

import importlib.util
import os
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.stateful import run_state_machine_as_test

from tests.support.machines import EngineAgainstOracle
from tests.support.making import WIDE, Allowed, random_plan

GRAPHS = int(os.environ.get("HFG_SOAK_GRAPHS", "20000"))
SEED = int(os.environ.get("HFG_SOAK_SEED", "1000000"))
BLOCKS = 40


def _random_graphs() -> ModuleType:
    path = Path(__file__).parents[1] / "semantics" / "test_random_graphs.py"
    spec = importlib.util.spec_from_file_location("soak_random_graphs", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.soak
@pytest.mark.timeout(900)
@pytest.mark.parametrize("block", range(BLOCKS))
def test_the_engine_does_what_the_oracle_permits(block: int) -> None:
    suite = _random_graphs()
    first = SEED + block * (GRAPHS // BLOCKS)
    print(f"seeds {first} to {first + GRAPHS // BLOCKS - 1}")
    for seed in range(first, first + GRAPHS // BLOCKS):
        base = WIDE if seed % 2 else Allowed()
        allowed = replace(base, threads=seed % 10 == 0, max_nodes=5 + seed % 6)
        allowed = replace(allowed, tasks=seed % 7 == 1, sending=seed % 3 == 0, doing=seed % 5 == 2)
        allowed = replace(allowed, rings=seed % 3 == 0)
        plan = random_plan(seed, allowed)
        if suite.reference(plan, seed) is not None:
            suite.check(plan, seed)


@pytest.mark.soak
@pytest.mark.timeout(900)
@pytest.mark.parametrize("block", range(BLOCKS))
def test_the_short_ways_do_the_same_as_the_general_way(block: int) -> None:
    suite = _random_graphs()
    first = SEED + block * (GRAPHS // BLOCKS)
    for seed in range(first, first + GRAPHS // BLOCKS):
        plan = random_plan(seed, Allowed(max_nodes=5 + seed % 6, doing=seed % 5 == 2))
        if suite.reference(plan, seed) is not None:
            suite.check(plan, seed, suite.short_ways_differ)


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_what_comes_from_outside_has_the_same_effect() -> None:
    run_state_machine_as_test(
        EngineAgainstOracle,
        settings=settings(
            max_examples=max(1, GRAPHS // 40),
            stateful_step_count=12,
            deadline=None,
            suppress_health_check=list(HealthCheck),
        ),
    )
