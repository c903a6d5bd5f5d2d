"""The arena in time: robots drive, people react, sensors measure on demand.

Nothing here knows the time of day: `step` moves on, and everything that looks like chance comes from the seed. What a
sensor measures depends on the moment alone, not on how often anybody has asked, so that who looks less often lives in
the same world.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal, TypeAlias, TypeVar

import cv2
import numpy as np

from examples.fetch_delivery.messages import Odometry, Picture, Scan, Twist, Vector
from examples.fetch_delivery.world import scanning
from examples.fetch_delivery.world.arena import Arena, Station
from examples.fetch_delivery.world.faults import (
    AbsentOperator,
    BlockedStation,
    Fault,
    HiddenSign,
    LostLocalisation,
    PushedRobot,
    UnreadableCube,
)
from examples.fetch_delivery.world.operators import Handover, Operator
from examples.fetch_delivery.world.rendering import EXPOSURE_S, Cube, Renderer, Round
from examples.fetch_delivery.world.robots import RADIUS_M, Limits, Robot, collide
from examples.fetch_delivery.world.scoring import Score
from examples.fetch_delivery.world.surroundings import USUAL, Surroundings

TICK_S = 0.05
CRATE_M, CRATE_HEIGHT_M = 0.3, 0.6
ROBOT_HEIGHT_M = 0.42
START_M = 4.2  # from the middle
DRIVING = 0.05  # m/s

Cameras: TypeAlias = Literal["light", "mujoco"]

_Kind = TypeVar("_Kind", bound=Fault)


class Simulation:
    """The arena, up to four robots in it, and the people around.

    Attributes:
      arena: where walls, signs and stations really are.
      robots: where the robots really are; for tests, pictures of the run and referees, not for the robots.
      scores: one for each robot.
      light: how bright it is, 1 as usual, 0 in the dark.
      blocked: the station before which a crate stands now, besides those of faults; None if there is none.
    """

    def __init__(
        self,
        seed: int = 0,
        *,
        robots: int = 1,
        limits: Limits | None = None,
        faults: tuple[Fault, ...] = (),
        start_s: float = 1.0,
        cameras: Cameras = "light",
        surroundings: Surroundings = USUAL,
    ) -> None:
        """Set everything up; equal arguments give equal worlds.

        Args:
          seed: decides what looks like chance.
          robots: how many.
          limits: what their motors can do.
          faults: what should go wrong.
          start_s: when the referee says "start".
          cameras: what draws the pictures: the light renderer, or MuJoCo, which needs a package and OpenGL.
          surroundings: how large everything is, and how badly is measured.

        Raises:
          ValueError: if a value is out of its range.
          CamerasMissing: if MuJoCo cannot draw here.
        """
        if not 1 <= robots <= 4:
            raise ValueError(f"one to four robots fit into the arena, not {robots}")
        if seed < 0:
            raise ValueError(f"a seed is a whole number from 0, not {seed}")
        if not (math.isfinite(start_s) and start_s >= 0):
            raise ValueError(f"the start is at 0 s or later, not at {start_s} s")
        cv2.setNumThreads(1)  # threads of its own would only fight with those of the graph
        lots = np.random.default_rng((seed, 0))
        self._seed, self._start_s, self._faults = seed, start_s, faults
        self._surroundings = surroundings
        digits = tuple(int(digit) for digit in lots.permutation(4) + 1)
        self.arena = Arena(digits, radius=surroundings.radius, octagon=surroundings.octagon)
        self.robots = [
            Robot(
                self._start(number, lots),
                limits or Limits(),
                np.random.default_rng((seed, 1, number)),
                surroundings.drift,
            )
            for number in range(robots)
        ]
        self.scores = [Score() for _ in range(robots)]
        self._operators = [Operator(np.random.default_rng((seed, 2, number))) for number in range(robots)]
        self._cubes: list[Cube | None] = [None] * robots
        self._touched = [False] * robots
        self._ticks = 0
        self.light = surroundings.light
        self.blocked: Station | None = None
        self._renderer = _renderer(cameras, self.arena)
        self._check_faults()

    @property
    def now_s(self) -> float:
        """How long it has run."""
        return self._ticks * TICK_S

    # --- time ---

    def step(self, dt: float) -> None:
        """Let `dt` seconds pass.

        Raises:
          ValueError: if that is not a whole number of ticks of 0.05 s, at least one.
        """
        ticks = round(dt / TICK_S) if math.isfinite(dt) else 0
        if ticks < 1 or abs(ticks * TICK_S - dt) > 1e-9:
            raise ValueError(f"the arena moves on in ticks of {TICK_S} s, not by {dt} s; step by a multiple of them")
        for _ in range(ticks):
            self._tick()

    def message(self) -> str:
        """Hear what the referee says."""
        return "start" if self.now_s >= self._start_s else "ready?"

    # --- what robots do ---

    def command(self, robot: int, twist: Twist) -> None:
        """Command a velocity; it holds for half a second.

        Raises:
          ValueError: if there is no such robot, or a number is not finite.
        """
        self._robot(robot).command(twist, self.now_s)

    def set_lamp(self, robot: int, on: bool) -> None:
        """Switch the green lamp.

        Raises:
          ValueError: if there is no such robot.
        """
        self._robot(robot).lamp = on

    def report(self, robot: int, number: int | None) -> None:
        """Hear that a cube cannot be delivered.

        Args:
          robot: who says it.
          number: of the cube; None if that cannot be read.

        Raises:
          ValueError: if there is no such robot.
        """
        self._robot(robot)
        self.scores[robot].reported.append((self.now_s, number))

    # --- what people do to them ---

    def push(self, robot: int, dx: float, dy: float, turn: float) -> None:
        """Push a robot, as seen from it: its wheels do not notice.

        Raises:
          ValueError: if there is no such robot.
        """
        self._robot(robot).shift(dx, dy, turn)

    def limit(self, speed: float) -> None:
        """Let all motors reach this speed, in m/s, and no more.

        Raises:
          ValueError: if no motor can do that.
        """
        for robot in self.robots:
            robot.limits = replace(robot.limits, speed=speed)

    def handing_over(self) -> list[tuple[int, Station, float]]:
        """Return the robots that people have begun to serve: number, station, and in how many seconds they are done."""
        served = []
        for number, (robot, operator) in enumerate(zip(self.robots, self._operators, strict=True)):
            if operator.due_s is not None and math.isfinite(operator.due_s):
                served.append((number, self.arena.nearest(robot.x, robot.y), operator.due_s - self.now_s))
        return served

    # --- what robots sense ---

    def odometry(self, robot: int) -> Odometry:
        """Ask the wheels."""
        body = self._robot(robot)
        return Odometry(np.array(body.odometry), np.array([body.vx, body.vy, body.omega]), self.now_s)

    def scan(self, robot: int) -> Scan:
        """Turn the laser once."""
        body = self._robot(robot)
        discs = [(other.x, other.y, RADIUS_M) for other in self.robots if other is not body] + self.crates()
        table = np.array(discs).reshape(-1, 3)
        ranges = scanning.cast(self.arena, body.x, body.y, body.theta + scanning.ANGLES, table)
        noise = self._chance(3, robot).normal(self._surroundings.offset, self._surroundings.noise, len(ranges))
        noisy: Vector = np.where(ranges < scanning.MAX_RANGE_M, np.maximum(ranges + noise, 0.0), ranges)
        return Scan(noisy, scanning.ANGLES, self.now_s, scanning.MAX_RANGE_M)

    def front_picture(self, robot: int) -> Picture:
        """Take a picture with the camera that looks ahead."""
        body = self._robot(robot)
        others = [Round(other.x, other.y, RADIUS_M, ROBOT_HEIGHT_M, 60) for other in self.robots if other is not body]
        crates = [Round(x, y, radius, CRATE_HEIGHT_M, 90) for x, y, radius in self.crates()]
        hidden = (f"digit {fault.digit}" for fault in self._now(HiddenSign))
        return self._renderer.front(
            (body.x, body.y, body.theta),
            around=(*others, *crates),
            hidden=frozenset(hidden),
            turning=body.omega,
            sideways=body.vy,
            shake=self._shake(4, robot),
            light=self.light,
            exposure_s=EXPOSURE_S * self._surroundings.blur,
        )

    def basket_picture(self, robot: int) -> Picture:
        """Take a picture with the camera that looks into the basket."""
        self._robot(robot)
        return self._renderer.basket(self._cubes[robot], shake=self._shake(5, robot), light=self.light)

    # --- what a referee knows ---

    def cube(self, robot: int) -> int | None:
        """Say which cube really lies in a basket."""
        self._robot(robot)
        cube = self._cubes[robot]
        return None if cube is None else cube.number

    # --- inside ---

    def _tick(self) -> None:
        before = self.now_s
        self._ticks += 1
        for robot in self.robots:
            robot.move(TICK_S, before)
        for fault in self._faults:
            if before <= fault.at_s < self.now_s:
                self._strike(fault)
        collide(self.robots, self.arena, self.crates())
        for number in range(len(self.robots)):
            self._judge(number)
            self._let_operator(number)

    def _strike(self, fault: Fault) -> None:
        if isinstance(fault, PushedRobot):
            self.robots[fault.robot].shift(fault.dx, fault.dy, fault.turn)
        elif isinstance(fault, LostLocalisation):
            self.robots[fault.robot].mislead(fault.dx, fault.dy, fault.turn)

    def _judge(self, number: int) -> None:
        robot, score = self.robots[number], self.scores[number]
        score.driven_m += robot.speed * TICK_S
        if robot.contact:
            score.contact_s += TICK_S
            if not self._touched[number]:
                score.contacts.append(self.now_s)
        self._touched[number] = robot.contact
        if robot.lamp and robot.speed > DRIVING:
            score.lamp_while_driving_s += TICK_S

    def _let_operator(self, number: int) -> None:
        robot, operator, cube = self.robots[number], self._operators[number], self._cubes[number]
        at = (robot.x, robot.y)
        if robot.lamp and self._is_left_alone(at):
            return
        unreadable = tuple(f.cube for f in self._faults if isinstance(f, UnreadableCube) and f.robot == number)
        handover = operator.watch(self.now_s, robot.lamp, at, cube, self.arena, unreadable, self._surroundings.reach)
        if handover is not None:
            self._hand_over(number, handover)

    def _is_left_alone(self, at: tuple[float, float]) -> bool:
        station = self.arena.nearest(*at)
        return any((f.kind, f.number) == (station.kind, station.number) for f in self._now(AbsentOperator))

    def _hand_over(self, number: int, handover: Handover) -> None:
        score, before, now = self.scores[number], handover.taken, handover.given
        if before is not None and handover.station.kind == "delivery":
            right = before.number == handover.station.number
            (score.delivered if right else score.wrong).append((self.now_s, before.number))
        elif before is not None:
            score.returned.append((self.now_s, before.number))
        if now is not None and not handover.set_right:
            score.fetched.append((self.now_s, now.number))
        self._cubes[number] = now

    def _now(self, kind: type[_Kind]) -> list[_Kind]:
        return [fault for fault in self._faults if isinstance(fault, kind) and fault.lasts(self.now_s)]

    def crates(self) -> list[tuple[float, float, float]]:
        """Say where crates stand: x, y and radius."""
        blocked = [self.arena.station(fault.kind, fault.number) for fault in self._now(BlockedStation)]
        if self.blocked is not None:
            blocked.append(self.blocked)
        return [(one.x + 0.5 * math.cos(one.facing), one.y + 0.5 * math.sin(one.facing), CRATE_M) for one in blocked]

    def _check_faults(self) -> None:
        for fault in self._faults:
            if isinstance(fault, BlockedStation | AbsentOperator):
                self.arena.station(fault.kind, fault.number)
            elif isinstance(fault, HiddenSign):
                self.arena.station("delivery", fault.digit)
            elif isinstance(fault, PushedRobot | LostLocalisation | UnreadableCube):
                self._robot(fault.robot)

    def _robot(self, number: int) -> Robot:
        if not 0 <= number < len(self.robots):
            raise ValueError(f"there is no robot {number}; there are {len(self.robots)}, counted from 0")
        return self.robots[number]

    def _chance(self, kind: int, robot: int) -> np.random.Generator:
        return np.random.default_rng((self._seed, kind, robot, self._ticks))

    def _shake(self, kind: int, robot: int) -> tuple[int, int]:
        down, right = self._chance(kind, robot).integers(0, 128, 2)
        return int(down), int(right)

    @staticmethod
    def _start(number: int, lots: np.random.Generator) -> tuple[float, float, float]:
        angle = math.pi / 2 * number + math.pi / 8 + float(lots.uniform(-0.15, 0.15))
        return (
            START_M * math.cos(angle),
            START_M * math.sin(angle),
            angle + math.pi / 2 + float(lots.uniform(-0.2, 0.2)),
        )


def _renderer(cameras: Cameras, arena: Arena) -> Renderer:
    if cameras == "light":
        return Renderer(arena)
    from examples.fetch_delivery.world.mujoco_cameras import MujocoRenderer  # OpenGL only for who wants it

    return MujocoRenderer(arena)
