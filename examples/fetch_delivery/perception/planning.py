"""A path to a place: over a grid of what the walls of the map leave free, around the robots that the laser shows."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from annotated_types import Ge

import hfg
from examples.fetch_delivery.messages import Vector
from examples.fetch_delivery.perception.records import Localised
from examples.fetch_delivery.perception.shape import Shape
from hfg.nodes.robotics import Disk, plan_path

CELL: Final = 0.1
_SIDE: Final = 6.5
RADIUS: Final = 0.25  # of every robot
_WALL: Final = 0.29  # what the middle of the robot keeps from walls
_ROBOT: Final = 0.6  # what it keeps from the middle of another robot
_ASIDE: Final = 0.45  # where beside another one it is dear to drive: so all keep to their right
_SOON: Final = 0.8  # seconds: where another one will be then, it is dear to drive too
_TAKEN: Final = 0.8  # so near to a lane somebody is in it
_QUEUE: Final = (1.2, 1.6)  # so far from a lane that is taken a robot waits

_AT: Final = np.arange(-_SIDE + CELL / 2, _SIDE, CELL)
_CELLS: Final = np.stack(np.meshgrid(_AT, _AT, indexing="ij"), 2)


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """The way to a pose.

    Attributes:
      points: of the map frame, in metres; the last is the goal.
      heading: that the robot should have there.
    """

    points: Vector
    heading: float


def plan(shape: Shape, start: Any, goal: Any, others: Sequence[Disk] = (), *, beside: bool = False) -> Vector | None:
    """Return the points of a path from one place of the map frame to another; None if there is none.

    Args:
      shape: the map.
      start: where the robot is.
      goal: where it should go.
      others: robots, which it keeps away from: more from where they will be soon, and more from their one side than
        from the other, so that two who meet both keep to their right.
      beside: lead to the nearest place that is free if the goal is not.
    """
    start, goal = np.array(start[:2], np.float64), np.array(goal[:2], np.float64)
    clear = _clear(shape, others)
    # Near to something it is dearer, so that the path keeps away where there is room.
    costs = np.where(clear > 0, 1 + 3 * np.exp(-np.maximum(clear, 0) / 0.2), np.inf)
    for one in others:
        way = np.array([one.x, one.y]) - start
        far = math.hypot(way[0], way[1])
        if 0 < far < 3.0:
            left = np.array([-way[1], way[0]]) / far
            costs += 2 * np.exp(-np.maximum(_far(one.x + _ASIDE * left[0], one.y + _ASIDE * left[1]) - 0.4, 0) / 0.2)
        if one.vx or one.vy:
            costs += 4 * np.exp(-np.maximum(_far(one.x + _SOON * one.vx, one.y + _SOON * one.vy) - 0.5, 0) / 0.2)
    if beside:
        goal = _nearest(clear > 0, goal)
    return plan_path.function(costs, start, goal, cell=CELL, left=-_SIDE, lower=-_SIDE)


def queue(shape: Shape, start: Any, goal: Any, others: Sequence[Disk], lane: float) -> tuple[Vector, float] | None:
    """Return the path to where a robot can wait, and its heading there, if its goal is taken.

    A goal before a station is taken while another robot is in the lane that leads on from there to the station, and is
    nearer to its end: of two that come at the same time one goes on. Who waits does it where the other one has room to
    leave, and sees it leave.

    Args:
      shape: the map.
      start: where the robot is.
      goal: the pose to which it should go.
      others: robots.
      lane: how far beyond the goal it is to be free.

    Returns:
      out: None if the goal is free.
    """
    start, first = np.array(start[:2], np.float64), np.array(goal[:2], np.float64)
    last = first + lane * np.array([math.cos(goal[2]), math.sin(goal[2])])
    own = math.dist(start, last)
    if not any(
        _from_lane(np.array([one.x, one.y]), first, last) < _TAKEN and math.dist((one.x, one.y), last) < own
        for one in others
    ):
        return None
    away = _from_lane(start, first, last)
    points = np.stack([start, start])
    if not _QUEUE[0] - 0.1 <= away <= _QUEUE[1] + 0.1:
        off = _from_lane(_CELLS, first, last)
        place = _nearest((_clear(shape, others) > 0.1) & (off >= _QUEUE[0]) & (off <= _QUEUE[1]), start)
        path = plan(shape, start, place, others)
        points = points if path is None else path
    return points, heading_towards(points[-1], last)


def _from_lane(place: Any, first: Any, last: Any) -> Any:
    """Return how far places are from a line between two."""
    along = last - first
    length = max(float(along @ along), 1e-9)
    share = np.clip((place - first) @ along / length, 0, 1)
    off = place - first - share[..., None] * along
    return np.hypot(off[..., 0], off[..., 1])


def _clear(shape: Shape, others: Sequence[Disk]) -> Any:
    clear = _clear_of_walls(shape)
    for one in others:
        clear = np.minimum(clear, _far(one.x, one.y) - _ROBOT)
    return clear


@functools.lru_cache(maxsize=4)
def _clear_of_walls(shape: Shape) -> Any:
    return np.minimum(*shape.distances(_CELLS)) - _WALL


def _far(x: float, y: float) -> Any:
    return np.hypot(_CELLS[:, :, 0] - x, _CELLS[:, :, 1] - y)


def _nearest(free: Any, place: Any) -> Any:
    """Return the middle of the nearest cell that is free; the place itself if it lies in one, or if there is none."""
    row, column = (int(at) for at in np.clip((np.asarray(place) + _SIDE) / CELL, 0, len(_AT) - 1))
    if free[row, column] or not free.any():
        return np.asarray(place)
    return _CELLS.reshape(-1, 2)[int(np.argmin(np.where(free, _far(*place), np.inf)))]


class PlanPath(hfg.Node):
    """Plan a path to a goal, and replan it while the robot and others move.

    Fires once for each pose with the other robots of its time; it is silent without a goal, and while the scan does not
    fit to the pose. A robot that only does not know which of the places that look the same it is at drives on: walls
    are where it believes, and signs tell the place when they come into sight.

    Where a lane leads on from the goal, to a station, the robot waits at a distance while another one is in it.

    Attributes:
      every: plan with each so many-th pose.
      lane: how far beyond the goal it has to be free; with 0 the nearest free place will do for a goal that is not.
      localised: where the robot is.
      others: other robots, in the map frame.
      path: the way to the goal.
      aside: the way to where the robot can wait for the goal, which another one has taken.
      goal: the pose in the map frame that is to be reached; it is planned with the next pose.
      stop: there is no goal any more.
      no_path: there is no way to the goal now; it is tried again.
    """

    every = hfg.Parameter(5)
    lane = hfg.Parameter(0.0, Ge(0), unit="m")
    localised = hfg.Input(Localised)
    others = hfg.Input(list[Disk])
    path = hfg.Output(Path)
    aside = hfg.Event(Path)
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
        waiting = queue(localised.shape, localised.pose, self.wanted, others, self.lane) if self.lane else None
        if waiting is not None:
            self.aside.trigger(Path(*waiting))
            return None
        points = plan(localised.shape, localised.pose, self.wanted, others, beside=not self.lane)
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
    """Return how long a path is."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum()) if len(points) > 1 else 0.0


def heading_towards(start: Any, goal: Any) -> float:
    """Return the direction from one place to another."""
    return math.atan2(goal[1] - start[1], goal[0] - start[0])
