"""The world moves on, and is measured. Nothing here knows of graphs."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from examples.follow_person.messages import Array, Camera, Imu, Photo, RingScan, Twist
from examples.follow_person.world.course import KINDS, Course
from examples.follow_person.world.people import People
from examples.follow_person.world.rendering import Photographer
from examples.follow_person.world.scanning import ABOVE_M, Laser
from examples.follow_person.world.scoring import Score
from examples.follow_person.world.vehicle import Errors, Limits, Vehicle
from hfg.geometry import Transform

_BEHIND_M = 3.5  # distance of the robot from the person at the start


@dataclass(frozen=True)
class Conditions:
    """What the world is like.

    Attributes:
      course: "open", or "dense" with many trees close to the way.
      others: how many people there are besides the one who is followed.
      pace: of the person, on average, in m/s.
      speed: of the robot, at most, in m/s.
      steepness: of the steepest slope.
      noise: standard deviation of a range of the laser, in metres.
      drift: of the wheels and the inertial unit; 1 is usual.
      light: how bright it is; 1 is a clear day.
      columns: number of rays in each ring of the laser.
    """

    course: Literal["open", "dense"] = "open"
    others: int = 6
    pace: float = 1.9
    speed: float = 2.5
    steepness: float = 0.12
    noise: float = 0.02
    drift: float = 1.0
    light: float = 1.0
    columns: int = 600


class Simulation:
    """The world.

    Attributes:
      course: ground, way and trees.
      people: who is there.
      robot: the vehicle.
      score: what happened.
      now_s: its time.
    """

    def __init__(self, seed: int, conditions: Conditions | None = None) -> None:
        """Build it; the same seed and conditions always give the same world."""
        conditions = conditions or Conditions()
        streams = [np.random.default_rng(one) for one in np.random.SeedSequence(seed).spawn(6)]
        self.conditions, self.now_s, self.score = conditions, 0.0, Score()
        self.course = Course(KINDS[conditions.course], conditions.steepness, streams[0])
        self.people = People(self.course, conditions.others, conditions.pace, streams[1])
        x, y = self.course.way.at(-_BEHIND_M)
        errors = Errors.drawn(conditions.drift, streams[2])
        limits = Limits(speed=conditions.speed)
        self.robot = Vehicle(float(x), float(y), self.course.way.heading(-_BEHIND_M / 2), errors, limits)
        self._laser = Laser(conditions.columns, conditions.noise)
        self._photographer = Photographer(Camera(), 3.0, streams[4])
        self._random, self._drift = streams[3], streams[2]
        height = self.course.ground.height(self.course.trunks[:, 0], self.course.trunks[:, 1])
        self._cylinders: Array = np.column_stack([self.course.trunks[:, :3], height, height + self.course.trunks[:, 3]])

    def step(self, dt: float) -> None:
        """Let time pass."""
        self.now_s += dt
        self.robot.step(dt)
        self.people.step(dt, self.robot)
        self.score.note(self.now_s, dt, self.robot, self.people, self.course)

    def command(self, twist: Twist) -> None:
        """Let the robot drive so."""
        self.robot.command(twist)

    def scan(self) -> RingScan:
        """Measure a turn of the laser."""
        place, turn = self._mounted(ABOVE_M)
        cylinders = np.concatenate([self._cylinders, self.people.cylinders()])
        return self._laser.scan(place, turn, self.course.ground, cylinders, self.now_s, self._random)

    def odometry(self) -> Twist:
        """Measure the wheels."""
        return self.robot.odometry(self._drift)

    def imu(self) -> Imu:
        """Measure the inertial unit."""
        return self.robot.imu(self.course.ground, self._drift)

    def photo(self) -> Photo:
        """Take a picture."""
        camera = self._photographer.camera
        place, turn = self._mounted(camera.above)
        near = self._near(45.0)
        people = [self.people.person, *self.people.others]
        picture = self._photographer.take(
            place, turn, self.course.ground, self.course.trunks[near], people, self.conditions.light
        )
        return Photo(picture, self.now_s, camera)

    def _near(self, reach: float) -> Any:
        off = self.course.trunks[:, :2] - (self.robot.x, self.robot.y)
        return np.hypot(off[:, 0], off[:, 1]) < reach

    def _mounted(self, above: float) -> tuple[tuple[float, float, float], Any]:
        """Return place and rotation of a sensor at some height above the robot's frame."""
        robot = self.robot
        roll, pitch = robot.tilt(self.course.ground)
        turn = Transform.of(roll=roll, pitch=pitch, yaw=robot.theta).turn
        x, y, z = turn @ (0.0, 0.0, above)
        height = float(self.course.ground.height(robot.x, robot.y))
        return (robot.x + float(x), robot.y + float(y), height + float(z)), turn

    def distance(self) -> float:
        """Return how far the robot is from the person."""
        person = self.people.person
        return math.dist((self.robot.x, self.robot.y), (person.x, person.y))
