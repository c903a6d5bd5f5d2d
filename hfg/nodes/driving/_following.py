"""Followers of paths: from a path and a pose to a velocity, or to a steering angle."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval, Unit

from hfg.nodes.driving._grids import Poses
from hfg.nodes.driving._maneuvers import Gears
from hfg.nodes.estimation import Twist
from hfg.nodes.robotics import Pose, Positions
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, State


def _need_path(path: Any, pose: Any) -> None:
    if not (len(path) and np.isfinite(path).all()):
        raise ValueError(f"a path has finite points, at least one, got {len(path)} points: {path[:3].tolist()}")
    if not np.isfinite(pose).all():
        raise ValueError(f"a pose consists of finite numbers, got {pose.tolist()}")


def _nearest(path: Any, place: Any) -> tuple[int, float, Any]:
    """Return which piece of a path is nearest, how far along it, 0 to 1, and where that is."""
    if len(path) == 1:
        return 0, 1.0, path[0]
    along = np.diff(path, axis=0)
    square = np.maximum((along * along).sum(1), 1e-12)
    share = np.clip(((place - path[:-1]) * along).sum(1) / square, 0, 1)
    feet = path[:-1] + share[:, None] * along
    piece = int(((feet - place) ** 2).sum(1).argmin())
    return piece, float(share[piece]), feet[piece]


def _ahead(path: Any, piece: int, foot: Any, place: Any, distance: float) -> Any:
    """Return the first point of a path after a foot that is at a distance from a place; its end if there is none."""
    start = foot - place
    for end in path[piece + 1 :] - place:
        along = end - start
        a, b, c = along @ along, start @ along, start @ start - distance * distance
        root = b * b - a * c
        if end @ end >= distance * distance and a > 0 and root >= 0:
            return start + along * min(1.0, max(0.0, (-b + math.sqrt(root)) / a))
        start = end
    return path[-1] - place


@node
def pure_pursuit(
    path: Positions,
    pose: Pose,
    *,
    look_ahead: Annotated[float, Interval(ge=0.01, le=100), Unit("m")] = 0.8,
    speed: Annotated[float, Interval(ge=0, le=100), Unit("m/s")] = 0.5,
    slow: Annotated[float, Interval(gt=0, le=100), Unit("1/s")] = 1.0,
    tolerance: Annotated[float, Interval(ge=0, le=100), Unit("m")] = 0.1,
    turn_limit: Annotated[float, Interval(gt=0, le=100), Unit("rad/s")] = 2.0,
) -> Twist:
    """Follow a path by pure pursuit: drive on the arc to the point of the path that is one look-ahead away.

    Fires once per path and pose. After R. Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm,
    CMU-RI-TR-92-01 (1992). For robots that cannot move sideways: differential drives and cars.

    Args:
      path: in the frame of the pose, in the order of driving.
      pose: of the robot.
      look_ahead: distance to the point that is driven to; near the end of the path it is shorter.
      speed: on the way.
      slow: near the end the speed is at most this for each metre that is left.
      tolerance: how near to its end a path is done.
      turn_limit: the robot does not turn faster; it drives more slowly instead.

    Returns:
      out: in the frame of the robot; all 0 when the path is done. It turns on the spot if the path leads backwards.

    Raises:
      ValueError: the path is empty, or a number is not finite.
    """
    _need_path(path, pose)
    with np.errstate(all="ignore"):
        piece, _, foot = _nearest(path, pose[:2])
        left = math.dist(path[-1], pose[:2])
        if left <= tolerance and piece >= len(path) - 2:
            return Twist(0.0, 0.0, 0.0)
        x, y = _ahead(path, piece, foot, pose[:2], look_ahead)
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x, y = cos * x + sin * y, cos * y - sin * x
    square = max(x * x + y * y, 1e-12)
    if x <= 0:
        return Twist(0.0, 0.0, math.copysign(turn_limit, y))
    curvature = 2 * y / square
    fast = min(speed, slow * left) if piece >= len(path) - 2 else speed
    fast = min(fast, turn_limit / max(abs(curvature), 1e-9))
    return Twist(fast, 0.0, fast * curvature)


@node
def stanley_steering(
    path: Positions,
    pose: Pose,
    speed: float,
    *,
    wheelbase: Annotated[float, Interval(gt=0, le=100), Unit("m")] = 0.5,
    gain: Annotated[float, Interval(gt=0, le=100), Unit("1/s")] = 1.0,
    softening: Annotated[float, Interval(ge=0.001, le=100), Unit("m/s")] = 0.1,
    limit: Annotated[float, Interval(gt=0, le=math.pi / 2), Unit("rad")] = 0.6,
) -> float:
    """Steer a car along a path by Stanley's controller: by the error of its heading and that of its front axle.

    Fires once per path, pose and speed. After S. Thrun et al., Stanley: The Robot That Won the DARPA Grand Challenge,
    Journal of Field Robotics 23 (2006).

    Args:
      path: in the frame of the pose, in the order of driving; at least two points.
      pose: of the middle of the rear axle.
      speed: forwards, in m/s.
      wheelbase: distance between the axles.
      gain: how fast the error of the front axle falls off.
      softening: is added to the speed, so that a slow car steers calmly.
      limit: largest steering angle.

    Returns:
      out: angle of the front wheel, in radians; positive is to the left.

    Raises:
      ValueError: the path has fewer than two points, or a number is not finite.
    """
    _need_path(path, pose)
    if len(path) < 2 or not math.isfinite(speed):
        raise ValueError(f"a path to steer along has two points and a finite speed, got {len(path)} and {speed}")
    front = pose[:2] + wheelbase * np.array([math.cos(pose[2]), math.sin(pose[2])])
    with np.errstate(all="ignore"):
        piece, _, foot = _nearest(path, front)
        along = path[piece + 1] - path[piece]
        off = foot - front
        heading = math.atan2(along[1], along[0])
        error = -math.sin(heading) * off[0] + math.cos(heading) * off[1]
    turn = math.remainder(heading - float(pose[2]), 2 * math.pi)
    return max(-limit, min(limit, turn + math.atan2(gain * float(error), softening + abs(speed))))


class FollowManeuver(Node):
    """Follow a plan that changes between forwards and backwards, piece by piece, each by pure pursuit.

    Fires once per plan and pose. A plan is new if its poses are others than those of the last firing; then it begins
    with the first piece. See `pure_pursuit`.

    Attributes:
      look_ahead: distance to the point that is driven to; near the end of a piece it is shorter.
      speed: on the way.
      slow: near the end of a piece the speed is at most this for each metre that is left.
      tolerance: how near to its end a piece is done.
      turn_limit: the robot does not turn faster; it drives more slowly instead.
      path: in the frame of the pose, such as that of `plan_maneuver`.
      gears: for each pose of the path 1 for forwards, -1 for backwards.
      pose: of the robot.
      twist: in the frame of the robot; all 0 when the last piece is done.
      piece: number of the piece that is driven, from 0; the number of pieces when all are done.

    Raises:
      ValueError: the path is empty, a number is not finite, or there is not one gear for each pose.
    """

    look_ahead = Parameter(0.5, Interval(ge=0.01, le=100), unit="m")
    speed = Parameter(0.5, Interval(gt=0, le=100), unit="m/s")
    slow = Parameter(1.0, Interval(gt=0, le=100), unit="1/s")
    tolerance = Parameter(0.1, Interval(ge=0, le=100), unit="m")
    turn_limit = Parameter(2.0, Interval(gt=0, le=100), unit="rad/s")
    path = Input(Poses)
    gears = Input(Gears)
    pose = Input(Pose)
    twist = Output(Twist)
    piece = Output(int)

    known: State[Any] = State(None)
    done: State[int] = State(0)

    def process(self, path: Poses, gears: Gears, pose: Pose) -> None:
        """Drive on."""
        _need_path(path, pose)
        if len(gears) != len(path):
            raise ValueError(f"each pose of a path has a gear, got {len(path)} poses and {len(gears)} gears")
        if self.known is None or not np.array_equal(self.known, path):
            self.known, self.done = path, 0
        # A piece begins at the pose before its first gear, where the robot has stopped.
        ends = [*(np.flatnonzero(np.diff(gears)) + 1).tolist(), len(path)]
        twist = Twist(0.0, 0.0, 0.0)
        while self.done < len(ends):
            first = max(0, ends[self.done - 1] - 1) if self.done else 0
            twist = self._driven(path[first : ends[self.done], :2], int(gears[ends[self.done] - 1]), pose)
            if twist != Twist(0.0, 0.0, 0.0):
                break
            self.done += 1
        self.twist.send(twist)
        self.piece.send(self.done)

    def _driven(self, path: Any, gear: int, pose: Any) -> Twist:
        turn = 0.0 if gear >= 0 else math.pi
        twist: Twist = pure_pursuit.function(
            path,
            pose + np.array([0.0, 0.0, turn]),
            look_ahead=self.look_ahead,
            speed=self.speed,
            slow=self.slow,
            tolerance=self.tolerance,
            turn_limit=self.turn_limit,
        )
        if twist.vx == 0 and math.dist(path[-1], pose[:2]) <= self.look_ahead:
            return Twist(0.0, 0.0, 0.0)  # just past the end; a car cannot turn on the spot for the rest
        return Twist(twist.vx if gear >= 0 else -twist.vx, 0.0, twist.omega)
