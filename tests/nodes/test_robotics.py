"""The family `robotics`: scans, where a robot is on a map, where things are, paths."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from hfg.nodes import robotics
from hfg.nodes.robotics import Landmark
from hfg.testing import fire

ANGLES = np.radians(np.linspace(-135, 135, 271))
ROOM = np.array(
    [[(0, 0), (8, 0)], [(8, 0), (8, 5)], [(8, 5), (3, 5)], [(3, 5), (3, 4)], [(3, 4), (0, 4)], [(0, 4), (0, 0)]], float
)


def scan(pose: Any, rng: np.random.Generator, disks: Any = (), segments: Any = ROOM) -> Any:
    """What a laser with a noise of 1 cm measures among walls and disks of 0.25 m."""
    ranges = robotics.expected_ranges.function(np.asarray(pose, float), ANGLES, segments)
    for x, y in disks:
        rays = np.stack([np.cos(pose[2] + ANGLES), np.sin(pose[2] + ANGLES)], 1)
        to = np.array([x - pose[0], y - pose[1]])
        along = rays @ to
        square = 0.25**2 - (to @ to - along**2)
        hit = (square > 0) & (along > 0)
        ranges = np.where(hit, np.minimum(ranges, along - np.sqrt(np.maximum(square, 0))), ranges)
    return ranges + rng.normal(0, 0.01, len(ranges))


def placed(points: Any, pose: Any) -> Any:
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return points @ np.array([[cos, sin], [-sin, cos]]) + np.asarray(pose[:2])


def test_points_are_ahead_and_to_the_left_and_beams_that_hit_nothing_have_none() -> None:
    ranges = np.array([1.0, 2.0, np.nan, np.inf, -1.0, 0.0, 30.0, 3.0])
    angles = np.array([0.0, math.pi / 2, 0, 0, 0, 0, 0, math.pi])
    points = fire(robotics.scan_points(), ranges=ranges, angles=angles).outputs["out"]
    assert np.allclose(points, [(1, 0), (0, 2), (-3, 0)])
    with pytest.raises(ValueError, match="each range has an angle, got 8 ranges and 7 angles"):
        fire(robotics.scan_points(), ranges=ranges, angles=angles[1:])


def test_the_nearest_of_a_sector_is_told_also_across_the_back() -> None:
    angles = np.array([-3.1, -0.2, 0.0, 0.3, 3.0])
    ranges = np.array([1.5, 2.0, np.nan, 0.5, 1.0])
    nearest = robotics.nearest_obstacle.function
    assert nearest(ranges, angles, width=0.5) == 2.0
    assert nearest(ranges, angles, width=0.7) == 0.5
    assert nearest(ranges, angles, direction=-3.1, width=0.5) == 1.0
    assert nearest(ranges, angles, direction=1.5, width=0.2) == math.inf
    assert nearest(ranges * np.nan, angles) == math.inf


def test_beams_end_at_the_nearest_wall() -> None:
    ranges = fire(
        robotics.expected_ranges(), pose=np.array([1.0, 1.0, 0.0]), angles=np.array([0, math.pi / 2, math.pi, -0.1]),
        segments=ROOM,
    ).outputs["out"]  # fmt: skip
    assert np.allclose(ranges, [7, 3, 1, 7 / math.cos(0.1)])
    nothing = robotics.expected_ranges.function(np.zeros(3), ANGLES, ROOM[:0])
    assert (nothing == 30).all()


def test_disks_are_found_where_they_are() -> None:
    """200 scans of a room with two disks: of those that stand free within 4 m all but 1 % are found, within 2 cm."""
    rng = np.random.default_rng(1)
    off, missed, invented = [], 0, 0
    for _ in range(200):
        pose = np.array([*rng.uniform((1, 1), (7, 3)), rng.uniform(-math.pi, math.pi)])
        disks = [at for at in rng.uniform((0.6, 0.6), (7.4, 3.4), (2, 2)) if np.hypot(*(at - pose[:2])) > 0.6]
        ranges = scan(pose, rng, disks)
        nearer = ranges < robotics.expected_ranges.function(pose, ANGLES, ROOM) - 0.1
        points = robotics.scan_points.function(ranges[nearer], ANGLES[nearer])
        found = robotics.find_disks.function(points)
        places = placed(np.array([(one.x, one.y) for one in found]).reshape(-1, 2), pose)
        for number, at in enumerate(disks):
            to = at - pose[:2]
            bearing = abs(math.remainder(math.atan2(to[1], to[0]) - pose[2], 2 * math.pi))
            others = [other - pose[:2] for index, other in enumerate(disks) if index != number]
            free = all(to @ one < 0.6 * np.hypot(*to) * np.hypot(*one) for one in others)
            if bearing < 2.1 and free and np.hypot(*to) < 4:
                far = min((np.hypot(*(place - at)) for place in places), default=9.0)
                missed += far > 0.2
                off += [far] if far <= 0.2 else []
        invented += sum(all(np.hypot(*(place - at)) > 0.2 for at in disks) for place in places)
    assert len(off) > 100
    assert missed <= 0.01 * (len(off) + missed)
    assert invented <= 2
    assert max(off) < 0.02


def test_a_wall_is_no_disk_and_no_points_are_none() -> None:
    wall = np.stack([np.full(40, 2.0), np.linspace(-1, 1, 40)], 1)
    assert robotics.find_disks.function(wall) == []
    assert robotics.find_disks.function(np.zeros((0, 2))) == []
    assert robotics.find_disks.function(np.full((9, 2), np.nan)) == []
    with pytest.raises(ValueError, match="a laser is at one place, got 3"):
        robotics.find_disks.function(wall, wall[:3])


@pytest.mark.slow
def test_a_scan_is_laid_onto_the_map_though_much_of_it_is_hidden() -> None:
    """200 poses, guesses off by up to 0.2 m and 6 degrees, three disks in the way: all within 2 cm and 0.6 degrees."""
    rng = np.random.default_rng(2)
    errors = []
    for _ in range(200):
        pose = np.array([*rng.uniform((1, 1), (7, 3)), rng.uniform(-math.pi, math.pi)])
        disks = [at for at in rng.uniform((0.5, 0.5), (7.5, 3.5), (3, 2)) if np.hypot(*(at - pose[:2])) > 0.7]
        points = robotics.scan_points.function(scan(pose, rng, disks), ANGLES)
        guess = pose + rng.uniform((-0.14, -0.14, -0.1), (0.14, 0.14, 0.1))
        match = robotics.match_scan.function(points, guess, ROOM)
        error = match.pose - pose
        error[2] = math.remainder(error[2], 2 * math.pi)
        errors.append((*np.abs(error), match.share, error @ np.linalg.inv(match.covariance) @ error))
    off = np.array(errors)
    assert off[:, :2].max() < 0.02
    assert off[:, 2].max() < 0.01
    assert off[:, 3].min() > 0.3
    assert off[:, 4].mean() < 6  # 3 is a covariance that is exactly right, more is one that promises too much


def test_along_a_corridor_only_the_guess_knows_and_the_covariance_says_so() -> None:
    corridor = np.array([[(-50, 0), (50, 0)], [(-50, 2), (50, 2)]], float)
    pose = np.array([0.0, 1.0, 0.0])
    points = robotics.scan_points.function(scan(pose, np.random.default_rng(3), segments=corridor), ANGLES)
    guess = pose + np.array([0.1, 0.1, 0.05])
    match = robotics.match_scan.function(points, guess, corridor, np.diag([0.04, 0.04, 0.01]))
    assert abs(match.pose[1] - 1) < 0.01
    assert abs(match.pose[2]) < 0.005
    assert abs(match.pose[0] - 0.1) < 0.02  # as guessed
    assert math.sqrt(match.covariance[0, 0]) > 0.19
    assert math.sqrt(match.covariance[1, 1]) < 0.01


def test_what_cannot_be_matched_is_the_guess_and_what_is_no_guess_is_refused() -> None:
    guess = np.array([1.0, 2.0, 0.5])
    match = fire(robotics.match_scan(), points=np.full((9, 2), np.nan), guess=guess, segments=ROOM).outputs["out"]
    assert match.share == 0
    assert (match.pose == guess).all()
    with pytest.raises(ValueError, match="finite numbers, got"):
        robotics.match_scan.function(np.ones((5, 2)), guess * np.nan, ROOM)
    with pytest.raises(ValueError, match="a covariance is symmetric and positive"):
        robotics.match_scan.function(np.ones((5, 2)), guess, ROOM, np.zeros((3, 3)))


def test_a_landmark_is_known_by_the_place_of_most_sightings() -> None:
    rng = np.random.default_rng(4)
    node = robotics.LandmarkMap(least=3.0)
    known: Any = {}
    for number in range(60):
        at = (2.0, 3.0) if number % 6 else rng.uniform(-5, 5, 2)  # one in six is something else
        x, y = at + rng.normal(0, 0.1, 2)
        known = fire(node, seen=[Landmark("3", x, y, rng.normal(1.0, 0.1), 0.1)]).outputs["known"]
    assert set(known) == {"3"}
    assert math.hypot(known["3"].x - 2, known["3"].y - 3) < 0.06
    assert abs(known["3"].heading - 1) < 0.1
    assert known["3"].sigma < 0.05
    assert known["3"].sightings > 30


def test_a_landmark_that_was_moved_is_learned_again_and_one_that_is_forgotten_is_gone() -> None:
    node = robotics.LandmarkMap()
    for _ in range(10):
        fire(node, seen=[Landmark("A", 0.0, 0.0), Landmark("B", 1.0, 1.0)])
    for _ in range(40):
        known = fire(node, seen=[Landmark("A", 4.0, 0.0)]).outputs["known"]
    assert abs(known["A"].x - 4) < 0.1
    assert known["B"].x == 1
    fire(node, slot="forget", value="A")
    assert set(fire(node, seen=[]).outputs["known"]) == {"B"}
    fire(node, slot="forget", value="")
    assert fire(node, seen=[Landmark("A", math.nan, 0.0)]).outputs["known"] == {}


def test_one_sighting_makes_nothing_known() -> None:
    assert fire(robotics.LandmarkMap(), seen=[Landmark("A", 1.0, 1.0)]).outputs["known"] == {}


def test_a_landmark_of_which_nothing_is_known_is_left_out() -> None:
    """A sigma whose square no float can hold says as much as none."""
    sure = [Landmark("A", 1.0, 1.0)] * 3
    found = fire(robotics.LandmarkMap(), seen=[*sure, Landmark("A", 9.0, 9.0, sigma=1e300)]).outputs["known"]
    assert (found["A"].x, found["A"].y) == (1.0, 1.0)


def test_a_path_goes_through_the_gap_and_ends_at_the_goal() -> None:
    costs = np.ones((40, 40))
    costs[20, :30] = np.inf
    path = fire(robotics.plan_path(), costs=costs, start=np.array([1.0, 1.0]), goal=np.array([3.0, 1.0])).outputs["out"]
    assert path[0].tolist() == [1, 1]
    assert path[-1].tolist() == [3, 1]
    assert path[:, 1].max() > 2.99  # the gap begins at 3
    assert np.hypot(*np.diff(path, axis=0).T).max() < 0.2
    cells = (path / 0.1).astype(int)
    assert np.isfinite(costs[cells[:, 0], cells[:, 1]]).all()
    costs[20, :] = np.nan
    assert robotics.plan_path.function(costs, np.array([1.0, 1.0]), np.array([3.0, 1.0])) is None


def test_a_path_begins_in_a_blocked_cell_but_does_not_end_in_one_or_outside() -> None:
    costs = np.ones((20, 20))
    costs[:5] = 0
    path = robotics.plan_path.function(costs, np.array([0.35, 1.0]), np.array([1.5, 1.0]))
    assert path is not None
    assert path[0].tolist() == [0.35, 1.0]
    assert robotics.plan_path.function(costs, np.array([1.5, 1.0]), np.array([0.35, 1.0])) is None
    for wrong in ([9.0, 1.0], [np.nan, 1.0], [-1.0, 1e300]):
        assert robotics.plan_path.function(costs, np.array([1.0, 1.0]), np.array(wrong)) is None


def test_cheaper_cells_are_worth_a_longer_way() -> None:
    costs = np.ones((30, 30))
    costs[10:20, :20] = 9
    start, goal = np.array([0.5, 1.0]), np.array([2.5, 1.0])
    dear = robotics.plan_path.function(costs, start, goal)
    assert dear is not None
    assert dear[:, 1].max() > 1.9


def seen_by(tracks: robotics.DiskTracks, disks: Any, now: float, pose: Any = (4.0, 2.0, 0.0)) -> list[robotics.Disk]:
    """Look from a pose into the room, and tell the tracks which of the disks the laser sees."""
    clear = robotics.expected_ranges.function(np.array(pose), ANGLES, ROOM)
    ranges = scan(pose, np.random.default_rng(round(10 * now)), disks)
    points = placed(robotics.scan_points.function(ranges, ANGLES), pose)
    found = robotics.find_disks.function(points[ranges < clear - 0.1], np.array([pose[:2]]))
    return tracks.update(found, np.array(pose), ranges, ANGLES, now)


def test_a_disk_is_followed_and_its_velocity_is_told() -> None:
    tracks = robotics.DiskTracks()
    for tick in range(30):
        (one,) = seen_by(tracks, [(5.0 + 0.05 * tick, 1.0)], tick / 10)
    assert math.dist((one.x, one.y), (6.45, 1.0)) < 0.05
    assert (one.vx, one.vy) == pytest.approx((0.5, 0.0), abs=0.1)
    for tick in range(30, 60):
        (one,) = seen_by(tracks, [(6.45, 1.0)], tick / 10)
    assert math.hypot(one.vx, one.vy) < 0.1


def test_a_disk_that_the_laser_does_not_see_is_kept_for_a_while() -> None:
    """It was on the left; then the laser turns its back on it, or something comes in between."""
    for turned, between in ((-math.pi / 2, []), (0.0, [(4.0, 2.7)])):
        tracks = robotics.DiskTracks(memory=2.0)
        for tick in range(5):
            assert len(seen_by(tracks, [(4.0, 3.5)], tick / 10)) == 1
        for tick in range(5, 24):
            known = seen_by(tracks, [*between, (4.0, 3.5)], tick / 10, (4.0, 2.0, turned))
            assert min(math.dist((one.x, one.y), (4.0, 3.5)) for one in known) < 0.03
        for tick in range(24, 28):
            known = seen_by(tracks, between, tick / 10, (4.0, 2.0, turned))
        assert len(known) == len(between)


def test_a_disk_that_should_be_seen_and_is_not_has_gone() -> None:
    tracks = robotics.DiskTracks(memory=60.0)
    for tick in range(5):
        assert len(seen_by(tracks, [(5.5, 2.0), (4.0, 3.2)], tick / 10)) == 2
    for tick in range(5, 8):
        known = seen_by(tracks, [(4.0, 3.2)], tick / 10)
    assert [round(one.y, 1) for one in known] == [3.2]


def test_track_disks_follows_them_in_a_graph() -> None:
    node = robotics.TrackDisks(memory=5.0)
    far = np.full(271, 9.0)
    for x in (3.0, 3.02):
        disks = fire(node, seen=[robotics.Disk(x, 0.0, 9)], pose=np.zeros(3), ranges=far, angles=ANGLES).outputs[
            "disks"
        ]
    assert [round(one.x, 1) for one in disks] == [3.0]


def test_track_disks_refuses_a_scan_whose_angles_are_not_those_of_its_ranges() -> None:
    node = robotics.TrackDisks()
    with pytest.raises(ValueError, match="each range has an angle, got 271 ranges and 3 angles"):
        fire(node, seen=[], pose=np.zeros(3), ranges=np.full(271, 9.0), angles=np.zeros(3))
