"""What `hfg tune` needs of the robot that follows a person: a graph with the parameters, and a score."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from examples.follow_person.tuning import off_m, walk
from examples.follow_person.world import Score
from hfg.tuning import Finished


def test_the_score_is_by_how_much_the_distance_is_missed_and_what_contacts_cost() -> None:
    graph = walk()
    world: Any = graph["world"]
    world.simulation = SimpleNamespace(score=Score(distances=[3.2, 4.2, 2.2, 3.2], contact_s=0.1))
    report: Any = None
    assert off_m(Finished(graph, report, 1)) == pytest.approx(0.5 + 0.5)
    world.simulation.score = Score()  # the robot has never moved
    assert off_m(Finished(graph, report, 1)) > 40


def test_the_walk_has_the_values_by_hand_that_the_page_states() -> None:
    graph = walk()
    inner: list[Any] = [graph[f"robot/follow_fast/{name}"] for name in ("follow", "delay", "plan")]
    follow, delay, plan = inner
    assert (follow.look_ahead, follow.sideways, delay.seconds, plan.margin) == (1.0, 2.0, 1.0, 0.12)
