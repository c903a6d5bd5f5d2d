"""Limits of what a robot is told to do: speed, acceleration, and what stands in its way."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from annotated_types import Interval, Unit

from hfg.base.clock import now
from hfg.geometry import PointCloud
from hfg.nodes.estimation import Twist, moved_by
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, State

_STEP = 0.05  # metres of way between two places that are looked at


class LimitTwist(Node):
    """Limit speed and acceleration of a velocity command (slew).

    Fires once per command. All parts of a velocity are shortened alike, so the robot keeps its direction and its arc.

    Attributes:
      speed: greatest speed ahead and aside together.
      turn: greatest angular velocity.
      acceleration: greatest change of the speed, in each second.
      turn_acceleration: greatest change of the angular velocity, in each second.
      twist: as commanded.
      limited: as the robot can do; the first one begins at rest.

    Raises:
      ValueError: a velocity is not finite.
    """

    speed = Parameter(1.0, Interval(gt=0, le=100), unit="m/s")
    turn = Parameter(1.5, Interval(gt=0, le=100), unit="rad/s")
    acceleration = Parameter(1.0, Interval(gt=0, le=1000), unit="m/s^2")
    turn_acceleration = Parameter(3.0, Interval(gt=0, le=1000), unit="rad/s^2")
    twist = Input(Twist)
    limited = Output(Twist)

    before: State[Twist] = State(Twist(0.0, 0.0, 0.0))
    last: State[float | None] = State(None)

    def process(self, twist: Twist) -> Twist:
        """Shorten it."""
        _need_finite(twist)
        time = now()
        dt = 0.0 if self.last is None else time - self.last
        self.last = time
        fast = max(math.hypot(twist.vx, twist.vy) / self.speed, abs(twist.omega) / self.turn, 1.0)
        wanted = Twist(*(one / fast for one in twist))
        dx, dy, dw = (a - b for a, b in zip(wanted, self.before, strict=True))
        share = min(
            1.0,
            self.acceleration * dt / max(math.hypot(dx, dy), 1e-12),
            self.turn_acceleration * dt / max(abs(dw), 1e-12),
        )
        vx, vy, omega = self.before
        self.before = Twist(vx + share * dx, vy + share * dy, omega + share * dw)
        return self.before


def _need_finite(twist: Twist) -> None:
    if not all(map(math.isfinite, twist)):
        raise ValueError(f"a velocity consists of finite numbers, got {tuple(twist)}")


@node
def slow_for_obstacles(
    twist: Twist,
    obstacles: PointCloud,
    *,
    radius: Annotated[float, Interval(gt=0, le=100), Unit("m")] = 0.35,
    margin: Annotated[float, Interval(ge=0, le=100), Unit("m")] = 0.1,
    deceleration: Annotated[float, Interval(gt=0, le=1000), Unit("m/s^2")] = 1.0,
) -> Twist:
    """Slow a robot down before obstacles on its arc, so that it can always stop in time: a collision check.

    Fires once per command and cloud. The robot is a disk. Its way is looked at as far as it needs to stop; if it meets
    an obstacle there, the velocity is shortened so that it stops before, or is 0.

    Args:
      twist: as commanded, in the frame of the robot.
      obstacles: in the same frame, without the ground and without the robot itself; heights do not count.
      radius: of the robot.
      margin: how far before an obstacle it stops.
      deceleration: by which it brakes.

    Returns:
      out: on the same arc.

    Raises:
      ValueError: a velocity or coordinates are not finite.
    """
    _need_finite(twist)
    obstacles.need_finite()
    speed = min(math.hypot(twist.vx, twist.vy), 1e3)
    points = obstacles.points[:, :2]
    if speed < 1e-6 or not len(points):
        return twist
    reach = min(speed * speed / (2 * deceleration) + margin, 100.0)
    ways = np.linspace(0, reach, max(2, math.ceil(reach / _STEP) + 1))
    places = np.array([moved_by(twist, float(way / speed))[:2] for way in ways])
    with np.errstate(over="ignore"):
        near = points[np.hypot(points[:, 0], points[:, 1]) <= reach + radius]
        far = np.hypot(*(near[:, None] - places).transpose(2, 0, 1))
    # One that is already inside of the radius does not hold the robot, unless it comes nearer to it.
    meets = (far < radius) & (far < np.maximum(far[:, :1], 1e-9) - 1e-9)
    if not meets.any():
        return twist
    free = float(ways[int(meets.any(0).argmax())]) - _STEP - margin
    share = min(1.0, math.sqrt(2 * deceleration * max(0.0, free)) / speed)
    return Twist(*(one * share for one in twist))
