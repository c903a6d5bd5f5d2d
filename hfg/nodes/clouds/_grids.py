"""Grids of obstacles, and what it costs to cross them."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from annotated_types import Interval, Unit

from hfg.geometry import Grid, PointCloud, Transform
from hfg.nodes._extras import require
from hfg.nodes.robotics import Costs
from hfg.nodetypes.functions import node

_MOST_CELLS = 25_000_000


@node
def obstacle_grid(
    cloud: PointCloud,
    *,
    cell: Annotated[float, Interval(ge=1e-3, le=100), Unit("m")] = 0.1,
    size: Annotated[float, Interval(gt=0, le=10_000), Unit("m")] = 20.0,
    least: Annotated[int, Interval(ge=1)] = 1,
) -> Grid:
    """Make an occupancy grid of the obstacles around a robot, without heights.

    Fires once per cloud.

    Args:
      cloud: obstacles, without the ground, in the frame of the robot or of the map.
      cell: side of a cell.
      size: side of the grid, which has the origin of the frame in its middle.
      least: smallest number of points that make a cell an obstacle.

    Returns:
      out: 100 in a cell with an obstacle, else 0; points outside of the grid do not count.

    Raises:
      ValueError: coordinates are not finite, or there would be more than 25 million cells.
    """
    cloud.need_finite()
    side = max(1, math.ceil(size / cell - 1e-9))
    if side * side > _MOST_CELLS:
        raise ValueError(
            f"a grid has at most 25 million cells, got {side} x {side}; take larger cells, or a smaller size"
        )
    corner = -side * cell / 2
    with np.errstate(over="ignore"):
        index = np.floor((cloud.points[:, :2] - corner) / cell)
    inside = ((index >= 0) & (index < side)).all(1)
    flat = index[inside].astype(np.int64) @ np.array([side, 1])
    count = np.bincount(flat, minlength=side * side).reshape(side, side)
    values = np.where(count >= least, 100, 0).astype(np.int8)
    return Grid(cloud.frame_id, cloud.stamp, Transform.of(x=corner, y=corner), cell, values)


@node
def grid_costs(
    grid: Grid,
    *,
    radius: Annotated[float, Interval(ge=0), Unit("m")] = 0.3,
    margin: Annotated[float, Interval(gt=0), Unit("m")] = 0.5,
    weight: Annotated[float, Interval(ge=0), Unit("1")] = 5.0,
    occupied: Annotated[int, Interval(ge=-127, le=127)] = 50,
) -> Costs:
    """Inflate the obstacles of a grid by the radius of a robot, and make it dear to pass them closely: a costmap.

    Fires once per grid. The result is for `robotics.plan_path`, with `left` and `lower` of the grid's origin.

    Args:
      grid: of obstacles.
      radius: of the robot; cells less than this away from an obstacle are blocked.
      margin: how far beyond the radius it is dearer.
      weight: what it costs more directly at the radius; it falls off linearly.
      occupied: least value of an obstacle.

    Returns:
      out: 1 in free cells, more near obstacles, infinite where the robot cannot be.

    Raises:
      ValueError: the grid has no cells.
    """
    if not grid.values.size:
        raise ValueError(
            f'the grid in frame "{grid.frame_id}" at {grid.stamp:.3f} s is empty, {grid.values.shape[0]} x '
            f"{grid.values.shape[1]} cells: there is nothing to plan on"
        )
    blocked = ~(grid.values < occupied)  # NaN too
    if not blocked.any():
        return np.ones(grid.values.shape)
    image = require("scipy.ndimage", "robotics")
    far = image.distance_transform_edt(~blocked) * grid.cell
    near = np.clip(1 - (far - radius) / margin, 0, 1)
    return np.where(blocked | (far < radius), np.inf, 1 + weight * near)
