"""Paths: made smooth, and checked for collisions."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval, MinLen, Unit

from hfg.geometry import Grid
from hfg.nodes._extras import require
from hfg.nodes.driving._grids import Obstacles, Poses, need_poses
from hfg.nodes.robotics import Positions
from hfg.nodetypes.functions import node

Polygon = Annotated[list[tuple[float, float]], MinLen(3), Unit("m")]


@node
def smooth_path(
    path: Positions,
    grid: Grid | None = None,
    *,
    weight: Annotated[float, Interval(ge=0, le=1e6), Unit("1")] = 5.0,
    occupied: Annotated[int, Interval(ge=-127, le=127)] = 50,
) -> Positions:
    """Smooth a path: of all paths with its ends, the one that is near to it and has small second differences.

    Fires once per path. It minimises the sum of the squares of how far points have moved, and, by the weight, of
    x[k-1] - 2 x[k] + x[k+1]: a smoothing spline (C. Reinsch, Smoothing by Spline Functions, 1967). Points that would
    come into an obstacle stay where they were.

    Args:
      path: in the order of driving.
      grid: obstacles, in the frame of the path; inflate them by the radius of the robot before. Optional.
      weight: how smooth it becomes; 0 leaves the path as it is. About the fourth power of the number of points over
        which corners are rounded.
      occupied: least value of an obstacle.

    Returns:
      out: as many points as before.

    Raises:
      ValueError: a point is not finite, or the grid has no cells.
    """
    if not (np.isfinite(path).all() and np.abs(path).max(initial=0) < 1e9):
        raise ValueError("a path consists of finite points; take the others out")
    obstacles = None if grid is None else Obstacles(grid, occupied)
    if len(path) < 3 or weight == 0:
        return path.copy()
    held = np.zeros(len(path), bool)
    held[[0, -1]] = True
    while True:
        smooth: Positions = _smoothed(path, weight, held)
        if obstacles is None:
            return smooth
        hits = _blocked(obstacles, smooth) & ~held
        if not hits.any():
            return smooth
        held |= hits


def _smoothed(path: Any, weight: float, held: Any) -> Any:
    """Solve for the free points, of which each depends on two neighbours on each side."""
    count = len(path)
    rows = np.zeros((3, count))  # the diagonals of the matrix from the main one upwards
    rows[0] = 1.0
    for place, factor in ((0, 1.0), (1, -2.0), (2, 1.0)):
        for other, second in ((0, 1.0), (1, -2.0), (2, 1.0)):
            if other >= place:
                rows[other - place, place : place + count - 2] += weight * factor * second
    right = path.astype(np.float64).copy()
    for off in (1, 2):
        near, far = held[:-off], held[off:]
        band = rows[off, : count - off]
        right[:-off][far & ~near] -= (band[:, None] * path[off:])[far & ~near]
        right[off:][near & ~far] -= (band[:, None] * path[:-off])[near & ~far]
        band[near | far] = 0.0
    rows[0, held] = 1.0
    right[held] = path[held]
    return require("scipy.linalg", "robotics").solveh_banded(rows, right, lower=True)


def _blocked(obstacles: Obstacles, points: Any) -> Any:
    places = obstacles.inside(np.concatenate([points, np.zeros((len(points), 1))], 1))
    index = np.floor(places[:, :2] / obstacles.cell).astype(np.int64)
    inside = ((index >= 0) & (index < obstacles.blocked.shape)).all(1)
    index = np.where(inside[:, None], index, 0)
    return inside & obstacles.blocked[index[:, 0], index[:, 1]]


@node(outputs={"free": bool, "way": float})
def check_path(
    path: Poses,
    grid: Grid,
    *,
    footprint: Polygon = [(0.5, 0.25), (-0.2, 0.25), (-0.2, -0.25), (0.5, -0.25)],  # noqa: B006 - it is only read
    margin: Annotated[float, Interval(ge=0, le=10), Unit("m")] = 0.05,
    occupied: Annotated[int, Interval(ge=-127, le=127)] = 50,
) -> tuple[bool, float]:
    """Check a path for collisions: whether the footprint of the robot touches an obstacle at one of its poses.

    Fires once per path and grid. An obstacle is at the middle of its cell; with a margin of 0.71 cells it is as if it
    filled the cell. Nothing outside of the grid counts.

    Args:
      path: poses of the robot, in the frame of the grid, such as those of `plan_maneuver`; not farther apart than a
        collision may be deep.
      grid: obstacles.
      footprint: corners of the robot in its own frame: ahead and to the left; any polygon that does not cross itself.
      margin: how near to it an obstacle is a collision.
      occupied: least value of an obstacle.

    Returns:
      free: nothing is touched.
      way: how far the robot can drive along the path, in metres, before it touches something; the whole length if it is
        free.

    Raises:
      ValueError: the grid has no cells, or a pose or corner is not finite.
    """
    corners = np.array(footprint, np.float64)
    need_poses(path, corners)
    obstacles = Obstacles(grid, occupied)
    ways = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path[:, :2], axis=0).T))]) if len(path) else np.zeros(1)
    poses, middles = obstacles.inside(path), obstacles.middles()
    reach = float(np.hypot(corners[:, 0], corners[:, 1]).max()) + margin
    for number, pose in enumerate(poses):
        off = middles - pose[:2]
        off = off[(np.abs(off) <= reach).all(1)]
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        if len(off) and (_from_polygon(off @ np.array([[cos, -sin], [sin, cos]]), corners) <= margin).any():
            return False, float(ways[max(0, number - 1)])
    return True, float(ways[-1])


def _from_polygon(points: Any, corners: Any) -> Any:
    """Return how far points are from a polygon; 0 inside of it."""
    ends = np.roll(corners, -1, 0)
    along = ends - corners
    square = np.maximum((along * along).sum(1), 1e-18)
    off = points[:, None] - corners
    share = np.clip((off * along).sum(2) / square, 0, 1)
    far = np.hypot(*(off - share[..., None] * along).transpose(2, 0, 1)).min(1)
    # A ray to the right crosses the outline an odd number of times.
    above = corners[:, 1] > points[:, 1:2]
    rises = above != (ends[:, 1] > points[:, 1:2])
    with np.errstate(all="ignore"):
        crossing = corners[:, 0] + (points[:, 1:2] - corners[:, 1]) / along[:, 1] * along[:, 0]
        inside = (rises & (points[:, :1] < crossing)).sum(1) % 2 == 1
    return np.where(inside, 0.0, far)
