"""What a laser sees: rays into walls and round things, all rays at once.

The wall and the octagon are convex, so a ray is cut by half planes and nothing need be searched.
"""

from __future__ import annotations

import numpy as np

from examples.fetch_delivery.messages import Vector
from examples.fetch_delivery.world.arena import Arena

ANGLES = np.radians(np.linspace(-135.0, 135.0, 271))
ANGLES.setflags(write=False)
MAX_RANGE_M = 30.0


def cast(arena: Arena, x: float, y: float, directions: Vector, discs: Vector) -> Vector:
    """Say how far it is in each direction, without noise.

    Args:
      arena: the walls.
      x: where the laser is; inside of the wall.
      y: the same.
      directions: angles in the arena's frame.
      discs: rows of `(x, y, radius)`: robots and whatever stands about.
    """
    rays = np.stack([np.cos(directions), np.sin(directions)])
    here = np.array([x, y])
    with np.errstate(divide="ignore", invalid="ignore"):
        along = arena.wall.normals @ rays
        away = (arena.wall.offsets - arena.wall.normals @ here)[:, None] / along
        ranges: Vector = np.where(along > 1e-9, away, MAX_RANGE_M).min(axis=0)
        along = arena.octagon.normals @ rays
        away = (arena.octagon.offsets - arena.octagon.normals @ here)[:, None] / along
        enters = np.where(along < 0, away, -np.inf).max(axis=0)
        leaves = np.where(along > 0, away, np.inf).min(axis=0)
    ranges = np.where((enters < leaves) & (enters > 0), np.minimum(ranges, enters), ranges)
    for disc_x, disc_y, radius in discs:
        to = np.array([disc_x - x, disc_y - y])
        ahead = to @ rays
        square = radius * radius - (to @ to - ahead * ahead)
        hit = (square > 0) & (ahead > 0)
        ranges = np.where(hit, np.minimum(ranges, ahead - np.sqrt(np.maximum(square, 0))), ranges)
    return np.clip(ranges, 0.0, MAX_RANGE_M)
