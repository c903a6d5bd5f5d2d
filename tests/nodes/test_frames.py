"""The family `frames`: nodes that make transforms, and that bring values into another frame."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hfg.geometry import FrameError, FrameTransform, Grid, LaserScan, PointCloud, PoseInFrame, Transform
from hfg.nodes import frames
from hfg.testing import fire

MOUNTED = [FrameTransform("base", "laser", Transform.of(x=0.2, z=0.5, yaw=math.pi / 2), static=True)]
DRIVEN = [FrameTransform("map", "base", Transform.of(x=stamp, yaw=stamp), stamp) for stamp in (0.0, 1.0)]


def told(node: Any) -> Any:
    """Tell a node where the frames are."""
    fire(node, slot="transforms", value=MOUNTED)
    fire(node, slot="transforms", value=DRIVEN)
    return node


def matrix(stamp: float) -> np.ndarray:
    """Where the laser is in the map, by SciPy."""
    base, laser = np.eye(4), np.eye(4)
    base[:3, :3] = Rotation.from_euler("z", stamp).as_matrix()
    base[0, 3] = stamp
    laser[:3, :3] = Rotation.from_euler("z", math.pi / 2).as_matrix()
    laser[:3, 3] = 0.2, 0, 0.5
    return base @ laser


def test_a_frame_is_looked_up_between_two_stamps() -> None:
    found = fire(told(frames.LookupTransform(source="laser")), stamp=0.3).outputs["found"]
    assert (found.parent, found.child, found.stamp) == ("map", "laser", 0.3)
    assert np.allclose(found.transform.matrix, matrix(0.3))


def test_clouds_scans_poses_and_grids_are_brought_into_the_target() -> None:
    points = np.array([[1.0, 0.0, 0.0], [0.0, 3.0, 1.0]])
    expected = (np.c_[points, np.ones(2)] @ matrix(0.5).T)[:, :3]
    cloud = PointCloud("laser", 0.5, points, {"i": np.arange(2.0)})
    out = fire(told(frames.TransformCloud()), cloud=cloud).outputs["out"]
    assert (out.frame_id, out.stamp, out.fields["i"].tolist()) == ("map", 0.5, [0.0, 1.0])
    assert np.allclose(out.points, expected)

    scan = LaserScan("laser", 0.5, np.array([1.0, np.nan, 3.0]), 0.0, math.pi / 4)
    out = fire(told(frames.TransformScan()), scan=scan).outputs["out"]
    assert np.allclose(out.points, (np.array([[1, 0, 0, 1], [0, 3, 0, 1]]) @ matrix(0.5).T)[:, :2])

    pose = PoseInFrame("laser", 0.5, Transform.of(x=1, roll=0.3))
    out = fire(told(frames.TransformPose()), pose=pose).outputs["out"]
    assert np.allclose(out.pose.matrix, matrix(0.5) @ pose.pose.matrix)

    grid = Grid("laser", 0.5, pose.pose, 0.1, np.ones((2, 3)))
    out = fire(told(frames.TransformGrid()), grid=grid).outputs["out"]
    assert np.allclose(out.origin.matrix, matrix(0.5) @ pose.pose.matrix)
    assert out.values is grid.values


def test_a_frame_that_is_unknown_or_too_old_is_one_clear_sentence() -> None:
    node = told(frames.TransformCloud())
    with pytest.raises(FrameError, match='the frame "camera" is unknown at 0.500 s; known are: "base", "laser", "map"'):
        fire(node, cloud=PointCloud("camera", 0.5, np.ones((1, 3))))
    with pytest.raises(FrameError, match=r"known from 0.000 s to 1.000 s, not at -2.000 s"):
        fire(node, cloud=PointCloud("laser", -2.0, np.ones((1, 3))))
    with pytest.raises(FrameError, match="cannot be in"):
        fire(node, slot="transforms", value=[FrameTransform("map", "laser", Transform.of())])
    empty = fire(node, cloud=PointCloud("laser", 0.5, np.zeros((0, 2)))).outputs["out"]
    assert len(empty) == 0


def test_transforms_are_made_composed_inverted_and_taken_apart() -> None:
    angles, place = np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, 3.0])
    made = fire(frames.transform_of_angles(), angles=angles, translation=place).outputs["out"]
    assert np.allclose(made.turn, Rotation.from_euler("xyz", angles).as_matrix())
    assert np.allclose(fire(frames.euler_angles(), transform=made).outputs["out"], angles)
    assert np.allclose(fire(frames.pose_of_transform(), transform=made).outputs["out"], [1, 2, 0.3])
    flat = fire(frames.transform_of_pose(), pose=np.array([1.0, 2.0, 3.0])).outputs["out"]
    both = fire(frames.compose_transforms(), first=made, then=flat).outputs["out"]
    assert np.allclose(both.matrix, flat.matrix @ made.matrix)
    back = fire(frames.invert_transform(), transform=made).outputs["out"]
    assert np.allclose(back.matrix, np.linalg.inv(made.matrix))
    half = fire(frames.interpolate_transforms(), first=Transform.of(), second=Transform.of(x=2, yaw=1)).outputs["out"]
    assert np.allclose(half.matrix, Transform.of(x=1, yaw=0.5).matrix)
    points = fire(frames.transform_points(), points=np.ones((2, 3)), transform=made).outputs["out"]
    assert np.allclose(points, (made.matrix @ np.ones(4))[:3])


def test_frames_are_told_from_poses_and_from_where_sensors_are_mounted() -> None:
    pose = PoseInFrame("odom", 2.0, Transform.of(x=1))
    (one,) = fire(frames.broadcast_pose(child="base"), pose=pose).outputs["out"]
    assert (one.parent, one.child, one.stamp, one.static) == ("odom", "base", 2.0, False)
    node = frames.fixed_frame(parent="base", child="camera", z=1.2, pitch=0.3)
    ((one,),) = [fire(node).outputs["out"]]
    assert (one.parent, one.child, one.static) == ("base", "camera", True)
    assert np.allclose(one.transform.apply(np.array([[1.0, 0, 0]])), [[math.cos(0.3), 0, 1.2 - math.sin(0.3)]])


def test_numbers_that_are_not_finite_are_refused() -> None:
    with pytest.raises(ValueError, match="roll, pitch and yaw are finite, got"):
        fire(frames.transform_of_angles(), angles=np.array([0.0, np.inf, 0.0]))
    with pytest.raises(ValueError, match="a pose consists of finite numbers, got"):
        fire(frames.transform_of_pose(), pose=np.array([0.0, np.nan, 0.0]))
    with pytest.raises(ValueError, match='not its own parent, got "base" twice'):
        fire(frames.broadcast_pose(child="base"), pose=PoseInFrame("base", 2.0, Transform.of()))
