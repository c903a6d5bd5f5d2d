"""Plans for cars: Dubins curves compared with all others, plans with exact polygons, followed by a car to their end."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hfg.geometry import Grid, Transform
from hfg.nodes import driving
from hfg.nodes.driving._curves import driven, dubins
from hfg.nodes.driving._paths import _from_polygon
from hfg.nodes.estimation import Twist, moved_by
from hfg.testing import fire

FREE = Grid("map", 0.0, Transform.of(), 0.1, np.zeros((80, 60), np.int8))
CAR = [(0.5, 0.25), (-0.2, 0.25), (-0.2, -0.25), (0.5, -0.25)]


def blocked(*boxes: tuple[float, float, float, float], grid: Grid = FREE) -> Grid:
    values = grid.values.copy()
    for low_x, low_y, high_x, high_y in boxes:
        values[round(low_x / 0.1) : round(high_x / 0.1), round(low_y / 0.1) : round(high_y / 0.1)] = 100
    return Grid(grid.frame_id, grid.stamp, grid.origin, grid.cell, values)


def planned(grid: Grid, start: Any, goal: Any, **parameters: Any) -> tuple[np.ndarray, np.ndarray] | None:
    done = fire(driving.plan_maneuver(**parameters), grid=grid, start=np.array(start), goal=np.array(goal)).outputs
    return (done["path"], done["gears"]) if "path" in done else None


# --- Dubins curves ---

POSES = st.tuples(st.floats(-6, 6), st.floats(-6, 6), st.floats(-math.pi, math.pi))


@given(start=POSES, goal=POSES, radius=st.floats(0.3, 3))
def test_a_dubins_curve_leads_to_the_goal(start: Any, goal: Any, radius: float) -> None:
    curve = dubins(np.array(start), np.array(goal), radius)
    end = driven(start, curve.bends, curve.lengths, radius, 0.1)[-1]
    assert np.allclose(end[:2], goal[:2], atol=1e-5)
    assert math.remainder(end[2] - goal[2], 2 * math.pi) == pytest.approx(0, abs=1e-5)
    assert min(curve.lengths) >= 0


def test_no_word_with_other_angles_is_shorter() -> None:
    """First and last angle are tried all over; where the middle part then ends at the goal, its length is compared."""
    rng = np.random.default_rng(1)
    angles = np.linspace(0, 2 * math.pi, 241)
    for _ in range(12):
        goal = np.array([*rng.uniform(-4, 4, 2), rng.uniform(-3, 3)])
        curve = dubins(np.zeros(3), goal, 1.0)
        shortest = math.inf
        for first in (1, -1):
            for last in (1, -1):
                # with a line between: its direction is that after the first turn, and its end is on the last circle
                t = angles[:, None]
                heading = first * t
                start = np.stack([np.sin(t), first * (1 - np.cos(t))], -1)
                q = np.remainder(last * (goal[2] - heading), 2 * math.pi)
                turned = heading + last * q
                arc = np.stack([np.sin(turned) - np.sin(heading), np.cos(heading) - np.cos(turned)], -1) * last
                off = goal[:2] - arc - start
                line = off[..., 0] * np.cos(heading) + off[..., 1] * np.sin(heading)
                aside = np.abs(-off[..., 0] * np.sin(heading) + off[..., 1] * np.cos(heading))
                total = np.where((aside < 0.03) & (line > -0.03), t + line + q, math.inf)
                shortest = min(shortest, float(total.min()))
        assert curve.length < shortest + 0.1
    assert dubins(np.zeros(3), np.array([5.0, 0.0, 0.0]), 1.0).length == pytest.approx(5)
    # two circles that touch a third one between them
    assert dubins(np.zeros(3), np.array([0.0, 0.0, math.pi]), 1.0).length == pytest.approx(7 * math.pi / 3)
    assert dubins(np.zeros(3), np.array([0.0, 2.0, math.pi]), 1.0).length == pytest.approx(math.pi)


# --- plans ---


def is_driveable(path: np.ndarray, gears: np.ndarray, radius: float) -> bool:
    """Each step is one of the car: along its heading, into the direction of its gear, on no narrower arc."""
    for before, after, gear in zip(path[:-1], path[1:], gears[1:], strict=True):
        turn = math.remainder(after[2] - before[2], 2 * math.pi)
        way = math.dist(before[:2], after[:2])
        middle = before[2] + turn / 2
        along = (after[0] - before[0]) * math.cos(middle) + (after[1] - before[1]) * math.sin(middle)
        chord = 2 * radius * math.sin(min(abs(turn) / 2, math.pi / 2))
        if not (abs(gear * along - way) < 1e-6 and way >= chord - 1e-6 and way < 0.2):
            return False
    return True


def touches(path: np.ndarray, grid: Grid, corners: Any = CAR) -> bool:
    """Look at every pose and every obstacle with OpenCV."""
    middles = (np.argwhere(grid.values >= 50) + 0.5) * grid.cell
    for x, y, yaw in path:
        cos, sin = math.cos(yaw), math.sin(yaw)
        outline = np.array([(x + cos * a - sin * b, y + sin * a + cos * b) for a, b in corners], np.float32)
        near = middles[np.hypot(*(middles - [x, y]).T) < 0.6].tolist()
        if any(cv2.pointPolygonTest(outline, (a, b), True) > 0 for a, b in near):
            return True
    return False


def length(path: np.ndarray) -> float:
    return float(np.hypot(*np.diff(path[:, :2], axis=0).T).sum())


@pytest.mark.parametrize(
    ("grid", "start", "goal", "reverses"),
    [
        (FREE, (1.0, 1.0, 0.0), (6.0, 4.0, 1.0), False),
        (blocked((3.0, 0.0, 3.4, 4.0)), (1.0, 1.0, 0.0), (6.0, 1.0, -1.5), False),
        (blocked((0.0, 1.8, 8.0, 2.0), (0.0, 0.0, 8.0, 0.4)), (4.0, 1.1, 0.0), (2.0, 1.1, 0.0), True),  # a corridor
        (
            blocked((2.0, 0.0, 3.9, 1.3), (5.2, 0.0, 8.0, 1.3)),
            (3.0, 2.2, 0.0),
            (4.5, 0.6, math.pi / 2),
            True,
        ),  # parking
    ],
)
def test_a_plan_leads_from_pose_to_pose_as_a_car_drives_and_touches_nothing(
    grid: Grid, start: Any, goal: Any, reverses: bool
) -> None:
    found = planned(grid, start, goal, radius=0.8, margin=0.0)
    assert found is not None
    path, gears = found
    assert np.allclose(path[0], start)
    assert np.allclose(path[-1], goal)
    assert len(path) == len(gears)
    assert is_driveable(path, gears, 0.8)
    assert not touches(path, grid)
    assert (gears < 0).any() == reverses


def test_without_obstacles_a_plan_is_hardly_longer_than_the_shortest_curve() -> None:
    for goal in [(6.0, 4.0, 1.0), (6.0, 2.0, math.pi), (2.5, 5.0, 3.0), (5.5, 3.0, -1.0)]:
        found = planned(FREE, (1.5, 2.0, 0.3), goal, radius=0.8)
        curve = dubins(np.array([1.5, 2.0, 0.3]), np.array(goal), 0.8)
        assert found is not None
        assert length(found[0]) < 1.1 * curve.length + 0.1


def test_a_plan_is_in_the_frame_of_the_grid() -> None:
    shift = Transform.of(5.0, -3.0, yaw=0.7)

    def at(x: float, y: float, yaw: float) -> list[float]:
        moved = shift @ Transform.of(x, y, yaw=yaw)
        return [*moved.translation[:2].tolist(), moved.angles[2]]

    here = planned(blocked((3.0, 0.0, 3.4, 4.0)), (1.0, 1.0, 0.0), (6.0, 1.0, -1.5))
    grid = blocked((3.0, 0.0, 3.4, 4.0), grid=Grid("map", 0.0, shift, 0.1, FREE.values))
    there = planned(grid, at(1.0, 1.0, 0.0), at(6.0, 1.0, -1.5))
    assert here is not None
    assert there is not None
    assert length(there[0]) == pytest.approx(length(here[0]), rel=0.05)
    assert np.allclose(there[0][-1], at(6.0, 1.0, -1.5))


def test_where_there_is_no_way_a_plan_is_silent_and_an_empty_map_is_refused() -> None:
    assert planned(blocked((3.0, 0.0, 3.4, 6.0)), (1.0, 1.0, 0.0), (6.0, 1.0, 0.0)) is None
    assert planned(FREE, (0.0, 0.0, 0.0), (6.0, 1.0, 0.0)) is None  # half outside
    assert planned(FREE, (1.0, 1.0, 0.0), (1.0, 1.0, 0.0)) is not None
    with pytest.raises(ValueError, match="is empty, 0 x 3 cells: there is nowhere to drive"):
        planned(Grid("map", 0.0, Transform.of(), 0.1, np.zeros((0, 3), np.int8)), (1.0, 1.0, 0.0), (2.0, 1.0, 0.0))
    with pytest.raises(ValueError, match="a pose consists of finite numbers"):
        planned(FREE, (math.nan, 1.0, 0.0), (2.0, 1.0, 0.0))


@pytest.mark.parametrize("goal", [(4.5, 0.6, math.pi / 2), (6.0, 4.0, 1.0)])
def test_a_car_that_follows_a_plan_arrives(goal: Any) -> None:
    grid = blocked((2.0, 0.0, 3.9, 1.3), (5.2, 0.0, 8.0, 1.3))
    found = planned(grid, (3.0, 2.2, 0.0), goal, radius=1.0)
    assert found is not None
    path, gears = found
    node = driving.FollowManeuver(look_ahead=0.3, speed=0.4, tolerance=0.06)
    pose, worst, pieces = np.array([3.0, 2.2, 0.0]), 0.0, [0]
    for _ in range(1500):
        done = fire(node, path=path, gears=gears, pose=pose).outputs
        twist: Twist = done["twist"]
        pieces.append(done["piece"])
        if twist == Twist(0, 0, 0):
            break
        x, y, turn = moved_by(twist, 0.05)
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        pose = pose + np.array([cos * x - sin * y, sin * x + cos * y, turn])
        worst = max(worst, float(np.hypot(*(path[:, :2] - pose[:2]).T).min()))
    assert twist == Twist(0, 0, 0)
    assert math.dist(pose[:2], goal[:2]) < 0.12
    assert abs(math.remainder(pose[2] - goal[2], 2 * math.pi)) < 0.25
    assert worst < 0.12
    assert pieces == sorted(pieces)
    assert pieces[-1] == 1 + int((np.diff(gears) != 0).sum())


def test_a_plan_without_gears_for_its_poses_is_refused() -> None:
    with pytest.raises(ValueError, match="each pose of a path has a gear, got 2 poses and 1 gears"):
        fire(driving.FollowManeuver(), path=np.zeros((2, 3)), gears=np.ones(1, np.int32), pose=np.zeros(3))


# --- paths ---


def test_a_smooth_path_is_that_of_least_squares() -> None:
    rng = np.random.default_rng(4)
    path, weight = np.cumsum(rng.uniform(0, 1, (20, 2)), 0), 7.0
    smooth = fire(driving.smooth_path(weight=weight), path=path).outputs["out"]
    bends = np.zeros((18, 20))
    for k in range(18):
        bends[k, k : k + 3] = 1, -2, 1
    rows = np.concatenate([np.eye(20), math.sqrt(weight) * bends])
    held = rows[:, [0, -1]] @ path[[0, -1]]
    expected, *_ = np.linalg.lstsq(rows[:, 1:-1], np.concatenate([path, np.zeros((18, 2))]) - held)
    assert np.allclose(smooth[1:-1], expected)
    assert smooth[[0, -1]].tolist() == path[[0, -1]].tolist()


def test_a_smooth_path_does_not_cut_through_obstacles() -> None:
    corner = np.array([(x, 1.0) for x in np.arange(1, 4, 0.1)] + [(4.0, y) for y in np.arange(1, 4, 0.1)])
    grid = blocked((2.0, 1.1, 3.9, 4.0))
    freely = fire(driving.smooth_path(weight=1e4), path=corner).outputs["out"]
    around = fire(driving.smooth_path(weight=1e4), path=corner, grid=grid).outputs["out"]

    def inside(path: np.ndarray) -> int:
        return sum(grid.values[tuple(np.floor(point / 0.1).astype(int))] > 0 for point in path)

    assert inside(freely) > 5
    assert inside(around) == 0
    with pytest.raises(ValueError, match="a path consists of finite points"):
        fire(driving.smooth_path(), path=np.full((3, 2), np.nan))


@pytest.mark.parametrize("corners", [CAR, [(1, 0), (0, 1), (-1, 0), (0, 0.2)], [(0, 0), (2, 0.5), (0.3, 1.5)]])
def test_how_far_points_are_from_a_polygon_is_what_opencv_says(corners: Any) -> None:
    points = np.random.default_rng(5).uniform(-2, 2, (400, 2))
    outline = np.array(corners, np.float32)
    expected = [max(0.0, -cv2.pointPolygonTest(outline, (float(x), float(y)), True)) for x, y in points]
    assert np.allclose(_from_polygon(points, np.array(corners, float)), expected, atol=1e-5)


def test_a_path_is_free_until_the_footprint_meets_an_obstacle() -> None:
    path = np.array([(x, 2.0, 0.0) for x in np.arange(1.0, 6.01, 0.05)])
    clear = fire(driving.check_path(margin=0.0), path=path, grid=FREE).outputs
    assert (clear["free"], clear["way"]) == (True, pytest.approx(5.0))
    done = fire(driving.check_path(margin=0.1), path=path, grid=blocked((4.0, 1.5, 4.1, 2.5))).outputs
    assert done["free"] is False
    assert done["way"] == pytest.approx(4.05 - 0.5 - 0.1 - 1.0, abs=0.051)
    beside = blocked((4.0, 2.3, 4.1, 2.5))
    assert fire(driving.check_path(margin=0.09), path=path, grid=beside).outputs["free"] is True
    assert fire(driving.check_path(margin=0.11), path=path, grid=beside).outputs["free"] is False
    turned = np.array([(4.05, 2.0, yaw) for yaw in np.linspace(0, math.pi / 2, 30)])
    assert fire(driving.check_path(margin=0.0), path=turned, grid=beside).outputs["free"] is False
