"""Things that stand: places that were hit again and again, where no one walks.

A person who passes a trunk would be one cluster with it. So points of what stands are taken out first.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from annotated_types import Interval

import hfg
from examples.follow_person.messages import Array
from examples.follow_person.perception.records import Person, planar
from hfg.geometry import PointCloud, PoseInFrame
from hfg.nodes.estimation import Track

_CELL: Final = 0.1
_SIDE: Final = 400  # cells; the grid goes round, so what is farther away than half of it must be forgotten
_KEPT: Final = 0.98  # of what a cell has counted, from scan to scan
_MOST: Final = 26.0
_STANDS: Final = 16.0  # so often hit
_GROWS: Final = 3.0  # weight of a hit next to something that stands
_BINS: Final = 360  # directions in which it is looked how far one can see
_AROUND: Final = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])


class Standing:
    """Counts how often places were hit; the plain part of `SplitStanding`."""

    def __init__(self) -> None:
        self._count: Array = np.zeros((_SIDE, _SIDE), np.float64)

    def split(self, points: Any, pose: Any, movers: Any, near: float) -> Any:
        """Take in the points of a scan, and say which of them belong to what stands.

        Args:
          points: n x 2.
          pose: x, y and heading of the robot, in the same frame.
          movers: places of those who move, or have moved, m x 2: nothing is learned there.
          near: how far around them.
        """
        self._forget(points, pose)
        cells = np.floor(points / _CELL).astype(np.int64)
        around = (cells[:, None] + _AROUND) % _SIDE @ (_SIDE, 1)
        count = self._count.reshape(-1)
        stands = count[around].max(1, initial=0.0) >= _STANDS
        learns = np.ones(len(points), bool)
        if len(movers):
            off = points[:, None] - movers
            learns = (off * off).sum(2).min(1) > near * near
        hit, first = np.unique(cells[learns] % _SIDE @ (_SIDE, 1), return_index=True)
        counts = np.where(stands[learns][first], _GROWS, 1.0)
        count[hit] = np.minimum(count[hit] + counts, _MOST)
        return stands

    def _forget(self, points: Any, pose: Any) -> None:
        """Forget slowly what is not seen, and quickly what can be seen through."""
        self._count *= _KEPT
        standing = np.argwhere(self._count >= _STANDS / 2)
        if not len(standing):
            return
        middle = np.floor(pose[:2] / _CELL)
        cells = middle + (standing - middle + _SIDE / 2) % _SIDE - _SIDE / 2
        bin_, far = _polar((cells + 0.5) * _CELL, pose)
        nearest = np.full(_BINS, np.inf)
        point_bin, point_far = _polar(points, pose)
        np.minimum.at(nearest, point_bin, point_far)
        nearest = np.minimum(nearest, np.minimum(np.roll(nearest, 1), np.roll(nearest, -1)))
        through = far < nearest[bin_] - 0.4
        self._count[standing[through, 0], standing[through, 1]] *= 0.6
        gone = far > _SIDE * _CELL / 2 - 2
        self._count[standing[gone, 0], standing[gone, 1]] = 0


def _polar(points: Any, pose: Any) -> tuple[Any, Any]:
    off = points - pose[:2]
    angle = np.arctan2(off[:, 1], off[:, 0])
    return np.floor((angle + math.pi) / (2 * math.pi) * _BINS).astype(np.int64) % _BINS, np.hypot(off[:, 0], off[:, 1])


class SplitStanding(hfg.Node):
    """Split obstacles into points of what stands and points of what may move.

    Attributes:
      near: so far around those who move nothing counts as standing, even if they stop.
      obstacles: points without the ground, in the robot's frame.
      pose: of the robot.
      tracks: those of the scan before.
      person: who is followed.
      standing: points of what stands, in the frame of the pose, without heights.
      others: all other points, with their height in the field "height".
    """

    near = hfg.Parameter(0.6, Interval(ge=0, le=5), unit="m")
    obstacles = hfg.Input(PointCloud)
    pose = hfg.Input(PoseInFrame)
    tracks = hfg.Input(list[Track])
    standing = hfg.Output(PointCloud)
    others = hfg.Output(PointCloud)

    known: hfg.State[Standing] = hfg.State(factory=Standing)
    followed: hfg.State[Person | None] = hfg.State(None)

    def process(self, obstacles: PointCloud, pose: PoseInFrame, tracks: list[Track]) -> None:
        """Split them."""
        at = planar(pose.pose)
        cos, sin = math.cos(at[2]), math.sin(at[2])
        points = obstacles.points[:, :2] @ np.array([[cos, sin], [-sin, cos]]) + at[:2]
        movers = [(one.x, one.y) for one in tracks if one.moves]
        if self.followed is not None:
            movers.append(self.followed.at(obstacles.stamp))
        stands = self.known.split(points, at, np.array(movers).reshape(-1, 2), self.near)
        cloud = PointCloud(pose.frame_id, obstacles.stamp, points, {"height": obstacles.points[:, 2]})
        self.standing.send(cloud.select(stands))
        self.others.send(cloud.select(~stands))

    @hfg.slot
    def person(self, person: Person) -> None:
        """Do not take the person for something that stands."""
        self.followed = person
