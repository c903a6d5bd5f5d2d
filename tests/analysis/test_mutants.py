"""Broken copies of the delivery mission are all found, and the counter-examples are real (rules A3-A12, G2)."""

from __future__ import annotations

import pytest

import hfg
from examples.fetch_delivery.mission import build
from hfg.errors import UsageError
from hfg.testing import replay_activity
from tests.analysis.exhaustive import draw
from tests.analysis.mutants import MUTANTS, broken

BREAKS = set(list(MUTANTS)[:8])
"""Those with an active edge too many; the others show as a finding."""


@pytest.fixture(scope="module")
def sound() -> set[tuple[str, str]]:
    """The problems of the mission as it is."""
    graph = build()
    return {(one.path, one.check) for one in (*graph.check(), *hfg.analyse_activity(graph).problems)}


@pytest.mark.parametrize("name", MUTANTS)
def test_a_broken_copy_of_the_mission_is_found(name: str, sound: set[tuple[str, str]]) -> None:
    graph = broken(name)
    report = hfg.analyse_activity(graph, max_states=1_000)
    found = report.at_most_one("robot_0")
    assert found.holds is (name not in BREAKS)
    if name in BREAKS:
        replay = replay_activity(graph, found)
        assert replay.most == 2
        assert len(replay.active) == 2
    else:
        new = {(one.path, one.check) for one in report.problems} - sound
        assert new, "nothing was found in it"


def test_counter_examples_of_random_graphs_happen_in_the_engine() -> None:
    replayed = 0
    for seed in range(60):
        drawn = draw(seed)
        for region in hfg.analyse_activity(drawn.graph, max_states=500).regions if drawn.is_plain else ():
            if region.at_most_one.holds is False:
                assert replay_activity(drawn.graph, region.at_most_one).most > 1, seed
                replayed += 1
            if region.exactly_one.holds is False and region.begins:
                replay = replay_activity(drawn.graph, region.exactly_one)
                assert replay.most > 1 or replay.least == 0, seed
    assert replayed > 15


@pytest.mark.rule("A4", "F9", "A10")
def test_counter_examples_with_explicit_modifiers_happen_in_the_engine() -> None:
    """Activity waits on an edge until the counter-example takes it."""
    replayed = 0
    for seed in range(250):
        drawn = draw(seed)
        for region in hfg.analyse_activity(drawn.graph, max_states=300).regions if not drawn.is_plain else ():
            if region.at_most_one.holds is False:
                replay = replay_activity(drawn.graph, region.at_most_one)
                assert replay.most > 1, (seed, replay.unknown)
                assert replay.unknown == ""
                replayed += 1
    assert replayed > 50


def test_what_is_proved_cannot_be_replayed() -> None:
    graph = build()
    with pytest.raises(UsageError, match="no counter-example was found: at most one of 47 nodes"):
        replay_activity(graph, hfg.analyse_activity(graph).at_most_one("robot_0"))
