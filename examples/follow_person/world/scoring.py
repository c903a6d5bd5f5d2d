"""The score: what happened, by the truth of the world."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from examples.follow_person.world.course import Course
from examples.follow_person.world.people import RADIUS_M, People

_BETWEEN_M: Final = 0.5  # so near to the line from the robot to the person others are between them


@dataclass
class Crossing:
    """Another person came between robot and person, or very near to the person.

    Attributes:
      begun_s: when.
      ended_s: when that was over; None while it lasts.
    """

    begun_s: float
    ended_s: float | None = None


@dataclass
class Score:
    """How the robot did.

    Attributes:
      walked_m: by the person.
      driven_m: by the robot.
      contacts: how often the robot has touched a trunk, a bush or a person.
      contact_s: how long.
      nearest_m: the least distance between its edge and anything.
      distances: from the person, at each step, once the robot has moved.
      speeds: of the robot.
      crossings: others between robot and person.
    """

    walked_m: float = 0.0
    driven_m: float = 0.0
    contacts: int = 0
    contact_s: float = 0.0
    nearest_m: float = math.inf
    distances: list[float] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)
    crossings: list[Crossing] = field(default_factory=list)
    touching: bool = False
    between: dict[int, Crossing] = field(default_factory=dict)

    def __str__(self) -> str:
        """Say it in a line."""
        far, fast = np.array(self.distances or [0.0]), np.array(self.speeds or [0.0])
        return (
            f"person {self.walked_m:.0f} m, robot {self.driven_m:.0f} m; "
            f"distance {far.min():.1f} to {far.max():.1f} m, {far.mean():.1f} on average; "
            f"speed {fast.mean():.2f} on average, {fast.max():.2f} m/s at most; "
            f"{self.contacts} contacts, {self.contact_s:.1f} s"
        )

    def note(self, now_s: float, dt: float, robot: Any, people: People, course: Course) -> None:
        """Look at the world as it is now."""
        person = people.person
        self.walked_m, self.driven_m = people.walked_m, robot.driven_m
        if robot.driven_m > 0.5 or self.distances:
            self.distances.append(math.dist((robot.x, robot.y), (person.x, person.y)))
            self.speeds.append(robot.speed)
        off = course.trunks[:, :2] - (robot.x, robot.y)
        near = np.flatnonzero((np.abs(off) < 2.0).all(1))
        gaps = [robot.gap(*course.trunks[row, :3].tolist()) for row in near]
        gaps += [robot.gap(one.x, one.y, RADIUS_M) for one in (person, *people.others)]
        gap = min(gaps)
        self.nearest_m = min(self.nearest_m, gap)
        if gap < 0:
            self.contacts += not self.touching
            self.contact_s += dt
        self.touching = gap < 0
        self._cross(now_s, robot, people)

    def _cross(self, now_s: float, robot: Any, people: People) -> None:
        person = people.person
        dx, dy = person.x - robot.x, person.y - robot.y
        far = max(math.hypot(dx, dy), 1e-6)
        for number, one in enumerate(people.others):
            ox, oy = one.x - robot.x, one.y - robot.y
            along, aside = (ox * dx + oy * dy) / far, abs(ox * dy - oy * dx) / far
            is_between = 0 < along < far and aside < _BETWEEN_M
            is_between |= math.dist((one.x, one.y), (person.x, person.y)) < 0.9
            if is_between and number not in self.between:
                self.between[number] = Crossing(now_s)
                self.crossings.append(self.between[number])
            elif not is_between and number in self.between:
                self.between.pop(number).ended_s = now_s
