"""A laser with 16 rings, such as a VLP-16: rays against upright cylinders and a ground with slopes, all at once."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from examples.follow_person.messages import Array, RingScan
from examples.follow_person.world.course import Ground

RINGS: Final[Array] = np.radians(np.arange(-15.0, 16.0, 2.0))
ABOVE_M: Final = 0.8  # above the robot's frame, which is on the ground
MAX_RANGE_M: Final = 30.0
_NEAREST_M: Final = 0.2
_GROUND_STEPS: Final = 26


class Laser:
    """Measures ranges.

    Args:
      columns: number of rays in each ring.
      noise: standard deviation of a range, in metres.
      lost: share of the rays that do not come back.
    """

    def __init__(self, columns: int = 600, noise: float = 0.02, lost: float = 0.01) -> None:
        self.columns, self._noise, self._lost = columns, noise, lost
        self._step = 2 * math.pi / columns
        self._angles = -math.pi + self._step * np.arange(columns)
        level = np.cos(RINGS)[:, None]
        up = np.broadcast_to(np.sin(RINGS)[:, None], (len(RINGS), columns))
        self._rays = np.stack([level * np.cos(self._angles), level * np.sin(self._angles), up], 2)
        self._ways = np.geomspace(1.2, MAX_RANGE_M, _GROUND_STEPS)
        # The ground is smooth, so fewer directions are enough, and the others lie between them.
        directions = max(24, columns // 5)
        self._coarse = -math.pi + 2 * math.pi / directions * np.arange(directions + 1)
        place = np.arange(columns) / columns * directions
        self._left = np.floor(place).astype(np.int64)
        self._share = place - self._left

    def scan(
        self,
        place: tuple[float, float, float],
        turn: Any,
        ground: Ground,
        cylinders: Array,
        stamp: float,
        random: np.random.Generator,
    ) -> RingScan:
        """Measure one turn.

        Args:
          place: x, y and height of the laser.
          turn: rotation of the robot, 3 x 3.
          ground: below.
          cylinders: a row of x, y, radius, lowest and highest height for each.
          stamp: when.
          random: decides the noise.
        """
        rays = self._rays @ turn.T
        level = np.hypot(rays[..., 0], rays[..., 1])
        across = rays[..., :2] / level[..., None]
        rises = rays[..., 2] / level
        far = self._ground(place, turn, ground, rises)
        self._meet(place, turn, cylinders, across, rises, far)
        ranges = far / level
        ranges += random.normal(0, self._noise, ranges.shape)
        ranges[(ranges >= MAX_RANGE_M) | (random.random(ranges.shape) < self._lost)] = np.inf
        return RingScan("laser", stamp, ranges, RINGS, -math.pi, self._step, _NEAREST_M, MAX_RANGE_M)

    def _ground(self, place: Any, turn: Any, ground: Ground, rises: Any) -> Any:
        """Return how far away, in the plane, each ray meets the ground; infinite if it does not."""
        x, y, z = place
        yaw = math.atan2(turn[1, 0], turn[0, 0])
        coarse = self._coarse + yaw
        heights = ground.height(x + self._ways[:, None] * np.cos(coarse), y + self._ways[:, None] * np.sin(coarse))
        heights = heights[:, self._left] * (1 - self._share) + heights[:, self._left + 1] * self._share - z
        # A ray meets the ground before the first place that appears above it.
        highest = np.maximum.accumulate(heights / self._ways[:, None], 0)
        first = (highest < rises[:, None]).sum(1)
        meets = first < len(self._ways)
        first = np.minimum(first, len(self._ways) - 1)
        columns = np.arange(self.columns)
        before = np.maximum(first - 1, 0)
        high = rises * self._ways[before] - heights[before, columns]
        low = rises * self._ways[first] - heights[first, columns]
        share = np.where(first > 0, high / np.where(high == low, 1.0, high - low), 1.0)
        way = self._ways[before] + share * (self._ways[first] - self._ways[before])
        return np.where(meets, way, np.inf)

    def _meet(self, place: Any, turn: Any, cylinders: Array, across: Any, rises: Any, far: Any) -> None:
        """Shorten rays that meet a cylinder before."""
        off = cylinders[:, :2] - place[:2]
        distance = np.hypot(off[:, 0], off[:, 1])
        near = (distance < MAX_RANGE_M) & (distance > cylinders[:, 2] + _NEAREST_M)
        off, distance, radius, low, high = off[near], distance[near], *cylinders[near, 2:].T
        yaw = math.atan2(turn[1, 0], turn[0, 0])
        tilt = math.acos(min(1.0, float(turn[2, 2])))
        half = np.arcsin(radius / distance) + tilt * math.tan(float(RINGS[-1])) + self._step
        middle = np.arctan2(off[:, 1], off[:, 0]) - yaw + math.pi
        first = np.floor((middle - half) / self._step).astype(np.int64)
        count = np.ceil((middle + half) / self._step).astype(np.int64) - first + 1
        which = np.repeat(np.arange(len(first)), count)
        column = (first[which] + np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)) % self.columns
        # For each pair of a cylinder and a column, all rings.
        ux, uy = across[:, column, 0], across[:, column, 1]
        along = ux * off[which, 0] + uy * off[which, 1]
        inside = radius[which] ** 2 - distance[which] ** 2 + along**2
        way = along - np.sqrt(np.maximum(inside, 0))
        height = place[2] + way * rises[:, column]
        hit = (inside > 0) & (way > 0) & (height > low[which]) & (height < high[which])
        ring, pair = np.nonzero(hit)
        np.minimum.at(far, (ring, column[pair]), way[ring, pair])
