"""The people at the stations: they put a cube into a robot's basket, or take it out, when its lamp is on.

Within two to ten seconds, by the rules; now and then they are late, put the cube in askew so that its bar code cannot
be read until they set it right, or overlook a lamp until it is switched on again. A robot that brings a cube back to a
filling station gets another one for it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from examples.fetch_delivery.world.arena import Arena, Station
from examples.fetch_delivery.world.rendering import Cube
from examples.fetch_delivery.world.surroundings import USUAL

REACH_M = {"filling": 0.75, "delivery": 0.9}
PROMPT_S = (2.0, 10.0)
LATE_S = (10.0, 16.0)
LATE, ASKEW, OVERLOOKED = 0.06, 0.05, 0.03  # how often


@dataclass(frozen=True)
class Handover:
    """What an operator has just done: given a cube, taken one, both, or set one right that lay askew."""

    station: Station
    given: Cube | None = None
    taken: Cube | None = None
    set_right: bool = False


class Operator:
    """Looks after one robot.

    What it does and when is drawn by lot from its own numbers in the order of the lamps, so it is independent of other
    robots.
    """

    def __init__(self, random: np.random.Generator) -> None:
        """Begin with nothing to do."""
        self._random = random
        self._due_s: float | None = None
        self._askew = False
        self._straight_s = math.inf
        self._given = 0

    @property
    def due_s(self) -> float | None:
        """The time at which a cube changes hands; infinite after it has, None while no robot waits."""
        return self._due_s

    def watch(
        self,
        now_s: float,
        lamp: bool,
        at: tuple[float, float],
        cube: Cube | None,
        arena: Arena,
        unreadable: tuple[int, ...] = (),
        reach: float = USUAL.reach,
    ) -> Handover | None:
        """Look at a robot once more.

        Args:
          now_s: the time.
          lamp: whether its lamp is on.
          at: where it stands.
          cube: what lies in its basket.
          arena: where the stations are.
          unreadable: which of the cubes that it gets, counted from 1, have a smeared bar code.
          reach: how far from a sign the operator reaches.
        """
        if not lamp:
            self._due_s = None
            return None
        station = arena.nearest(*at)
        if station.distance(*at) > min(REACH_M[station.kind], reach):
            return None
        if self._due_s is None:
            self._due_s = now_s + self._delay()
        if station.kind == "filling" and cube is not None and now_s >= self._straight_s:
            self._straight_s = math.inf
            return Handover(station, given=self._lay(cube.number, cube.smeared), set_right=True)
        if now_s < self._due_s:
            return None
        self._due_s = math.inf  # done, until the lamp goes off and on again
        if station.kind == "delivery":
            return Handover(station, taken=cube) if cube is not None else None
        return Handover(station, given=self._give(now_s, unreadable), taken=cube)

    def _give(self, now_s: float, unreadable: tuple[int, ...]) -> Cube:
        self._given += 1
        cube = self._lay(int(self._random.integers(1, 5)), self._given in unreadable)
        askew, right_s = self._random.uniform(0.65, 0.85), self._random.uniform(2.0, 4.0)
        if not self._askew:
            self._straight_s = math.inf
            return cube
        self._straight_s = now_s + float(right_s)
        return replace(cube, yaw=float(askew))

    def _delay(self) -> float:
        kind, delay = self._random.uniform(), self._random.uniform(*PROMPT_S)
        late = self._random.uniform(*LATE_S)
        self._askew = LATE + OVERLOOKED <= kind < LATE + OVERLOOKED + ASKEW
        if kind < OVERLOOKED:
            return math.inf
        return float(late if kind < LATE + OVERLOOKED else delay)

    def _lay(self, number: int, smeared: bool) -> Cube:
        distance, left, yaw = self._random.uniform((0.15, -0.02, -0.35), (0.21, 0.02, 0.35))
        return Cube(number, float(distance), float(left), float(yaw), smeared)
