"""The family `driving`: followers on a circle and in a simulation, limits step by step, braking in time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

import hfg
from hfg.geometry import PointCloud
from hfg.nodes import driving
from hfg.nodes.estimation import Twist, ackermann_twist, moved_by
from hfg.testing import fire

LINE = np.array([[0.0, 0.0], [20.0, 0.0]])


def out(node: Any, **values: Any) -> Any:
    return fire(node, **values).outputs["out"]


def driven(pose: Any, twist: Twist, dt: float) -> Any:
    x, y, turn = moved_by(twist, dt)
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return pose + np.array([cos * x - sin * y, sin * x + cos * y, turn])


def test_on_a_circle_pure_pursuit_drives_that_circle() -> None:
    """Any chord from a point of a circle, along its tangent, belongs to the same circle."""
    angles = np.linspace(0, 2, 20_000)
    circle = 3 * np.stack([np.sin(angles), 1 - np.cos(angles)], 1)
    for ahead in (0.3, 1.0, 2.0):
        twist = out(driving.pure_pursuit(look_ahead=ahead, speed=0.6), path=circle, pose=np.zeros(3))
        assert twist.omega / twist.vx == pytest.approx(1 / 3, rel=1e-3)
        assert twist.vx == 0.6


def test_pure_pursuit_comes_to_the_path_and_stops_at_its_end() -> None:
    path = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 4.0]])
    pose, node, far = np.array([0.0, 0.8, -0.5]), driving.pure_pursuit(look_ahead=0.6), []
    for _ in range(400):
        twist = out(node, path=path, pose=pose)
        pose = driven(pose, twist, 0.05)
        far.append(min(abs(pose[1]), abs(pose[0] - 4)) if pose[0] > 1.5 else 0.0)
    assert twist == Twist(0, 0, 0)
    assert math.dist(pose[:2], path[-1]) <= 0.1
    assert max(far) < 0.25  # the corner is cut


def test_pure_pursuit_turns_on_the_spot_to_what_is_behind() -> None:
    twist = out(driving.pure_pursuit(turn_limit=1.0), path=LINE, pose=np.array([5.0, 0.0, math.pi - 0.1]))
    assert (twist.vx, twist.omega) == (0, -1.0)


def test_stanley_steers_by_heading_and_the_error_of_the_front_axle() -> None:
    node = driving.stanley_steering(gain=2.0, softening=0.1, wheelbase=0.5)
    angle = out(node, path=LINE, pose=np.array([5.0, 0.2, 0.1]), speed=1.0)
    error = -(0.2 + 0.5 * math.sin(0.1))
    assert angle == pytest.approx(-0.1 + math.atan(2.0 * error / 1.1))
    assert out(node, path=LINE, pose=np.array([5.0, 9.0, 0.0]), speed=1.0) == -0.6
    pose = np.array([0.0, 1.0, 0.3])
    for _ in range(300):
        angle = out(node, path=LINE, pose=pose, speed=1.0)
        pose = driven(pose, ackermann_twist.function(1.0, angle, wheelbase=0.5), 0.05)
    assert abs(pose[1]) < 0.01
    assert abs(pose[2]) < 0.01


def test_a_path_that_is_empty_or_a_pose_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="a path has finite points, at least one, got 0 points"):
        out(driving.pure_pursuit(), path=LINE[:0], pose=np.zeros(3))
    with pytest.raises(ValueError, match="a pose consists of finite numbers"):
        out(driving.pure_pursuit(), path=LINE, pose=np.full(3, np.nan))
    with pytest.raises(ValueError, match="a path to steer along has two points and a finite speed, got 1 and 1.0"):
        out(driving.stanley_steering(), path=LINE[:1], pose=np.zeros(3), speed=1.0)


@hfg.node
def commands(*, values: Any = ()) -> Iterator[Twist]:
    yield from values


def test_speed_and_acceleration_are_limited_and_the_arc_is_kept() -> None:
    graph = hfg.Graph()
    node: Any = graph.add(driving.LimitTwist(speed=1.0, turn=1.0, acceleration=0.5, turn_acceleration=2.0))
    values = [Twist(2.0, 0.0, 1.0)] * 30 + [Twist(0.0, 0.0, 0.0)] * 30
    graph.connect(graph.add(commands(values=values), max_rate_hz=10).out, node.twist)
    graph.connect(node.limited, graph.output("limited", Any))
    limited = hfg.run(graph, clock="virtual").outputs["limited"]
    assert limited[0] == Twist(0, 0, 0)
    for before, after in pairwise(limited):
        assert abs(after.vx - before.vx) <= 0.05 + 1e-9
        assert after.omega == pytest.approx(after.vx / 2)
    assert limited[29] == pytest.approx(Twist(1.0, 0.0, 0.5))
    assert limited[10].vx == pytest.approx(0.5)
    assert limited[-1] == pytest.approx(Twist(0, 0, 0))
    with pytest.raises(ValueError, match="a velocity consists of finite numbers"):
        fire(driving.LimitTwist(), twist=Twist(math.nan, 0, 0))


@pytest.mark.parametrize("twist", [Twist(1.5, 0.0, 0.0), Twist(1.5, 0.0, 0.8), Twist(1.0, -1.0, 0.3)])
def test_a_robot_that_is_slowed_at_each_step_stops_before_what_is_on_its_arc(twist: Twist) -> None:
    """It is driven against an obstacle with limited braking; it stops near it, and never touches it."""
    x, y, _ = moved_by(twist, 2.0)
    thing, pose, speed = np.array([x, y]), np.zeros(3), 1.0
    for _ in range(400):
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        local = (thing - pose[:2]) @ np.array([[cos, -sin], [sin, cos]])
        safe = out(
            driving.slow_for_obstacles(deceleration=0.8), twist=twist, obstacles=PointCloud("base", 0.0, local[None])
        )
        wanted = math.hypot(safe.vx, safe.vy) / math.hypot(twist.vx, twist.vy)
        speed = max(wanted, speed - 1.0 * 0.02 / math.hypot(twist.vx, twist.vy))  # it brakes by 1 m/s^2 at most
        pose = driven(pose, Twist(*(one * min(speed, 1.0) for one in twist)), 0.02)
        assert math.dist(pose[:2], thing) > 0.35
    assert math.dist(pose[:2], thing) < 0.35 + 0.1 + 0.15


def test_what_is_not_on_the_way_does_not_slow_a_robot_and_it_may_leave_what_it_touches() -> None:
    aside = PointCloud("base", 0.0, np.array([[1.0, 0.5], [-0.5, 0.0], [9.0, 0.0]]))
    node = driving.slow_for_obstacles(radius=0.35)
    assert out(node, twist=Twist(1, 0, 0), obstacles=aside) == Twist(1, 0, 0)
    touched = PointCloud("base", 0.0, np.array([[0.3, 0.0]]))
    assert out(node, twist=Twist(-1, 0, 0), obstacles=touched) == Twist(-1, 0, 0)
    assert out(node, twist=Twist(1, 0, 0), obstacles=touched) == Twist(0, 0, 0)
    with pytest.raises(ValueError, match="1 of the 1 points of the cloud"):
        out(node, twist=Twist(1, 0, 0), obstacles=PointCloud("base", 0.0, np.full((1, 2), np.nan)))
