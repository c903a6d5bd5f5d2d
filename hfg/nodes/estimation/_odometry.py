"""Odometry: from the speeds of wheels to a velocity, from velocities to a pose, and what a gyroscope adds."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval, MinLen, Unit

from hfg.base.clock import now
from hfg.geometry import PoseInFrame, Transform, Twist
from hfg.nodes.estimation._kalman import Square, Vector, correct, predict
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, State


@node
def differential_twist(left: float, right: float, *, track: Annotated[float, Interval(gt=0), Unit("m")] = 0.5) -> Twist:
    """Return the velocity of a differential drive: two wheels, or two sides of wheels or tracks (skid steering).

    Fires once per pair of speeds.

    Args:
      left: speed of the left wheel over the ground, in m/s.
      right: speed of the right wheel.
      track: distance between the wheels; for skid steering an effective one, which is larger.
    """
    return Twist((left + right) / 2, 0.0, (right - left) / track)


@node
def ackermann_twist(
    speed: float, steering: float, *, wheelbase: Annotated[float, Interval(gt=0), Unit("m")] = 0.5
) -> Twist:
    """Return the velocity of a car that steers its front wheels (Ackermann), at the middle of its rear axle.

    Fires once per speed and angle. It is the bicycle model: one wheel in the middle of each axle, without slip.

    Args:
      speed: of the rear axle, in m/s; negative is backwards.
      steering: angle of the front wheel in the middle, in radians; positive is to the left.
      wheelbase: distance between the axles.
    """
    tangent = math.tan(steering) if math.isfinite(steering) else math.nan
    return Twist(speed, 0.0, speed * tangent / wheelbase)


class OmniTwist(Node):
    """Return the velocity of an omnidirectional drive, from the speeds of three or more omni wheels.

    Fires once per set of speeds. More than three wheels say more than is needed; then least squares decide. The default
    is a robot with three wheels at 0.2 m, the first one ahead (kiwi drive).

    Attributes:
      x: where each wheel is, ahead of the middle.
      y: where each wheel is, to the left of the middle.
      direction: into which direction each wheel rolls, from straight ahead, counter-clockwise; across it rolls freely.
      speeds: one for each wheel, in m/s over the ground.
      twist: of the middle of the robot.

    Raises:
      ValueError: there are not as many places, directions and speeds, or the wheels cannot tell all three velocities.
    """

    x = Parameter([0.2, -0.1, -0.1], type=list[float], unit="m")
    y = Parameter([0.0, 0.17320508, -0.17320508], type=list[float], unit="m")
    direction = Parameter([math.pi / 2, math.pi * 7 / 6, -math.pi / 6], type=list[float], unit="rad")
    speeds = Input(Vector)
    twist = Output(Twist)

    def process(self, speeds: Vector) -> Twist:
        """Solve for it."""
        counts = {len(self.x), len(self.y), len(self.direction), len(speeds)}
        if len(counts) > 1:
            raise ValueError(
                f"each wheel has a place, a direction and a speed, got {len(self.x)} x, {len(self.y)} y, "
                f"{len(self.direction)} directions and {len(speeds)} speeds"
            )
        x, y, roll = (np.array(one, np.float64) for one in (self.x, self.y, self.direction))
        with np.errstate(all="ignore"):
            cos, sin = np.cos(roll), np.sin(roll)
            rolls = np.stack([cos, sin, sin * x - cos * y], 1)
            sound = len(rolls) >= 3 and np.isfinite(rolls).all() and np.linalg.matrix_rank(rolls) == 3
            if not sound:
                raise ValueError(
                    "wheels in these places and directions cannot tell a velocity ahead, aside and turning"
                )
            return Twist(*map(float, np.linalg.pinv(rolls) @ speeds))


def moved_by(twist: Twist, dt: float) -> tuple[float, float, float]:
    """Return how a robot with a constant velocity moves: x, y and heading, in the frame of its beginning.

    It drives an arc, so the result is exact for any time.

    Args:
      twist: its velocity.
      dt: for how long, in seconds.
    """
    turn = twist.omega * dt
    if abs(turn) < 1e-6:
        ahead, aside = dt, turn * dt / 2
    else:
        ahead, aside = math.sin(turn) / twist.omega, (1 - math.cos(turn)) / twist.omega
    return twist.vx * ahead - twist.vy * aside, twist.vx * aside + twist.vy * ahead, turn


def _need_finite(numbers: Any) -> None:
    if not all(map(math.isfinite, numbers)):
        raise ValueError(f"a velocity consists of finite numbers, got {tuple(numbers)}")


class IntegrateTwist(Node):
    """Integrate velocities to a pose: the odometry of a robot, dead reckoning.

    Fires once per velocity, which counts since the last firing. The robot begins at the origin.

    Attributes:
      frame_id: the frame in which the robot begins.
      twist: the velocity of the robot.
      pose: where it is now.

    Raises:
      ValueError: a velocity is not finite, or the robot is too far away for a float.
    """

    frame_id = Parameter("odom", MinLen(1))
    twist = Input(Twist)
    pose = Output(PoseInFrame)

    at: State[Transform] = State(factory=Transform.of)
    last: State[float | None] = State(None)

    def process(self, twist: Twist) -> PoseInFrame:
        """Move on."""
        _need_finite(twist)
        time = now()
        x, y, turn = moved_by(twist, 0.0 if self.last is None else time - self.last)
        self.last = time
        self.at = self.at @ Transform.of(x, y, yaw=turn)
        return PoseInFrame(self.frame_id, time, self.at)


class FuseGyro(Node):
    """Fuse odometry of wheels with the gyroscope of an IMU: wheels slip when turning, a gyroscope drifts slowly.

    Fires once per velocity with a yaw rate. It is an extended Kalman filter of x, y, heading and the bias of the
    gyroscope: the robot turns as the gyroscope says, less its bias; the bias is learned from the difference to what the
    wheels say. After the indirect filters in P. Maybeck, Stochastic Models, Estimation, and Control (1979).

    Attributes:
      frame_id: the frame in which the robot begins.
      speed_noise: standard deviation of the wheels' speeds ahead and aside, over one second.
      turn_noise: standard deviation of the wheels' turning.
      gyro_noise: standard deviation of the heading that the gyroscope gives, over one second.
      bias_noise: by how much the bias changes, over one second.
      start_bias: standard deviation of the bias at the start.
      twist: velocity of the robot, by its wheels.
      yaw_rate: by the gyroscope, counter-clockwise, in rad/s.
      pose: where the robot is now.
      covariance: of x, y and heading.
      bias: of the gyroscope, in rad/s.

    Raises:
      ValueError: a velocity or rate is not finite, a covariance is singular, or the robot is too far away for a float.
    """

    frame_id = Parameter("odom", MinLen(1))
    speed_noise = Parameter(0.05, Interval(ge=0, le=100), unit="m/s")
    turn_noise = Parameter(0.1, Interval(ge=1e-6, le=100), unit="rad/s")
    gyro_noise = Parameter(0.005, Interval(ge=0, le=100), unit="rad/s")
    bias_noise = Parameter(1e-4, Interval(ge=0, le=100), unit="rad/s")
    start_bias = Parameter(0.05, Interval(ge=0, le=100), unit="rad/s")
    twist = Input(Twist)
    yaw_rate = Input(float)
    pose = Output(PoseInFrame)
    covariance = Output(Square)
    bias = Output(float)

    known: State[Any] = State(None)
    last: State[float | None] = State(None)

    def process(self, twist: Twist, yaw_rate: float) -> None:
        """Move on, then learn the bias."""
        _need_finite((*twist, yaw_rate))
        time = now()
        dt = 0.0 if self.last is None else time - self.last
        self.last = time
        start = np.zeros(4), np.diag([0.0, 0.0, 0.0, self.start_bias**2])
        with np.errstate(all="ignore"):
            state, covariance = start if self.known is None else self.known
            state, covariance = self._moved(state, covariance, twist, yaw_rate, dt)
            if dt > 0:
                noise = np.array([[self.turn_noise**2]])
                off = np.array([yaw_rate - twist.omega])
                state, covariance = correct(state, covariance, off, np.array([[0.0, 0.0, 0.0, 1.0]]), noise)
        if not np.isfinite(covariance).all():
            raise ValueError("the covariance of the pose is not finite; is the robot too far away?")
        x, y, heading, bias = map(float, state)
        self.pose.send(PoseInFrame(self.frame_id, time, Transform.of(x, y, yaw=heading)))
        self.known = state, covariance
        self.covariance.send(covariance[:3, :3])
        self.bias.send(bias)

    def _moved(self, state: Any, covariance: Any, twist: Twist, rate: float, dt: float) -> tuple[Any, Any]:
        heading = state[2]
        turn = (rate - state[3]) * dt
        x, y, _ = moved_by(Twist(twist.vx, twist.vy, float(rate - state[3])), dt)
        cos, sin = math.cos(heading), math.sin(heading)
        moved = state + np.array([cos * x - sin * y, sin * x + cos * y, turn, 0.0])
        jacobian = np.eye(4)
        jacobian[:2, 2] = -(sin * x + cos * y), cos * x - sin * y
        jacobian[2, 3] = -dt
        # halfway along the arc the heading has half of its error
        jacobian[:2, 3] = -jacobian[:2, 2] * dt / 2
        speeds = self.speed_noise**2 * dt
        return predict(
            state,
            covariance,
            jacobian,
            np.diag([speeds, speeds, self.gyro_noise**2 * dt, self.bias_noise**2 * dt]),
            moved=moved,
        )
