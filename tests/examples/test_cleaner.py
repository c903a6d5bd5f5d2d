"""The vacuum cleaner as activity, as a state machine, and without hfg: one mission (A3, A5, A11, A12, A13)."""

from __future__ import annotations

import asyncio

import pytest

import hfg
from examples import cleaner
from hfg.testing import recorder
from tests.examples import plain_cleaner as plain
from tests.examples.lengths import lines_of_code

Timeline = list[tuple[float, str]]


def states_of(graph: hfg.Graph) -> Timeline:
    """Run it; when which state became active."""
    trace = recorder()
    assert hfg.run(graph, clock="virtual", trace=trace).outcome == "stopped"
    return [(round(event[0], 6), event[1]) for event in trace.activity() if event[2] and event[1] != "clean"]


def states_without_hfg(seed: int) -> Timeline:
    mission = plain.Cleaner(cleaner.World(seed))
    assert asyncio.run(mission.run()) == "stopped"
    return [(round(now, 6), state) for now, state in mission.timeline if state != "clean"]


@pytest.mark.slow
@pytest.mark.rule("A3", "A5", "A11", "A12", "A13")
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("by_letters", [False, True])
def test_the_room_is_cleaned_in_the_same_way(by_letters: bool, seed: int) -> None:
    assert states_of(cleaner.build(seed, by_letters)) == states_without_hfg(seed)


@pytest.mark.slow
@pytest.mark.rule("A12")
def test_who_does_not_find_home_aborts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cleaner, "AT_HOME", -1.0)
    for by_letters in (False, True):
        with pytest.raises(hfg.errors.RunError):
            hfg.run(cleaner.build(by_letters=by_letters), clock="virtual")


def test_the_machine_has_no_state_that_is_never_reached() -> None:
    assert cleaner.MACHINE.check() == []
    assert cleaner.MACHINE.accepts(["dirty", "swept", "finished"])


def test_neither_is_longer_than_by_hand() -> None:
    by_hand = lines_of_code(plain, "CleanerError", "after_roam", "after_spot", "after_go_home", "after_charge", "State")
    by_hand += lines_of_code(plain, "STATES", "Cleaner")
    by_letters = lines_of_code(cleaner, "MACHINE", "BEHAVIOURS", "GoingHome", "Judge", "_by_letters", "Room")
    behaviours = lines_of_code(cleaner, "Behaviour", "Roam", "BackOff", "Spot", "GoHome", "Charge")
    by_activity = behaviours + lines_of_code(cleaner, "_by_activity", "Room")
    assert by_letters <= by_hand
    assert by_activity <= by_hand, (by_activity, by_letters, by_hand)
