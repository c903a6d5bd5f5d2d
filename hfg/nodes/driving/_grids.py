"""Obstacles of a grid, seen from poses that are given in the frame of the grid."""

from __future__ import annotations

import math
from typing import Annotated, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from hfg.geometry import Grid
from hfg.nodes._extras import require
from hfg.types import Named, Shape

Poses: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(None, 3), Named("Poses")]
"""Poses in the plane, one row of x, y in metres and heading in radians for each."""


class Obstacles:
    """The obstacles of a grid; what lies outside of the grid is one, too.

    Args:
      grid: it has cells.
      occupied: least value of an obstacle.

    Raises:
      ValueError: the grid has no cells.
    """

    def __init__(self, grid: Grid, occupied: int) -> None:
        if not grid.values.size:
            raise ValueError(
                f'the grid in frame "{grid.frame_id}" at {grid.stamp:.3f} s is empty, {grid.values.shape[0]} x '
                f"{grid.values.shape[1]} cells: there is nowhere to drive"
            )
        self.cell = grid.cell
        x, y, _ = grid.origin.translation.tolist()
        self.corner = (x, y, float(grid.origin.angles[2]))
        self.blocked = ~(grid.values < occupied)  # NaN too

    def inside(self, poses: Any) -> Any:
        """Return poses in the frame of the corner of the grid."""
        x, y, yaw = self.corner
        cos, sin = math.cos(yaw), math.sin(yaw)
        off = poses[..., :2] - [x, y]
        turned = off @ np.array([[cos, -sin], [sin, cos]])
        return np.concatenate([turned, poses[..., 2:] - yaw], -1)

    def outside(self, poses: Any) -> Any:
        """Return poses of the frame of the corner in that of the grid; headings lie between -pi and pi."""
        x, y, yaw = self.corner
        cos, sin = math.cos(yaw), math.sin(yaw)
        turned = poses[..., :2] @ np.array([[cos, sin], [-sin, cos]]) + [x, y]
        heading = np.remainder(poses[..., 2:] + yaw + math.pi, 2 * math.pi) - math.pi
        return np.concatenate([turned, heading], -1)

    def middles(self) -> Any:
        """Return the middle of each cell with an obstacle, in the frame of the corner."""
        return (np.argwhere(self.blocked) + 0.5) * self.cell

    def distances(self) -> Any:
        """Return how far the middle of each cell is from that of the nearest obstacle, with a rim of obstacles."""
        image = require("scipy.ndimage", "robotics")
        return image.distance_transform_edt(np.pad(~self.blocked, 1)) * self.cell


def need_poses(*poses: Any) -> None:
    """Refuse poses that are not finite.

    Raises:
      ValueError: one is not.
    """
    for one in poses:
        if not (np.isfinite(one).all() and np.abs(one).max(initial=0) < 1e9):
            raise ValueError(f"a pose consists of finite numbers, got {one.tolist() if one.ndim == 1 else 'a path'}")
