"""Many random graphs, by `make soak`: code, file, graph, file is the same text, and both run alike.

HFG_SOAK_FILES says how many (5,000), HFG_SOAK_SEED where to begin; a failure prints the smallest graph found.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.files.programs import difference, plan_of
from tests.files.test_round_trip import smallest

GRAPHS = int(os.environ.get("HFG_SOAK_FILES", "5000"))
SEED = int(os.environ.get("HFG_SOAK_SEED", "1000000"))
BLOCKS = 20


@pytest.mark.soak
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("block", range(BLOCKS))
def test_random_graphs_come_back_as_they_are(block: int, tmp_path: Path) -> None:
    first = SEED + block * (GRAPHS // BLOCKS)
    print(f"seeds {first} to {first + GRAPHS // BLOCKS - 1}")
    for seed in range(first, first + GRAPHS // BLOCKS):
        plan = plan_of(seed)
        if plan is not None and difference(plan, seed, tmp_path / "graph.hfg.yaml") is not None:
            pytest.fail(smallest(plan, seed, tmp_path), pytrace=False)
