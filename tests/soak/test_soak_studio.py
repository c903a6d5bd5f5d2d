"""Replicas of two pages of a studio after many more sequences of edits, cuts and restarts, by `make soak`.

HFG_SOAK_SEQUENCES says how many (5,000), HFG_SOAK_SEED where to begin; a failure prints its seed.
"""

from __future__ import annotations

import os

import pytest

from tests.studio.page import live
from tests.studio.test_replicas import walk, walk_running

SEQUENCES = int(os.environ.get("HFG_SOAK_SEQUENCES", "5000"))
SEED = int(os.environ.get("HFG_SOAK_SEED", "1000000"))
BLOCKS = 50


@pytest.mark.soak
@pytest.mark.parametrize("block", range(BLOCKS))
def test_replicas_of_two_pages_are_the_graph(block: int) -> None:
    for seed in range(SEED + block * SEQUENCES // BLOCKS, SEED + (block + 1) * SEQUENCES // BLOCKS):
        print(f"seed {seed}")
        live(lambda seed=seed: walk(seed, steps=30))  # type: ignore[misc]
        if seed % 10 == 0:
            live(lambda seed=seed: walk_running(seed, steps=30))  # type: ignore[misc]
