"""Control laws: the velocity for the next moment, by what is measured now. Whoever calls them keeps what is between.

Nodes of an activity flow graph do (`mission.driving`), and so do states of a machine (`machine.driving`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

from examples.fetch_delivery.messages import Odometry, Scan, Twist
from examples.fetch_delivery.perception.laser import obstacle_ahead
from examples.fetch_delivery.perception.records import Localised, Sighting, Station, Wall, wrapped

__all__ = ["Place", "Pose", "approach", "destination", "move", "sighted", "stand_before"]

Pose: TypeAlias = tuple[float, float, float]
Place: TypeAlias = tuple[float, float]


def destination(odometry: Odometry, x: float, y: float, turn: float) -> Pose:
    """Return where a way leads from here, in the frame of the wheels.

    Args:
      odometry: what the wheels say.
      x: how far ahead; negative is back.
      y: how far to the left.
      turn: how far to turn, counter-clockwise.
    """
    here_x, here_y, theta = odometry.pose
    cos, sin = math.cos(theta), math.sin(theta)
    return here_x + cos * x - sin * y, here_y + sin * x + cos * y, theta + turn


def move(odometry: Odometry, goal: Pose, *, turns: bool, speed: float) -> Twist | None:
    """Go to a pose by odometry only; None: it is there. One that does not turn lets the heading drift."""
    x, y, theta = odometry.pose
    cos, sin = math.cos(theta), math.sin(theta)
    dx, dy, turn = goal[0] - x, goal[1] - y, goal[2] - theta
    left = math.hypot(dx, dy)
    if left < 0.05 and (not turns or abs(turn) < 0.2):
        return None
    pace = min(speed, 0.05 + 1.2 * left) / max(left, 0.05)
    omega = max(-0.8, min(0.8, turn)) if turns else 0.0
    return Twist(pace * (cos * dx + sin * dy), pace * (cos * dy - sin * dx), omega)


def sighted(localised: Localised, seen: Sequence[Sighting], station: Station, target: Place | None) -> Place | None:
    """Say where a bull's-eye is by what was seen: the one nearest to where it should be; None: it was not seen.

    Args:
      localised: where the robot is.
      seen: bull's-eyes.
      station: where it should be, as long as it was never seen.
      target: where it was said to be before; half of what is seen anew counts.
    """
    expected = target if target is not None else (station.x, station.y)
    places = [localised.place(one.x, one.y) for one in seen]
    near = [place for place in places if math.dist(place, expected) < 0.7]
    if not near:
        return None
    best = min(near, key=lambda place: math.dist(place, expected))
    old, gain = (best, 1.0) if target is None else (target, 0.5)
    return old[0] + gain * (best[0] - old[0]), old[1] + gain * (best[1] - old[1])


def stand_before(
    localised: Localised, target: Place, wall: Wall | None, station: Station, distance: float
) -> Twist | None:
    """Stand before a bull's-eye at a distance, looking straight at the wall that bears it; None: it stands so.

    Args:
      localised: where the robot is.
      target: where the bull's-eye is.
      wall: what the laser sees ahead, which it measures better than a camera; without one the heading is the station's.
      station: that it belongs to.
      distance: from the wall.
    """
    x, y, theta = localised.pose
    dx, dy = target[0] - x, target[1] - y
    ahead, left = math.cos(theta) * dx + math.sin(theta) * dy, math.cos(theta) * dy - math.sin(theta) * dx
    turn = wall.angle if wall is not None else float(wrapped(station.theta + math.pi - theta))
    far = wall.distance if wall is not None else ahead
    aside = math.cos(turn) * left - math.sin(turn) * ahead  # along the wall
    if abs(aside) < 0.025 and abs(turn) < 0.05 and far < distance + 0.1:
        return None
    on = max(-0.2, min(0.3, 0.8 * (far - distance)))
    across = max(-0.25, min(0.25, 1.2 * aside))
    cos, sin = math.cos(turn), math.sin(turn)
    return Twist(cos * on - sin * across, sin * on + cos * across, max(-0.6, min(0.6, 1.2 * turn)))


def approach(scan: Scan, distance: float, speed: float) -> Twist | None:
    """Drive straight ahead until something is near; None: it is.

    Args:
      scan: of the laser.
      distance: how near, from the middle of the robot.
      speed: at most.
    """
    left: Any = obstacle_ahead.function(scan, width=0.3) - distance
    return None if left < 0.015 else Twist(min(speed, 0.03 + math.sqrt(2 * 0.25 * left)))
