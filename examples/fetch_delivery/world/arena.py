"""Where the walls, signs and stations are.

A circle of panels, about twelve metres wide, round an octagon with the four filling stations; on the outer wall four
delivery stations, between the filling stations as seen from the middle. Which digit hangs at which is drawn by lot. The
frame has its origin in the middle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from examples.fetch_delivery.messages import Vector
from examples.fetch_delivery.world.surroundings import USUAL

WALL_PANELS = 32
WALL_HEIGHT_M = 0.5
DIGIT_BESIDE = 0.11  # by this angle, seen from the middle, a digit hangs to the left of its bull's-eye


@dataclass(frozen=True)
class Station:
    """A place where cubes change hands.

    Attributes:
      kind: whether cubes come from here or go here.
      number: the digit that hangs here, or which of the filling stations it is, from 0.
      x: where its bull's-eye hangs.
      y: the same.
      facing: the direction into which it looks.
    """

    kind: Literal["filling", "delivery"]
    number: int
    x: float
    y: float
    facing: float

    def distance(self, x: float, y: float) -> float:
        """Say how far it is from here."""
        return math.hypot(x - self.x, y - self.y)


@dataclass(frozen=True)
class Planes:
    """A convex outline as half planes: a point is inside if `normals @ point < offsets` for all of them."""

    normals: Vector
    offsets: Vector

    @cached_property
    def rows(self) -> list[tuple[float, float, float]]:
        """Return them as plain numbers: faster than arrays for one point."""
        return [(float(n[0]), float(n[1]), float(d)) for n, d in zip(self.normals, self.offsets, strict=True)]


def _polygon(angles: NDArray[np.floating[Any]], distance: float) -> Planes:
    return Planes(np.stack([np.cos(angles), np.sin(angles)], axis=1), np.full(len(angles), distance))


class Arena:
    """What stands still.

    Attributes:
      radius: of the outer wall, to its corners.
      apothem: of the outer wall, to the middles of its panels.
      octagon_m: from the middle of the octagon to each side.
      wall: the outer wall; the robots are inside of it.
      octagon: the middle; the robots are outside of it.
      stations: the four filling stations, then the four delivery stations by their digits.
    """

    def __init__(
        self, digits: tuple[int, ...] = (1, 2, 3, 4), *, radius: float = USUAL.radius, octagon: float = USUAL.octagon
    ) -> None:
        """Build it.

        Args:
          digits: those of the delivery stations, counter-clockwise.
          radius: of the outer wall, to its corners.
          octagon: from its middle to each side.

        Raises:
          ValueError: if these are not the digits 1 to 4 in some order.
        """
        if sorted(digits) != [1, 2, 3, 4]:
            raise ValueError(f"delivery stations bear the digits 1 to 4, each once, not {digits}")
        self.radius, self.octagon_m = radius, octagon
        self.apothem = radius * math.cos(math.pi / WALL_PANELS)
        self.wall = _polygon(2 * math.pi * (np.arange(WALL_PANELS) + 0.5) / WALL_PANELS, self.apothem)
        self.octagon = _polygon(math.pi / 4 * np.arange(8), octagon)
        filling = [self._filling(number) for number in range(4)]
        delivery = [self._delivery(place, digit) for place, digit in enumerate(digits)]
        self.stations = (*filling, *sorted(delivery, key=lambda station: station.number))

    def station(self, kind: Literal["filling", "delivery"], number: int) -> Station:
        """Return one of the stations.

        Raises:
          ValueError: if there is none.
        """
        for station in self.stations:
            if (station.kind, station.number) == (kind, number):
                return station
        numbers = "0 to 3" if kind == "filling" else "1 to 4"
        raise ValueError(f"there is no {kind} station {number}; they are {numbers}")

    def nearest(self, x: float, y: float) -> Station:
        """Return the station that is nearest."""
        return min(self.stations, key=lambda station: station.distance(x, y))

    def _filling(self, number: int) -> Station:
        angle = math.pi / 2 * number
        return Station("filling", number, self.octagon_m * math.cos(angle), self.octagon_m * math.sin(angle), angle)

    def _delivery(self, place: int, digit: int) -> Station:
        angle, distance = math.pi / 2 * place + math.pi / 4, self.apothem - 0.05
        return Station("delivery", digit, distance * math.cos(angle), distance * math.sin(angle), angle + math.pi)
