"""Many random state machines, by `make soak`: each accepts the same words as its graph, under a schedule of its own.

HFG_SOAK_MACHINES says how many (5,000).
"""

from __future__ import annotations

import os

import pytest
from hypothesis import given, settings

from hfg.activity import StateMachine
from tests.semantics.test_state_machines import accept_the_same, machines, schedules, words

MACHINES = int(os.environ.get("HFG_SOAK_MACHINES", "5000"))


@pytest.mark.soak
@settings(max_examples=MACHINES, deadline=None, database=None)
@given(machines(), words, schedules)
def test_machines_and_their_graphs_accept_the_same_words(
    machine: StateMachine, word: list[str], schedule: tuple[str, int | None]
) -> None:
    accept_the_same(machine, word, schedule)
