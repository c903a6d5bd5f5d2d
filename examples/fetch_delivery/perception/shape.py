"""What the rules of the contest say of the arena, in the map frame: a wall of 12 m across, an octagon in its middle."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

WALL_SIDES: Final = 32
WALL_RADIUS: Final = 6.0  # to the corners
WALL_APOTHEM: Final = WALL_RADIUS * math.cos(math.pi / WALL_SIDES)
OCTAGON_APOTHEM: Final = 1.25
TURN: Final = math.pi / 4  # the arena looks the same after this turn
STEP: Final = 2 * math.pi / WALL_SIDES  # and its wall alone after this one


def _polygon(corners: int, radius: float, first: float) -> Any:
    at = first + np.arange(corners + 1) * (2 * math.pi / corners)
    ends = radius * np.stack([np.cos(at), np.sin(at)], 1)
    return np.stack([ends[:-1], ends[1:]], 1)


WALL: Final = _polygon(WALL_SIDES, WALL_RADIUS, 0.0)
OCTAGON: Final = _polygon(8, OCTAGON_APOTHEM / math.cos(math.pi / 8), math.pi / 8)
SEGMENTS: Final = np.concatenate([WALL, OCTAGON])


def distances(places: Any) -> tuple[Any, Any]:
    """Return how far places are inside of the wall, and how far outside of the octagon; negative is beyond."""
    far = np.hypot(places[..., 0], places[..., 1])
    at = np.arctan2(places[..., 1], places[..., 0])
    from_side = np.remainder(at, STEP) - STEP / 2
    from_face = np.remainder(at + TURN / 2, TURN) - TURN / 2
    return WALL_APOTHEM - far * np.cos(from_side), far * np.cos(from_face) - OCTAGON_APOTHEM
