"""A path to a place: over a grid of what the arena's shape leaves free, around the robots that the laser shows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

import hfg
from examples.fetch_delivery.messages import Vector
from examples.fetch_delivery.perception import shape
from examples.fetch_delivery.perception.records import Localised
from hfg.nodes.robotics import Disk, plan_path

CELL: Final = 0.1
_SIDE: Final = 6.2
RADIUS: Final = 0.25  # of every robot
_WALL: Final = 0.29  # what the middle of the robot keeps from walls
_ROBOT: Final = 0.6  # what it keeps from the middle of another robot

_AT: Final = np.arange(-_SIDE + CELL / 2, _SIDE, CELL)
_CELLS: Final = np.stack(np.meshgrid(_AT, _AT, indexing="ij"), 2)
_CLEAR: Final = np.minimum(*shape.distances(_CELLS)) - _WALL


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """The way to a pose.

    Attributes:
      points: of the map frame, in metres; the last is the goal.
      heading: that the robot shall have there.
    """

    points: Vector
    heading: float


def plan(start: Any, goal: Any, others: Sequence[Disk] = ()) -> Vector | None:
    """Give the points of a path from one place of the map frame to another; None if there is none."""
    clear = _CLEAR
    for one in others:
        far = np.hypot(_CELLS[:, :, 0] - one.x, _CELLS[:, :, 1] - one.y)
        clear = np.minimum(clear, far - _ROBOT)
    # Near to something it is dearer, so that the path keeps away where there is room.
    costs = np.where(clear > 0, 1 + 3 * np.exp(-np.maximum(clear, 0) / 0.2), np.inf)
    start, goal = np.array(start[:2], np.float64), np.array(goal[:2], np.float64)
    return plan_path.function(costs, start, goal, cell=CELL, left=-_SIDE, lower=-_SIDE)


class PlanPath(hfg.Node):
    """Plan a path to a goal, and plan it anew while the robot and others move.

    Fires once for each pose with the other robots of its time; it is silent without a goal, and while the scan does not
    fit to the pose. A robot that only does not know which of the places that look the same it is at drives on: walls
    are where it believes, and signs tell the place when they come into sight.

    Attributes:
      every: plan with each so many-th pose.
      localised: where the robot is.
      others: other robots, in the map frame.
      path: the way to the goal.
      goal: the pose in the map frame that is to be reached; it is planned with the next pose.
      stop: there is no goal any more.
      no_path: there is no way to the goal now; it is tried again.
    """

    every = hfg.Parameter(5)
    localised = hfg.Input(Localised)
    others = hfg.Input(list[Disk])
    path = hfg.Output(Path)
    no_path = hfg.Event()

    wanted: hfg.State[Any] = hfg.State(None)
    since = hfg.State(0)

    def process(self, localised: Localised, others: list[Disk]) -> Path | None:
        """Plan if it is time to."""
        if self.wanted is None or not localised.fits:
            return None
        self.since += 1
        if self.since % self.every != 1 and self.every > 1:
            return None
        points = plan(localised.pose, self.wanted, others)
        if points is None:
            self.no_path.trigger()
            return None
        return Path(points, float(self.wanted[2]))

    @hfg.slot
    def goal(self, pose: Vector) -> None:
        """Go there."""
        self.wanted, self.since = np.array(pose, np.float64), 0

    @hfg.slot
    def stop(self) -> None:
        """Go nowhere."""
        self.wanted = None


def length_of(points: Any) -> float:
    """Give how long a path is."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum()) if len(points) > 1 else 0.0


def heading_towards(start: Any, goal: Any) -> float:
    """Give the direction from one place to another."""
    return math.atan2(goal[1] - start[1], goal[0] - start[0])
