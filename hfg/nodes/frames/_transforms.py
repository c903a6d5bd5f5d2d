"""Transforms: made, composed, inverted, taken apart, applied."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

import numpy as np
from annotated_types import Interval, MinLen, Unit

from hfg.geometry import Coordinates, FrameTransform, PoseInFrame, Transform, Vector3
from hfg.nodes.robotics import Pose
from hfg.nodetypes.functions import node

Metres = Annotated[float, Unit("m")]
Radians = Annotated[float, Unit("rad")]


@node
def transform_of_angles(angles: Vector3, translation: Vector3 | None = None) -> Transform:
    """Make a transform from roll, pitch and yaw, and a place.

    Fires once per set of angles.

    Args:
      angles: first roll about x, then pitch about y, then yaw about z, about axes that stay; in radians.
      translation: where the origin goes; without this input it stays.

    Raises:
      ValueError: a number is not finite.
    """
    place = np.zeros(3) if translation is None else translation
    if not np.isfinite(angles).all():
        raise ValueError(f"roll, pitch and yaw are finite, got {angles.tolist()}")
    return Transform.of(*place, *angles)


@node
def euler_angles(transform: Transform) -> Vector3:
    """Return roll, pitch and yaw of a transform, the Euler angles about x, y and z.

    Fires once per transform.

    Args:
      transform: any.

    Returns:
      out: in radians; pitch is between -pi/2 and pi/2. Straight up or down all of the turn is yaw.
    """
    return np.array(transform.angles)


@node
def transform_of_pose(pose: Pose) -> Transform:
    """Make a transform from a pose in the plane: a turn about z, at height 0.

    Fires once per pose.

    Args:
      pose: x, y and heading.

    Raises:
      ValueError: a number is not finite.
    """
    if not np.isfinite(pose).all():
        raise ValueError(f"a pose consists of finite numbers, got {pose.tolist()}")
    return Transform.of(x=pose[0], y=pose[1], yaw=pose[2])


@node
def pose_of_transform(transform: Transform) -> Pose:
    """Return the pose in the plane of a transform, without height, roll and pitch.

    Fires once per transform.

    Args:
      transform: any.

    Returns:
      out: x, y and yaw.
    """
    x, y, _ = transform.translation
    return np.array([x, y, transform.angles[2]])


@node
def compose_transforms(first: Transform, then: Transform) -> Transform:
    """Compose two transforms: first the one, then the other.

    Fires once per pair. If the first is where a camera is on a robot, and the other where the robot is in the map, the
    result is where the camera is in the map.

    Args:
      first: applied first.
      then: applied to what the first one gives.

    Raises:
      ValueError: the result is too far away for a float.
    """
    return then @ first


@node
def invert_transform(transform: Transform) -> Transform:
    """Return the transform that takes everything back.

    Fires once per transform.

    Args:
      transform: any.

    Raises:
      ValueError: the result is too far away for a float.
    """
    return transform.inverse()


@node
def interpolate_transforms(
    first: Transform, second: Transform, *, share: Annotated[float, Interval(ge=0, le=1), Unit("1")] = 0.5
) -> Transform:
    """Return a transform on the way between two: the place on the line, the rotation by slerp.

    Fires once per pair.

    Args:
      first: the beginning of the way.
      second: the end of the way.
      share: how much of the way; 0 is the first, 1 the second.
    """
    return first.between(second, share)


@node
def transform_points(points: Coordinates, transform: Transform) -> Coordinates:
    """Transform points of the plane or of space.

    Fires once per set of points.

    Args:
      points: one row each; what is not a number stays so.
      transform: from their frame to another one.

    Returns:
      out: in the same order; points of the plane leave it if the transform tilts them.
    """
    return transform.apply(points)


@node
def broadcast_pose(pose: PoseInFrame, *, child: Annotated[str, MinLen(1)] = "base") -> list[FrameTransform]:
    """Tell others where a frame is, from a pose such as that of odometry or localisation.

    Fires once per pose.

    Args:
      pose: of the child, in its parent.
      child: the frame that is there.

    Returns:
      out: one item; connect it to the slot `transforms` of nodes that bring values into another frame.

    Raises:
      ValueError: the pose is given in the frame of the child itself.
    """
    return [FrameTransform(pose.frame_id, child, pose.pose, pose.stamp)]


@node
def fixed_frame(
    *,
    parent: Annotated[str, MinLen(1)] = "base",
    child: Annotated[str, MinLen(1)] = "laser",
    x: Metres = 0.0,
    y: Metres = 0.0,
    z: Metres = 0.0,
    roll: Radians = 0.0,
    pitch: Radians = 0.0,
    yaw: Radians = 0.0,
) -> Iterator[list[FrameTransform]]:
    """Say once where a sensor is mounted: the pose of a frame in its parent that never changes.

    A source that fires once, then ends.

    Args:
      parent: the frame around it.
      child: the frame.
      x: ahead.
      y: to the left.
      z: up.
      roll: about the x axis.
      pitch: about the y axis; positive looks down.
      yaw: about the z axis, counter-clockwise.

    Returns:
      out: one item; connect it to the slot `transforms` of nodes that bring values into another frame.

    Raises:
      ValueError: parent and child are the same, or a number is not finite.
    """
    if not np.isfinite([roll, pitch, yaw]).all():
        raise ValueError(f"roll, pitch and yaw are finite, got {roll}, {pitch}, {yaw}")
    yield [FrameTransform(parent, child, Transform.of(x, y, z, roll, pitch, yaw), static=True)]
