"""Many random edits of running graphs, by `make soak`: engine against oracle, plan against the plan made afresh.

HFG_SOAK_COMMANDS says how many (100,000), HFG_SOAK_SEED where to begin; a failure prints its seed.
"""

from __future__ import annotations

import os

import pytest

from tests.semantics.test_edits import check

COMMANDS = int(os.environ.get("HFG_SOAK_COMMANDS", "100000"))
SEED = int(os.environ.get("HFG_SOAK_SEED", "1000000"))
BLOCKS = 40


@pytest.mark.soak
@pytest.mark.parametrize("block", range(BLOCKS))
def test_edited_runs_do_what_the_oracle_permits(block: int) -> None:
    seed = SEED + block * COMMANDS
    done = 0
    while done < COMMANDS // BLOCKS:
        done += check(seed)
        seed += 1
    print(f"{done} edits, up to seed {seed - 1}")
