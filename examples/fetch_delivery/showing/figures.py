"""What figures 15 and 16 of the paper show as photographs, here of the simulated arena, for the documentation."""

from __future__ import annotations

import math
from typing import Any, Final

from examples.fetch_delivery.messages import Picture
from examples.fetch_delivery.perception.sighting import find_targets, read_digits
from examples.fetch_delivery.showing import cameras
from examples.fetch_delivery.showing.observing import Seen
from examples.fetch_delivery.showing.ways import ways
from examples.fetch_delivery.world import Simulation

SEED: Final = 1


class Arena:
    """An arena in which no robot has moved yet."""

    def __init__(self) -> None:
        """Build it, with four robots."""
        self._simulation = Simulation(SEED, robots=4)

    def draw(self, *, format: str = "svg") -> str:  # noqa: A002 - as graphs call it
        """Draw it, as SVG."""
        if format != "svg":
            raise ValueError(f'the arena is drawn as "svg", not as {format!r}')
        return ways(self._simulation, [Seen() for _ in range(4)])


def figure_15() -> Arena:
    """Return the arena."""
    return Arena()


def figure_16(digit: int = 1) -> Picture:
    """Look at a delivery station from two and a half metres, and mark what perception finds."""
    simulation = Simulation(SEED)
    station: Any = simulation.arena.station("delivery", digit)
    body, at = simulation.robots[0], math.atan2(station.y, station.x)
    body.x, body.y, body.theta = 3.4 * math.cos(at), 3.4 * math.sin(at), at + 0.15
    picture = simulation.front_picture(0)
    return cameras.ahead(picture, find_targets.function(picture), read_digits.function(picture))
