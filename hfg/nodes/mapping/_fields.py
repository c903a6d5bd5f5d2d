"""Scans matched against an occupancy grid: a search over all poses near a guess, then a few steps of Gauss and Newton.

Both look at one field: how far each cell is from the nearest obstacle (S. Thrun, W. Burgard, D. Fox, Probabilistic
Robotics, 2005, section 6.4: likelihood fields). The search is that of E. Olson, Real-Time Correlative Scan Matching,
ICRA (2009), on one resolution.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval, Unit

from hfg.geometry import Grid
from hfg.nodes._extras import require
from hfg.nodes.robotics import Covariance, Pose, Positions, ScanMatch
from hfg.nodetypes.functions import node

_MOST_POINTS = 150  # in the search
_MOST_TRIES = 4_000_000
_OUTLIERS = 0.1  # of the points, which lie anywhere


class Field:
    """How far it is to the nearest obstacle, over the cells of a grid; `None` in `far` if there is no obstacle.

    Args:
      occupied: by cell.
      cell: side of a cell, in metres.
      corner: pose of the grid's corner: x, y and heading.
      sigma: standard deviation of a point, in metres.
    """

    def __init__(self, occupied: Any, cell: float, corner: Any, sigma: float) -> None:
        self.cell, self.corner, self.sigma, self.reach = cell, corner, sigma, 4 * sigma + cell
        self.far: Any = None
        if occupied.any():
            far = require("scipy.ndimage", "robotics").distance_transform_edt(~np.pad(occupied, 1)) * cell
            self.far = np.minimum(far, self.reach)
            self.likely = np.log(_OUTLIERS + (1 - _OUTLIERS) * np.exp(-0.5 * (self.far / sigma) ** 2))

    def inside(self, pose: Any) -> Any:
        """Return a pose, given in the frame of the map, in the frame of the grid's corner."""
        cos, sin = math.cos(self.corner[2]), math.sin(self.corner[2])
        off = pose[:2] - self.corner[:2]
        return np.array([cos * off[0] + sin * off[1], cos * off[1] - sin * off[0], pose[2] - self.corner[2]])

    def outside(self, pose: Any) -> Any:
        """Return a pose, given in the frame of the grid's corner, in the frame of the map."""
        cos, sin = math.cos(self.corner[2]), math.sin(self.corner[2])
        x, y = cos * pose[0] - sin * pose[1], sin * pose[0] + cos * pose[1]
        heading = math.remainder(pose[2] + self.corner[2], 2 * math.pi)
        return np.array([x + self.corner[0], y + self.corner[1], heading])

    def searched(self, points: Any, guess: Any, prior: Any, window: float, turn: float) -> Any:
        """Return the best of all poses around a guess, cell by cell; all in the frame of the corner."""
        some = points[:: max(1, math.ceil(len(points) / _MOST_POINTS))]
        farthest = float(np.hypot(some[:, 0], some[:, 1]).max())
        shifts = np.arange(-math.ceil(window / self.cell), math.ceil(window / self.cell) + 1)
        turns = _around(turn, self.cell / max(farthest, self.cell))
        if len(shifts) ** 2 * len(turns) * len(some) > _MOST_TRIES * 10:
            raise ValueError(
                f"a search over {len(shifts)} x {len(shifts)} cells and {len(turns)} headings takes too long; take a "
                "smaller window, or a grid with larger cells"
            )
        across = np.repeat(shifts, len(shifts))
        up = np.tile(shifts, len(shifts))
        best, found = -math.inf, guess
        for off in turns:
            places = _placed(some, guess + np.array([0, 0, off]))[0]
            likely = self._sums(np.floor(places / self.cell).astype(np.int64) + 1, across, up)
            steps = np.stack([across * self.cell, up * self.cell, np.full(len(up), off)], 1)
            total = likely - 0.5 * np.einsum("ij,jk,ik->i", steps, prior, steps)
            at = int(total.argmax())
            if total[at] > best:
                best, found = float(total[at]), guess + steps[at]
        return found

    def _sums(self, cells: Any, across: Any, up: Any) -> Any:
        """Return the log likelihood of all cells together, for each shift."""
        rows, columns = self.far.shape
        flat = self.likely.reshape(-1)
        total = np.zeros(len(across))
        for first in range(0, len(across), 512):
            part = slice(first, first + 512)
            i = np.clip(cells[:, 0] + across[part, None], 0, rows - 1)
            j = np.clip(cells[:, 1] + up[part, None], 0, columns - 1)
            total[part] = flat[i * columns + j].sum(1)
        return total

    def refined(self, points: Any, guess: Any, pose: Any, prior: Any, rounds: int = 10) -> tuple[Any, Any]:
        """Return a pose after steps of Gauss and Newton, and its information; all in the frame of the corner."""
        information = prior
        for _ in range(rounds):
            far, slopes, arms = self.at(points, pose)
            share = (1 - (far / self.reach) ** 2) ** 2 / self.sigma**2  # Tukey's biweight
            turn = slopes[:, 1] * arms[:, 0] - slopes[:, 0] * arms[:, 1]
            jacobian = np.concatenate([slopes, turn[:, None]], 1)
            pulled = jacobian * share[:, None]
            information = pulled.T @ jacobian + prior
            step = np.linalg.solve(information, -(pulled.T @ far) - prior @ (pose - guess))
            pose = pose + step
            if np.abs(step).max() < 1e-4:
                break
        return pose, information

    def at(self, points: Any, pose: Any) -> tuple[Any, Any, Any]:
        """Return the distance of each point, interpolated, how it changes along x and y, and the points turned."""
        places, arms = _placed(points, pose)
        place = places / self.cell + 0.5  # the middle of the first cell inside of the rim is at 1
        rows, columns = self.far.shape
        on = ((place >= 0) & (place < [rows - 1, columns - 1])).all(1)
        low = np.where(on[:, None], np.floor(place), 0).astype(np.int64)
        u, v = np.where(on[:, None], place - low, 0).T
        i, j = low.T
        a, b, c, d = self.far[i, j], self.far[i + 1, j], self.far[i, j + 1], self.far[i + 1, j + 1]
        far = (a * (1 - u) + b * u) * (1 - v) + (c * (1 - u) + d * u) * v
        slopes = np.stack([(b - a) * (1 - v) + (d - c) * v, (c - a) * (1 - u) + (d - b) * u], 1) / self.cell
        return np.where(on, far, self.reach), np.where(on[:, None], slopes, 0.0), arms


def _around(reach: float, step: float) -> Any:
    count = math.ceil(reach / step)
    return np.linspace(-reach, reach, 2 * count + 1)


def _placed(points: Any, pose: Any) -> tuple[Any, Any]:
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    arms = points @ np.array([[cos, sin], [-sin, cos]])
    return arms + pose[:2], arms


def match(field: Field, points: Any, guess: Any, covariance: Any, window: float, turn: float) -> ScanMatch:
    """Lay points onto a field, starting from a guess; see `match_scan_to_grid`."""
    points = points[np.isfinite(points).all(1)]
    if len(points) < 3 or field.far is None:
        return ScanMatch(np.array(guess, np.float64), np.array(covariance, np.float64), 0.0, 0.0)
    # The prior is in the frame of the map, the search in that of the corner.
    cos, sin = math.cos(field.corner[2]), math.sin(field.corner[2])
    back = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    prior = back.T @ np.linalg.inv(covariance) @ back
    start = field.inside(guess)
    pose = field.searched(points, start, prior, window, turn) if window or turn else start
    pose, information = field.refined(points, start, pose, prior)
    far, _, _ = field.at(points, pose)
    on = far < 2 * field.sigma + field.cell / 2
    spread = float(np.sqrt(np.mean(far[on] ** 2))) if on.any() else 0.0
    found = back @ np.linalg.inv(information) @ back.T
    return ScanMatch(field.outside(pose), found, float(on.mean()), spread)


def need_sound(guess: Any, covariance: Any) -> None:
    """Refuse a guess that is not finite, and a covariance that is not positive.

    Raises:
      ValueError: it is.
    """
    sound = np.isfinite(guess).all() and np.isfinite(covariance).all() and np.abs(guess).max() < 1e9
    if not (sound and np.allclose(covariance, covariance.T) and np.linalg.eigvalsh(covariance).min() > 1e-18):
        raise ValueError(
            "a guess is finite, and its covariance symmetric, positive and not singular, got "
            f"{guess.tolist()} and {covariance.tolist()}"
        )


@node
def match_scan_to_grid(
    points: Positions,
    guess: Pose,
    grid: Grid,
    covariance: Covariance | None = None,
    *,
    noise: Annotated[float, Interval(ge=1e-3, le=10), Unit("m")] = 0.05,
    window: Annotated[float, Interval(ge=0, le=10), Unit("m")] = 0.3,
    turn_window: Annotated[float, Interval(ge=0, le=math.pi), Unit("rad")] = 0.2,
    occupied: Annotated[int, Interval(ge=-127, le=127)] = 60,
) -> ScanMatch:
    """Match a scan with an occupancy grid map, starting from a guess: localisation.

    Fires once per scan. A search over all poses near the guess finds the one whose points lie on obstacles; a few steps
    of Gauss and Newton make it finer than a cell. After E. Olson, Real-Time Correlative Scan Matching, ICRA (2009), on
    a likelihood field (S. Thrun et al., Probabilistic Robotics, 2005, section 6.4). The guess counts as much as it is
    sure.

    Args:
      points: in the robot's frame, in metres, such as those of `robotics.scan_points`.
      guess: pose of the robot in the frame of the grid, from odometry.
      grid: the map, as of `MapScans`.
      covariance: of the guess; without this input it is 0.3 m and 0.15 rad.
      noise: standard deviation of a point.
      window: how far from the guess to search, along x and y.
      turn_window: how far from its heading to search.
      occupied: least value of an obstacle in the grid.

    Returns:
      out: the match; its covariance is that of the points and of the guess together. With fewer than three points, or
        a grid without obstacles, it is the guess, with a share of 0.

    Raises:
      ValueError: the grid has no cells, the guess is not finite, its covariance is singular, or the window has too many
        cells.
    """
    if not grid.values.size:
        raise ValueError(
            f'the grid in frame "{grid.frame_id}" at {grid.stamp:.3f} s is empty, {grid.values.shape[0]} x '
            f"{grid.values.shape[1]} cells: there is nothing to match with"
        )
    before = np.diag([0.09, 0.09, 0.0225]) if covariance is None else covariance
    need_sound(guess, before)
    x, y, _ = grid.origin.translation
    field = Field(grid.values >= occupied, grid.cell, np.array([x, y, grid.origin.angles[2]]), noise)
    return match(field, points, guess, before, window, turn_window)
