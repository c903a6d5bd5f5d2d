"""Edits of a graph that runs, at random moments, against the oracle and the plan made afresh (rule R4)."""

from __future__ import annotations

import pytest

from tests.support.edited import EditedRun
from tests.support.making import Allowed

pytestmark = pytest.mark.slow

SEQUENCES = 160
FOUND = (96132062, 771000000, 773100020, 773100053, 774500280, 51500087, 52200122, 61280105, 70630093)  # by the soak


@pytest.mark.rule("R4", "A8", "G1", "F5", "F8", "F10")
@pytest.mark.parametrize("block", range(20))
def test_an_edited_run_does_what_the_oracle_permits(block: int) -> None:
    for seed in range(block * SEQUENCES // 20, (block + 1) * SEQUENCES // 20):
        check(seed)


@pytest.mark.rule("R4", "R6", "T5")
@pytest.mark.parametrize("seed", FOUND)
def test_an_edited_run_that_once_differed_does_what_the_oracle_permits(seed: int) -> None:
    check(seed)


def check(seed: int) -> int:
    """Edit one run; gives how many edits were carried out."""
    allowed = Allowed(failures=seed % 3 == 0, waiting=seed % 2 == 0, doing=seed % 4 == 3, rings=seed % 7 == 5)
    if seed % 10 == 0:
        allowed = Allowed(threads=True, lossy=False, gates=False)
    edited = EditedRun(seed, allowed, quiet=seed % 3 == 1)
    edited.run()
    why = edited.difference()
    assert not edited.problems, f"seed {seed} of\n{edited.plan}\n" + "\n".join(edited.problems)
    assert why is None, f"seed {seed} of\n{edited.plan}\n\n{why}"
    return edited.carried_out
