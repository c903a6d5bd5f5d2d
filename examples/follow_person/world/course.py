"""Where everything happens: a ground with slopes, trees and bushes on it, and a closed way between them."""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np

from examples.follow_person.messages import Array

_POINTS: Final = 4001  # of the way
_TREE_HEIGHT: Final = 6.0
_MOST_TRIES: Final = 200_000


class Ground:
    """A surface of three waves.

    Args:
      steepness: steepest slope, height for each metre of way; 0 is flat.
      random: decides where the hills are.
    """

    def __init__(self, steepness: float, random: np.random.Generator) -> None:
        lengths = np.array([61.0, 38.0, 23.0])
        turns = random.uniform(0, 2 * math.pi, 3)
        self._waves = np.stack([np.cos(turns), np.sin(turns)]) * 2 * math.pi / lengths
        self._phases = random.uniform(0, 2 * math.pi, 3)
        self._heights = steepness / 3 * lengths / (2 * math.pi)

    def height(self, x: Any, y: Any) -> Any:
        """Return how high the ground is."""
        total: Any = 0.0
        for (kx, ky), phase, height in zip(self._waves.T, self._phases, self._heights, strict=True):
            total = total + height * np.sin(kx * x + ky * y + phase)
        return total

    def slope(self, x: float, y: float) -> tuple[float, float]:
        """Return how much it rises along x and along y, for each metre."""
        at = self._heights * np.cos(self._waves[0] * x + self._waves[1] * y + self._phases)
        return float(self._waves[0] @ at), float(self._waves[1] @ at)


class Way:
    """A closed curve, by its length."""

    def __init__(self) -> None:
        turn = np.linspace(0, 2 * math.pi, _POINTS)
        radius = 60 + 8 * np.sin(3 * turn) + 4 * np.cos(7 * turn)
        self.points: Array = np.stack([radius * np.cos(turn), radius * np.sin(turn)], 1)
        self._along = np.r_[0, np.cumsum(np.hypot(*np.diff(self.points, axis=0).T))]
        self.lap = float(self._along[-1])

    def at(self, metres: float) -> Array:
        """Return the place at this length."""
        along = metres % self.lap
        return np.array([np.interp(along, self._along, axis) for axis in self.points.T])

    def heading(self, metres: float) -> float:
        """Return the direction there."""
        dx, dy = self.at(metres + 0.2) - self.at(metres - 0.2)
        return math.atan2(dy, dx)


class Kind(NamedTuple):
    """How much stands about.

    Attributes:
      trees: their number.
      bushes: their number.
      clearance: from the middle of the way to the middle of a tree, at least.
      spread: standard deviation of how far trees are from the way.
    """

    trees: int
    bushes: int
    clearance: float
    spread: float


KINDS: Final = {
    "open": Kind(160, 20, 1.1, 6.0),
    "dense": Kind(600, 20, 0.75, 2.5),
}


class Course:
    """Ground, way, trees and bushes.

    Attributes:
      ground: the surface.
      way: the way that the person takes.
      trunks: a row of x, y, radius, height for each tree and each bush.
    """

    def __init__(self, kind: Kind, steepness: float, random: np.random.Generator) -> None:
        self.ground = Ground(steepness, random)
        self.way = Way()
        rows: list[tuple[float, float, float, float]] = []
        for count, radii, low, high in (
            (kind.trees, (0.1, 0.3), _TREE_HEIGHT, _TREE_HEIGHT),
            (kind.bushes, (0.3, 0.6), 0.9, 1.4),
        ):
            rows += self._planted(count, radii, (low, high), kind, random)
        self.trunks: Array = np.array(rows).reshape(-1, 4)

    def _planted(
        self, count: int, radii: tuple[float, float], heights: tuple[float, float], kind: Kind, random: Any
    ) -> list[tuple[float, float, float, float]]:
        rows: list[tuple[float, float, float, float]] = []
        for _ in range(_MOST_TRIES):
            if len(rows) == count:
                break
            x, y = self.way.at(random.uniform(0, self.way.lap)) + random.normal(0, kind.spread, 2)
            radius = random.uniform(*radii)
            far = float(np.hypot(*(self.way.points[::5] - (x, y)).T).min())
            # A bush is thicker: its edge is as far away as that of the thickest tree.
            if kind.clearance + max(0.0, radius - radii[0] - 0.2) < far < 3 * kind.spread:
                rows.append((float(x), float(y), float(radius), float(random.uniform(*heights))))
        return rows
