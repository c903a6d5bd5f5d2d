"""What perception says: signs, cubes, walls, other robots, stations, and where the robot is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from examples.fetch_delivery.messages import Vector
from examples.fetch_delivery.perception.shape import Shape


class Sighting(NamedTuple):
    """A sign in the robot's frame.

    Attributes:
      label: "bullseye", or the digit.
      x: where its middle is, ahead of the robot's centre, in metres.
      y: to the left of it.
      facing: the direction into which the panel looks, in the robot's frame; NaN where the picture does not tell.
      score: how well it matches, 0 to 1.
    """

    label: str
    x: float
    y: float
    facing: float
    score: float

    @property
    def bearing(self) -> float:
        """The direction in which it is, from the robot's heading, counter-clockwise."""
        return math.atan2(self.y, self.x)

    @property
    def distance(self) -> float:
        """How far it is from the robot's centre."""
        return math.hypot(self.x, self.y)


class Cube(NamedTuple):
    """What lies in the basket.

    Attributes:
      state: "none", "unreadable": there is a cube whose code cannot be read, or "number".
      station: whose cube it is, 1 to 4; 0 unless the state is "number".
    """

    state: Literal["none", "unreadable", "number"]
    station: int = 0


class Wall(NamedTuple):
    """A straight wall ahead.

    Attributes:
      distance: along the normal of the wall, in metres.
      angle: how far the robot has to turn, counter-clockwise, to look straight at it.
    """

    distance: float
    angle: float


@dataclass(frozen=True, slots=True, eq=False)
class Localised:
    """Where the robot is.

    Attributes:
      pose: in the map frame.
      covariance: of x, y and theta.
      quality: how much of the scan the arena's shape explains, of what other robots do not hide, 0 to 1.
      sure: false while the robot is lost, or while several places look the same to it.
      stamp: of the scan.
      shape: the map: how large the arena is, as far as it has been measured.
    """

    pose: Vector
    covariance: Vector
    quality: float
    sure: bool
    stamp: float
    shape: Shape

    @property
    def fits(self) -> bool:
        """Whether the scan fits the pose, so that it is safe to drive.

        The pose need not be the right one of those that look the same.
        """
        return self.quality > 0.6

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Return where a point of the robot's frame is in the map."""
        cos, sin = math.cos(self.pose[2]), math.sin(self.pose[2])
        return float(self.pose[0] + cos * x - sin * y), float(self.pose[1] + sin * x + cos * y)


class Sign(NamedTuple):
    """Where a digit is, as far as it is known.

    Attributes:
      x: in the map frame.
      y: in the map frame.
      theta: into which direction it looks.
      sigma: how sure the place is, in metres.
      sightings: on how many that stands.
    """

    x: float
    y: float
    theta: float
    sigma: float
    sightings: float


class Station(NamedTuple):
    """A place where cubes are inserted or removed.

    Attributes:
      x: of the middle of its surface, in the map frame.
      y: of it.
      theta: the direction in which the surface looks, into the free.
      sightings: how often its bull's-eye was seen.
    """

    x: float
    y: float
    theta: float
    sightings: int = 0

    @classmethod
    def side(cls, shape: Shape, number: int, sightings: int = 0) -> Station:
        """Return the station on a side of the octagon."""
        return cls(*shape.side(number), sightings)

    def before(self, distance: float) -> Vector:
        """Return the pose at a distance before the surface, that faces it."""
        heading = math.remainder(self.theta + math.pi, 2 * math.pi)
        return np.array([self.x + distance * math.cos(self.theta), self.y + distance * math.sin(self.theta), heading])


def wrapped(angle: Any) -> Any:
    """Return an angle between -pi and pi."""
    return np.remainder(angle + math.pi, 2 * math.pi) - math.pi
