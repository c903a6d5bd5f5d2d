"""The mission: its steps alone, and short runs; the long ones are `soak`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hfg
from examples.follow_person.messages import Twist
from examples.follow_person.mission import build
from examples.follow_person.mission.finding import ObjectTracking, PersonDetection
from examples.follow_person.mission.following import FollowPerson, Path, PathFollower, PlanPath, steer
from examples.follow_person.perception.records import Look, Person, Scene
from examples.follow_person.running import Result, carry_out
from examples.follow_person.world import Conditions
from hfg.geometry import Grid, Transform
from hfg.nodes.estimation import Track
from hfg.testing import fire
from hfg.trace import ActivityChanged

RED, BLUE = Look((0.2, 0.2), (0.3, 0.3), 5), Look((0.6, 0.2), (0.3, 0.3), 5)


def track(number: int, x: float, y: float, vx: float = 1.0, *, missed: int = 0) -> Track:
    return Track(number, x, y, vx, 0.0, 0.1, 20, missed, abs(vx) > 0.3)


def scene(stamp: float, *tracks: Track, pose: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Scene:
    tops = {one.number: 1.7 for one in tracks}
    return Scene(stamp, np.array(pose), 0.0, 0.0, 0.0, list(tracks), tops)


def person(number: int = 1, x: float = 4.0, look: Look | None = RED, stamp: float = 0.0) -> Person:
    return Person(number, x, 0.0, 1.0, 0.0, stamp, look)


def grid() -> Grid:
    return Grid("base", 0.0, Transform.of(x=-10, y=-10), 0.1, np.zeros((200, 200), np.int8))


# --- who is followed


def tracking() -> ObjectTracking:
    node = ObjectTracking()
    fire(node, slot="found", value=person())
    return node


def test_the_person_is_where_the_track_is() -> None:
    ((name, found),) = fire(tracking(), scene=scene(0.1, track(1, 4.1, 0.0), track(2, 4.0, 2.0))).events
    assert (name, found.track, found.x) == ("person", 1, 4.1)


def test_a_person_out_of_sight_walks_on_for_a_while_and_is_lost_then() -> None:
    node = tracking()
    ((name, found),) = fire(node, scene=scene(1.0)).events
    assert (name, found.x, found.is_seen) == ("person", 5.0, False)
    ((name, found),) = fire(node, scene=scene(2.1)).events
    assert (name, found.x) == ("lost", 4.0)


def test_a_new_track_near_where_the_person_should_be_is_the_person_unless_it_wears_something_else() -> None:
    node = tracking()
    fire(node, slot="looks", value={7: BLUE, 8: RED})
    ((name, found),) = fire(node, scene=scene(0.5, track(7, 4.5, 0.1), track(8, 4.9, 0.4))).events
    assert (name, found.track) == ("person", 8)


def test_somebody_else_who_has_got_into_the_track_is_noticed_by_the_clothes() -> None:
    node = tracking()
    fire(node, slot="looks", value={1: BLUE, 2: RED})
    ((name, found),) = fire(node, scene=scene(0.1, track(1, 4.0, 0.0), track(2, 4.4, 0.5))).events
    assert (name, found.track) == ("person", 2)


def test_what_does_not_move_is_not_taken_for_a_person_who_was_not_seen_for_a_moment() -> None:
    assert fire(tracking(), scene=scene(0.3, track(9, 4.3, 0.0, 0.0))).events[0][1].is_seen is False


def test_a_lost_person_is_found_by_the_clothes_anywhere() -> None:
    node = PersonDetection()
    fire(node, slot="find", value=person(), active=True)
    fire(node, slot="looks", value={3: BLUE, 4: RED})
    ((name, found),) = fire(node, scene=scene(5.0, track(3, 4.0, 0.0), track(4, 9.0, -5.0))).events
    assert (name, found.track, found.look) == ("person", 4, RED)


def test_after_some_patience_it_is_worth_going_where_the_person_was_last() -> None:
    node = PersonDetection(patience=1.5)
    fire(node, slot="find", value=person(), active=True)
    assert fire(node, scene=scene(5.0)).events == []
    assert fire(node, scene=scene(6.5)).events == []
    ((name, gone),) = fire(node, scene=scene(6.6)).events
    assert (name, gone.x) == ("gone", 4.0)


# --- how


def plan(node: PlanPath, where: Person, pose: tuple[float, float, float] = (0, 0, 0)) -> Any:
    fire(node, grid=grid(), scene=scene(0.0, pose=pose))
    return fire(node, slot="person", value=where, active=True).events


def test_a_path_ends_before_the_person() -> None:
    ((name, path),) = plan(PlanPath(keeps=3.0), person(x=8.0))
    assert name == "path"
    assert math.dist(path.points[-1], (6.8, 0.0)) < 0.7
    assert path.spare == pytest.approx(1.8)
    assert path.pace == pytest.approx(1.0)


def test_a_path_is_in_the_frame_of_the_pose() -> None:
    ((_, path),) = plan(PlanPath(keeps=2.0), person(x=8.0), pose=(8.0, -6.0, math.pi / 2))
    assert path.points[0] == pytest.approx([8.0, -6.0])
    assert math.dist(path.points[-1], (8.0, -1.2)) < 0.7


def test_a_person_behind_the_robot_in_a_narrow_place_needs_a_planner_that_may_drive_back() -> None:
    values = np.zeros((200, 200), np.int8)
    values[:, 92] = values[:, 107] = 100  # a corridor
    around = Grid("base", 0.0, Transform.of(x=-10, y=-10), 0.1, values)
    for backward, expected in ((False, "none"), (True, "path")):
        node = PlanPath(backward=backward, margin=0.03, keeps=1.0)
        fire(node, grid=around, scene=scene(0.0))
        ((name, _),) = fire(node, slot="person", value=person(x=-4.0), active=True).events
        assert name == expected


def straight(pace: float = 0.0) -> Path:
    points = np.stack([np.arange(0.0, 6.1, 0.5), np.zeros(13)], 1)
    return Path(points, np.ones(13), pace)


def test_a_follower_drives_along_the_path_and_back_to_it() -> None:
    for y, sign in ((0.0, 0), (0.5, -1), (-0.5, 1)):
        twist, left = steer(straight(), scene(0.0, pose=(1.0, y, 0.0)), 2.5, 1.0, 2.0)
        assert twist.vx > 1
        assert np.sign(round(twist.omega, 6)) == sign
        assert left == pytest.approx(5.0, abs=0.3)


def test_a_follower_slows_down_at_the_end_as_far_as_the_person_does() -> None:
    near = scene(0.0, pose=(5.7, 0.0, 0.0))
    assert steer(straight(), near, 2.5, 1.0, 2.0)[0].vx < 0.5
    assert steer(straight(2.0), near, 2.5, 1.0, 2.0)[0].vx > 2.0


def test_a_follower_drives_back_where_the_path_leads_back() -> None:
    path = Path(np.array([[0.0, 0.0], [-0.6, 0.0], [-1.2, 0.0], [-0.6, 0.1]]), np.array([1, -1, -1, 1]), 0.0)
    assert steer(path, scene(0.0), 0.8, 0.5, 2.0)[0].vx < 0


def test_a_follower_is_preempted_only_by_the_path_that_it_follows() -> None:
    node, one, other = PathFollower(), straight(), straight()
    fire(node, slot="path", value=one)
    assert fire(node, slot="preempt", value=other, active=True).events == []
    assert fire(node, slot="preempt", value=one, active=True).events == [("done", None)]


def test_follow_person_follows_one_path_until_t_preempt_and_hands_the_activity_back() -> None:
    """Figure 23: the activity comes with the person, goes to the follower with the path, and leaves with done."""

    class Source(hfg.Node):
        grid, scene, first = hfg.Output(Grid), hfg.Output(Scene), hfg.Event(Person)

        def process(self) -> None:
            if hfg.elapsed() > 3:
                raise hfg.EndOfStream
            self.grid.send(grid())
            self.scene.send(scene(hfg.elapsed()))

        @hfg.slot
        def begin(self) -> None:
            """Take the activity."""

        @hfg.slot(while_active=True)
        def tick(self, scene: Scene) -> None:
            if scene.stamp > 0.15:
                self.first.trigger(person(x=8.0))

    class After(hfg.Node):
        @hfg.slot
        def begin(self) -> None:
            """Take the activity."""

    graph = hfg.Graph("figure 23")
    source = graph.add(Source(), name="source", max_rate_hz=10)
    follow, after = graph.add(FollowPerson(preempt_after=1.0), name="follow_fast"), graph.add(After(), name="after")
    graph.start.activates(source.begin)
    graph.connect(source.scene, source.tick)
    source.first.activates(follow.person)
    follow.done.activates(after.begin)
    follow.no_path.activates(after.begin)
    graph.connect(source.grid, follow.grid)
    graph.connect(source.scene, follow.scene)
    graph.connect(follow.command, graph.output("commands", Twist))
    seen: list[tuple[float, str]] = []

    def note(event: object) -> None:
        if isinstance(event, ActivityChanged) and event.active and event.node != "follow_fast":
            seen.append((round(event.time, 1), event.node))

    report = hfg.run(graph, clock="virtual", trace=note)
    names = [name for _, name in seen]
    assert names == ["source", "follow_fast/plan", "follow_fast/follow", "after"]
    assert seen[3][0] - seen[2][0] == pytest.approx(1.0)
    assert 9 <= len(report.outputs["commands"]) <= 11


# --- whole runs


def followed(course: Any, metres: float, seed: int = 1, **more: Any) -> Result:
    return carry_out(build(seed, metres=metres, conditions=Conditions(course=course, **more)))


def test_the_graph_has_no_errors_and_no_warnings() -> None:
    assert [problem for problem in build().check() if problem.severity != "hint"] == []


@pytest.mark.rule("A5")
def test_a_mission_in_two_steps_at_once_fails_and_says_how_that_came() -> None:
    graph = build(metres=1.0)
    graph.start.activates(graph["robot/object_tracking"].begin)
    result = carry_out(graph)
    assert result.outcome == "failed"
    assert result.error.startswith('monitor "one_step" is violated after 0 s: ')
    assert "0 s  robot/object_tracking  True" in result.error


@pytest.mark.slow
def test_the_robot_follows_the_person_who_was_chosen_at_the_start() -> None:
    result = followed("open", 25.0)
    assert result.outcome == "over", result.error
    assert result.score is not None
    assert result.score.contacts == 0
    assert result.verdict.chosen_s is not None
    assert result.verdict.lost == 0
    assert result.verdict.wrong_s == 0
    assert min(result.score.distances) > 2
    assert max(result.score.speeds) > 2.2


@pytest.mark.slow
def test_the_same_seed_gives_the_same_run() -> None:
    one, other = (followed("dense", 8.0, seed=3) for _ in range(2))
    assert one.score is not None
    assert other.score is not None
    assert one.score.distances == other.score.distances
    assert one.score.speeds == other.score.speeds
