"""The robot: front and rear wheels steer against each other, so its middle moves without slipping aside.

Speed and steering change only so fast. Its wheels and its inertial unit measure with errors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from examples.follow_person.messages import Imu, Twist
from examples.follow_person.world.course import Ground

LENGTH_M: Final = 0.72
WIDTH_M: Final = 0.6
WHEELBASE_M: Final = 0.5
HOLDS_S: Final = 0.35  # a command holds no longer
_STEPS: Final = 5  # of integration, in each step of the world


@dataclass(frozen=True)
class Limits:
    """What the robot can do.

    Attributes:
      speed: at most, in m/s, ahead.
      acceleration: in m/s².
      braking: in m/s².
      steering: greatest angle of the wheels, in radians.
      steering_rate: how fast that changes, in rad/s.
    """

    speed: float = 2.5
    acceleration: float = 2.0
    braking: float = 3.0
    steering: float = 0.42
    steering_rate: float = 1.5


@dataclass(frozen=True)
class Errors:
    """By how much sensors of motion are off.

    Attributes:
      scale: of the wheels' speed, relative.
      turn_scale: of how much the wheels say that it turns, relative.
      bias: of the gyroscope, in rad/s.
      tilt: of roll and pitch, in radians.
    """

    scale: float
    turn_scale: float
    bias: float
    tilt: float

    @classmethod
    def drawn(cls, drift: float, random: np.random.Generator) -> Errors:
        """Draw them; `drift` 1 is usual, 0 is exact."""
        scale, turn, bias, tilt = random.normal(0, 1, 4) * drift
        return cls(0.01 * scale, 0.05 * turn, 0.004 * bias, 0.004 * tilt)


class Vehicle:
    """The robot's body.

    Attributes:
      x, y, theta: where its middle is.
      speed: ahead, in m/s.
      steering: angle of its front wheels.
      driven_m: how far it has driven.
    """

    def __init__(self, x: float, y: float, theta: float, errors: Errors, limits: Limits) -> None:
        self.x, self.y, self.theta = x, y, theta
        self.speed, self.steering, self.driven_m = 0.0, 0.0, 0.0
        self._errors, self._limits = errors, limits
        self._measured = (0.0, 0.0)
        self._command, self._age_s = Twist(0.0, 0.0, 0.0), math.inf

    def command(self, twist: Twist) -> None:
        """Drive so from now on."""
        self._command, self._age_s = twist, 0.0

    def step(self, dt: float) -> None:
        """Move on."""
        limits, small = self._limits, dt / _STEPS
        wanted = self._command if self._age_s < HOLDS_S else Twist(0.0, 0.0, 0.0)
        self._age_s += dt
        fast = max(-limits.speed / 2, min(limits.speed, wanted.vx))
        angle = self.steering
        if abs(wanted.vx) > 1e-3:
            angle = math.atan(wanted.omega / wanted.vx * WHEELBASE_M / 2)
            angle = max(-limits.steering, min(limits.steering, angle))
        theta, moved = self.theta, 0.0
        for _ in range(_STEPS):
            slower = abs(fast) < abs(self.speed) or fast * self.speed < 0
            most = (limits.braking if slower else limits.acceleration) * small
            self.speed += max(-most, min(most, fast - self.speed))
            turn = limits.steering_rate * small
            self.steering += max(-turn, min(turn, angle - self.steering))
            omega = self.omega
            middle = self.theta + omega * small / 2
            self.x += self.speed * math.cos(middle) * small
            self.y += self.speed * math.sin(middle) * small
            self.theta += omega * small
            self.driven_m += abs(self.speed) * small
            moved += self.speed * small
        self._measured = moved / dt, (self.theta - theta) / dt

    @property
    def omega(self) -> float:
        """How fast it turns."""
        return self.speed * 2 * math.tan(self.steering) / WHEELBASE_M

    def tilt(self, ground: Ground) -> tuple[float, float]:
        """Return roll and pitch on the ground."""
        along_x, along_y = ground.slope(self.x, self.y)
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        return math.atan(cos * along_y - sin * along_x), -math.atan(cos * along_x + sin * along_y)

    def odometry(self, random: np.random.Generator) -> Twist:
        """Return what the wheels measure: the mean over the last step, because encoders count."""
        noise = random.normal(0, 1, 2)
        moved, turned = self._measured
        speed = moved * (1 + self._errors.scale) + 0.01 * noise[0] * (moved != 0)
        turn = turned * (1 + self._errors.turn_scale) + 0.02 * noise[1] * (moved != 0)
        return Twist(float(speed), 0.0, float(turn))

    def imu(self, ground: Ground, random: np.random.Generator) -> Imu:
        """Return what the inertial unit measures; of its gyroscope the mean over the last step."""
        roll, pitch = self.tilt(ground)
        noise = random.normal(0, 1, 3)
        return Imu(
            float(self._measured[1] + self._errors.bias + 0.003 * noise[0]),
            float(roll + self._errors.tilt + 0.003 * noise[1]),
            float(pitch + self._errors.tilt + 0.003 * noise[2]),
        )

    def gap(self, x: float, y: float, radius: float) -> float:
        """Return the distance between its edge and a disk; negative if they overlap."""
        dx, dy = x - self.x, y - self.y
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        ahead, left = abs(cos * dx + sin * dy) - LENGTH_M / 2, abs(cos * dy - sin * dx) - WIDTH_M / 2
        return math.hypot(max(ahead, 0.0), max(left, 0.0)) + min(0.0, max(ahead, left)) - radius
