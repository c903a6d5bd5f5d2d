"""Results of perception, as plain records. Places are in the frame in which the robot began, "odom"."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from examples.follow_person.messages import Array
from hfg.nodes.estimation import Track


class Look(NamedTuple):
    """The colours that a person wears, whatever the light.

    Attributes:
      shirt: share of blue and of green in it.
      trousers: the same.
      seen: in how many pictures.
    """

    shirt: tuple[float, float]
    trousers: tuple[float, float]
    seen: int

    def differs(self, other: Look) -> float:
        """Return how different two are; 0 is the same."""
        return math.dist(self.shirt, other.shirt) + 0.5 * math.dist(self.trousers, other.trousers)

    def mixed(self, other: Look, share: float) -> Look:
        """Return this one, with a share of another one."""
        shirt, trousers = (
            (one[0] + share * (new[0] - one[0]), one[1] + share * (new[1] - one[1]))
            for one, new in ((self.shirt, other.shirt), (self.trousers, other.trousers))
        )
        return Look(shirt, trousers, self.seen + 1)


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What is around the robot at one moment.

    Attributes:
      stamp: when.
      pose: of the robot: x, y, heading.
      roll: of the robot.
      pitch: of the robot.
      speed: of the robot, in m/s.
      tracks: what may be a person.
      tops: how high each track is, above the ground below the robot, by its number.
    """

    stamp: float
    pose: Array
    roll: float
    pitch: float
    speed: float
    tracks: list[Track]
    tops: dict[int, float]

    def seen_from_robot(self, x: float, y: float) -> tuple[float, float]:
        """Return how far ahead of the robot and to its left a place is."""
        cos, sin = math.cos(self.pose[2]), math.sin(self.pose[2])
        dx, dy = x - self.pose[0], y - self.pose[1]
        return float(cos * dx + sin * dy), float(cos * dy - sin * dx)


@dataclass(frozen=True, slots=True)
class Person:
    """The person who is followed.

    Attributes:
      track: number of the track.
      x, y: the place.
      vx, vy: the velocity.
      stamp: when.
      look: the clothes; None as long as they were not seen.
      is_seen: now; else the place is predicted.
      trail: where they have walked, the last metres of it.
    """

    track: int
    x: float
    y: float
    vx: float
    vy: float
    stamp: float
    look: Look | None = None
    is_seen: bool = True
    trail: tuple[tuple[float, float], ...] = ()

    def at(self, stamp: float, longest_s: float = 1.5) -> tuple[float, float]:
        """Return where they should be at another moment."""
        dt = min(max(stamp - self.stamp, 0.0), longest_s)
        return self.x + self.vx * dt, self.y + self.vy * dt


def planar(transform: Any) -> Array:
    """Return x, y and heading of a transform."""
    x, y, _ = transform.translation
    return np.array([x, y, transform.angles[2]])
