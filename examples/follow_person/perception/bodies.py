"""Upright bodies among clusters, and the scene that they and the robot make."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval, Unit

import hfg
from examples.follow_person.messages import Imu, Twist
from examples.follow_person.perception.records import Scene, planar
from hfg.geometry import PointCloud, PoseInFrame, Transform
from hfg.nodes.estimation import Track

Metres = Annotated[float, Interval(ge=0, le=100), Unit("m")]


@hfg.node
def level_cloud(
    cloud: PointCloud, imu: Imu, *, above: Annotated[float, Interval(ge=0, le=10), Unit("m")] = 0.8
) -> PointCloud:
    """Bring a cloud from the laser into the frame of the robot, turned so that up is up on a slope, too.

    Args:
      cloud: of the laser.
      imu: roll and pitch of the same moment.
      above: how high the laser is mounted.
    """
    turn = Transform.of(roll=imu.roll, pitch=imu.pitch)
    points = turn.apply(cloud.points + np.array([0.0, 0.0, above]))
    return PointCloud("base", cloud.stamp, points)


@hfg.node
def upright_bodies(
    labelled: PointCloud, pose: PoseInFrame, *, widest: Metres = 1.1, lowest: Metres = 0.7, deep: Metres = 0.12
) -> PointCloud:
    """Find clusters that may be people: upright and not too wide.

    Args:
      labelled: points without heights, with the fields "cluster" and "height".
      pose: of the robot, in the same frame.
      widest: of a person.
      lowest: from the lowest to the highest point of a person, at least.
      deep: how far the middle of a person is from the side that is seen.

    Returns:
      out: one point for each, with its height in the field "top".
    """
    number, z = labelled.fields["cluster"], labelled.fields["height"]
    count = int(number.max()) + 1 if len(number) else 0
    places, tops = [], []
    robot = pose.pose.translation[:2]
    for one in range(count):
        chosen = number == one
        points, heights = labelled.points[chosen], z[chosen]
        low, high = points.min(0), points.max(0)
        if math.dist(low, high) > widest or heights.max() - heights.min() < lowest:
            continue
        middle = points.mean(0)
        away = middle - robot
        places.append(middle + away * deep / max(float(np.hypot(*away)), 1e-6))
        tops.append(float(heights.max()))
    points = np.array(places).reshape(-1, 2)
    return PointCloud(labelled.frame_id, labelled.stamp, points, {"top": np.array(tops, np.float64)})


@hfg.node
def make_scene(tracks: list[Track], bodies: PointCloud, pose: PoseInFrame, imu: Imu, odometry: Twist) -> Scene:
    """Put together what is known of one moment.

    Args:
      tracks: of this scan.
      bodies: of this scan.
      pose: of the robot.
      imu: how it is tilted.
      odometry: how fast it is.
    """
    tops: dict[int, float] = {}
    for one in tracks:
        off: Any = bodies.points - (one.x, one.y)
        if one.missed == 0 and len(off):
            nearest = int((off * off).sum(1).argmin())
            tops[one.number] = float(bodies.fields["top"][nearest])
    return Scene(bodies.stamp, planar(pose.pose), imu.roll, imu.pitch, odometry.vx, tracks, tops)
