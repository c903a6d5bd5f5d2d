"""What must hold of every mission holds of one, and is violated by a mission that breaks it."""

from __future__ import annotations

import pytest

import hfg
from examples.fetch_delivery.mission import build
from examples.fetch_delivery.mission.conditions import conditions, steps
from examples.fetch_delivery.mission.robot import Robot
from hfg import monitors as m
from hfg.monitors import Verdict


def judged(graph: hfg.Graph, seconds: float, **others: m.Property) -> m.Monitors:
    """Run a mission, with monitors for its first robot."""
    found: list[m.Monitors] = []

    def begin(run: hfg.Run) -> None:
        found.append(m.watch(run, on_violation="note", **conditions(graph["robot_0"]), **others))

    hfg.run(graph, clock="virtual", until_s=seconds, begin=begin, block_warning_s=0)
    return found[0]


@pytest.mark.slow
def test_a_mission_keeps_to_its_conditions_which_are_not_empty() -> None:
    lit, number = m.sent("robot_0.lamp", lambda on: on), m.sent("robot_0/read_cube.received")
    found = judged(build(), 90, unlit=m.never(lit), unread=m.never(number), still=m.never(m.sent("robot_0.command")))
    own = {name: verdict for name, verdict in found.verdicts.items() if name not in ("unlit", "unread", "still")}
    assert set(own.values()) <= {Verdict.HOLDS, Verdict.OPEN}, [str(violation) for violation in found.violations]
    assert len(own) > 20
    assert [found.verdicts[name] for name in ("unlit", "unread", "still")] == [Verdict.VIOLATED] * 3


def test_the_steps_are_all_nodes_that_activity_can_come_to() -> None:
    graph = build()
    found = {f"robot_0/{step}" for step in steps(graph["robot_0"])}
    assert found == {path for region in hfg.analyse_activity(graph).regions for path in region.nodes}


class OfTwoMinds(Robot):
    """Begins with two steps at once, which no mission may."""

    def build(self, graph: hfg.Graph) -> None:
        super().build(graph)
        self.begin.inner.activates(graph["advance"].begin)


def test_a_mission_in_two_steps_at_once_is_found() -> None:
    found = judged(build(kind=OfTwoMinds), 1)
    assert found.verdicts["one_step"] is Verdict.VIOLATED
    assert {seen.what for seen in found.violations[0].stretch} == {"robot_0/wait_for_start", "robot_0/advance"}
