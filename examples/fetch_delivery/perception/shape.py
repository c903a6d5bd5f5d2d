"""The map: a round wall of panels with an octagon in its middle, as large as the robot has measured.

The rules of the contest say how the arena looks, and nothing more: its size is unknown before. The
map frame has its origin in the middle, and its x axis through the middle of a side of the octagon.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np

WALL_SIDES: Final = 32
TURN: Final = math.pi / 4  # the arena looks the same after this turn
STEP: Final = 2 * math.pi / WALL_SIDES  # and its wall, without the octagon, after this one
FLAT: Final = math.cos(STEP / 2)  # the middle of a panel is nearer than its ends by this factor


@dataclass(frozen=True)
class Shape:
    """How large the arena is.

    Attributes:
      radius: of the wall, to its corners, in metres.
      octagon: from its middle to each side.
    """

    radius: float
    octagon: float

    @property
    def apothem(self) -> float:
        """How far it is from the middle to the panels of the wall."""
        return self.radius * FLAT

    @cached_property
    def segments(self) -> Any:
        """The walls, each by its two ends."""
        octagon = _polygon(8, self.octagon / math.cos(TURN / 2), TURN / 2)
        return np.concatenate([_polygon(WALL_SIDES, self.radius, 0.0), octagon])

    def distances(self, places: Any) -> tuple[Any, Any]:
        """Return how far places are inside of the wall, and how far outside of the octagon; negative is beyond."""
        far = np.hypot(places[..., 0], places[..., 1])
        at = np.arctan2(places[..., 1], places[..., 0])
        return self.apothem - far * np.cos(from_panel(at)), far * np.cos(from_side(at)) - self.octagon

    def side(self, number: int) -> tuple[float, float, float]:
        """Return the middle of a side of the octagon, and the direction in which it looks."""
        at = math.remainder(number * TURN, 2 * math.pi)
        return self.octagon * math.cos(at), self.octagon * math.sin(at), at

    def on_wall(self, at: float) -> tuple[float, float, float]:
        """Return the place on the wall in a direction from the middle, and the direction in which it looks."""
        facing = math.remainder(at + math.pi, 2 * math.pi)
        return self.apothem * math.cos(at), self.apothem * math.sin(at), facing


def from_panel(at: Any) -> Any:
    """Return how far directions from the middle are from that to the nearest middle of a panel."""
    return np.remainder(at, STEP) - STEP / 2


def from_side(at: Any) -> Any:
    """Return how far directions from the middle are from that to the nearest middle of a side of the octagon."""
    return np.remainder(at + TURN / 2, TURN) - TURN / 2


def _polygon(corners: int, radius: float, first: float) -> Any:
    at = first + np.arange(corners + 1) * (2 * math.pi / corners)
    ends = radius * np.stack([np.cos(at), np.sin(at)], 1)
    return np.stack([ends[:-1], ends[1:]], 1)
