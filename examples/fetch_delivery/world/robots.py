"""How a robot moves, what it bumps into, and where its wheels believe it is.

It can drive in every direction and turn meanwhile, both within limits of speed and acceleration. It brakes without a
command for a while. Numbers are plain floats here: arrays of three are slower than three numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from examples.fetch_delivery.messages import Twist
from examples.fetch_delivery.world.arena import Arena

RADIUS_M = 0.25
COMMAND_HOLDS_S = 0.5
ANGULAR_ACCELERATION = 3.0  # rad/s2


@dataclass(frozen=True)
class Limits:
    """What the motors can do.

    Attributes:
      speed: in m/s, in whatever direction.
      turning: in rad/s.
      acceleration: in m/s2; braking too.
    """

    speed: float = 0.6
    turning: float = 1.5
    acceleration: float = 0.8

    def __post_init__(self) -> None:
        """Refuse what no motor can do."""
        for name, most in (("speed", 3.0), ("turning", 6.0), ("acceleration", 10.0)):
            value = getattr(self, name)
            if not 0 < value <= most:
                raise ValueError(f"a robot's limit of {name} lies above 0 and up to {most}, not at {value}")


class Robot:
    """One robot: where it really is, how it moves, and its odometry.

    Attributes:
      x: where it really is, in the arena's frame; the same for `y` and `theta`.
      vx: its velocity in its own frame; the same for `vy` and `omega`.
      lamp: whether its green lamp is on.
      contact: whether it touched something in the last step.
      odometry: where the wheels say it is, from where it began.
    """

    def __init__(
        self, pose: tuple[float, float, float], limits: Limits, random: np.random.Generator, drift: float = 1.0
    ) -> None:
        """Put it somewhere; `random` decides how its odometry drifts, `drift` by how many times of the usual."""
        self.x, self.y, self.theta = pose
        self.vx = self.vy = self.omega = 0.0
        self.limits = limits
        self.lamp = False
        self.contact = False
        self.odometry = (0.0, 0.0, 0.0)
        self._command = Twist()
        self._commanded_s = -math.inf
        self._random = random
        # One to two per cent of the way and of the turns, either sign, for the whole run; the rest is noise.
        self._way, self._turns, self._skew = (
            1 + drift * random.choice((-1, 1)) * random.uniform(0.01, 0.02) for _ in range(3)
        )
        self._slip = 0.005 * drift

    @property
    def speed(self) -> float:
        """How fast it moves, in m/s."""
        return math.hypot(self.vx, self.vy)

    def command(self, twist: Twist, now_s: float) -> None:
        """Drive so, as well as the motors can, until told otherwise or told nothing for half a second.

        Raises:
          ValueError: if a number of it is not finite.
        """
        if not all(map(math.isfinite, twist)):
            raise ValueError(f"a robot can only be commanded finite velocities, not {twist}")
        self._command, self._commanded_s = twist, now_s

    def move(self, dt: float, now_s: float) -> None:
        """Accelerate towards the command and drive for `dt` seconds; walls are not looked at yet."""
        command = self._command if now_s - self._commanded_s <= COMMAND_HOLDS_S else Twist()
        most = self.limits.speed / max(math.hypot(command.vx, command.vy), self.limits.speed)
        ax, ay = command.vx * most - self.vx, command.vy * most - self.vy
        share = self.limits.acceleration * dt / max(math.hypot(ax, ay), self.limits.acceleration * dt)
        self.vx += ax * share
        self.vy += ay * share
        turning = min(max(command.omega, -self.limits.turning), self.limits.turning)
        self.omega += min(max(turning - self.omega, -ANGULAR_ACCELERATION * dt), ANGULAR_ACCELERATION * dt)
        self._roll(dt)
        self.x, self.y, self.theta = _moved(self.x, self.y, self.theta, self.vx * dt, self.vy * dt, self.omega * dt)

    def push_out(self, nx: float, ny: float, depth: float) -> None:
        """Send way to something it touches: by `depth` along a normal, and without the speed against it."""
        self.contact = True
        self.x += nx * depth
        self.y += ny * depth
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        against = nx * (cos * self.vx - sin * self.vy) + ny * (sin * self.vx + cos * self.vy)
        if against < 0:
            self.vx -= against * (cos * nx + sin * ny)
            self.vy -= against * (cos * ny - sin * nx)

    def shift(self, dx: float, dy: float, turn: float) -> None:
        """Be pushed, as seen from the robot: its wheels do not notice."""
        self.x, self.y, self.theta = _moved(self.x, self.y, self.theta, dx, dy, turn)

    def mislead(self, dx: float, dy: float, turn: float) -> None:
        """Let the odometry jump, as seen from the robot."""
        self.odometry = _moved(*self.odometry, dx, dy, turn)

    def _roll(self, dt: float) -> None:
        way, turn = self.speed * dt, abs(self.omega) * dt
        slip = self._random.normal(0.0, 1.0, 3)
        self.odometry = _moved(
            *self.odometry,
            self.vx * dt * self._way + self._slip * math.sqrt(way) * slip[0],
            self.vy * dt * self._skew + self._slip * math.sqrt(way) * slip[1],
            self.omega * dt * self._turns + self._slip * (math.sqrt(way) + math.sqrt(turn)) * slip[2],
        )


def collide(robots: list[Robot], arena: Arena, discs: list[tuple[float, float, float]]) -> None:
    """Push robots out of walls, out of each other and out of whatever stands about."""
    for robot in robots:
        robot.contact = False
    for number, robot in enumerate(robots):
        for other in robots[number + 1 :]:
            _part(robot, other)
        for x, y, radius in discs:
            gap = math.hypot(robot.x - x, robot.y - y)
            if 1e-9 < gap < radius + RADIUS_M:
                robot.push_out((robot.x - x) / gap, (robot.y - y) / gap, radius + RADIUS_M - gap)
        _against_wall(robot, arena)
        _against_octagon(robot, arena)


def _part(one: Robot, other: Robot) -> None:
    gap = math.hypot(one.x - other.x, one.y - other.y)
    if 1e-9 < gap < 2 * RADIUS_M:
        nx, ny, half = (one.x - other.x) / gap, (one.y - other.y) / gap, RADIUS_M - gap / 2
        one.push_out(nx, ny, half)
        other.push_out(-nx, -ny, half)


def _against_wall(robot: Robot, arena: Arena) -> None:
    if math.hypot(robot.x, robot.y) < arena.apothem - RADIUS_M:
        return
    for nx, ny, offset in arena.wall.rows:
        depth = nx * robot.x + ny * robot.y + RADIUS_M - offset
        if depth > 0:
            robot.push_out(-nx, -ny, depth)


def _against_octagon(robot: Robot, arena: Arena) -> None:
    # The nearest side decides. At a corner this keeps a robot off a little more than the corner does.
    if math.hypot(robot.x, robot.y) > 2.0:
        return
    nx, ny, offset = max(arena.octagon.rows, key=lambda row: row[0] * robot.x + row[1] * robot.y - row[2])
    depth = offset + RADIUS_M - nx * robot.x - ny * robot.y
    if depth > 0:
        robot.push_out(nx, ny, depth)


def _moved(x: float, y: float, theta: float, dx: float, dy: float, turn: float) -> tuple[float, float, float]:
    """Return a pose moved as seen from itself; a turn and a way at once are driven as an arc."""
    cos, sin = math.cos(theta + turn / 2), math.sin(theta + turn / 2)
    return x + cos * dx - sin * dy, y + sin * dx + cos * dy, theta + turn
