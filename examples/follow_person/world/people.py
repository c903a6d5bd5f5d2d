"""People: the one who is followed, and others who stand about, come towards, walk along, and cross.

Others are placed out of the way ahead, do one of these things, and are placed again when they are far away. They walk
neither into trunks nor into other people, and they stop for the robot as people do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from examples.follow_person.messages import Array
from examples.follow_person.world.course import Course

RADIUS_M: Final = 0.22
HEIGHT_M: Final = 1.72
_ACCELERATION: Final = 2.0
_GONE_M: Final = 22.0  # so far away from the person others are placed again
_BESIDE_M: Final = 6.0  # from where those who cross come
_STANDS_S: Final = 3.0  # the person, before it walks

_PARTS: Final = (  # radius, lowest, highest, ahead by stride, to the left
    (0.19, 0.75, 1.45, 0.0, 0.0),
    (0.1, 1.45, HEIGHT_M, 0.0, 0.0),
    (0.08, 0.0, 0.75, 0.28, 0.1),
    (0.08, 0.0, 0.75, -0.28, -0.1),
)

ERRANDS: Final = ("cross", "towards", "along", "stand")


@dataclass
class Walker:
    """A person.

    Attributes:
      x, y: where.
      vx, vy: the velocity.
      heading: into which direction they look.
      phase: of their gait, in radians.
      clothes: colours of shirt and trousers: blue, green, red, 0 to 1.
      errand: what they do.
      at_m: on the way, where that happens.
      aside_m: to the left of the way, where they begin.
      pace: how fast they walk.
      walks: they have begun.
    """

    x: float
    y: float
    heading: float
    clothes: Array
    errand: str = "stand"
    at_m: float = 0.0
    aside_m: float = 0.0
    pace: float = 1.4
    walks: bool = False
    vx: float = 0.0
    vy: float = 0.0
    phase: float = 0.0

    @property
    def speed(self) -> float:
        """How fast they are."""
        return math.hypot(self.vx, self.vy)

    def turn_to(self, vx: float, vy: float, dt: float) -> None:
        """Change the velocity as people can, and walk."""
        dx, dy = vx - self.vx, vy - self.vy
        share = min(1.0, _ACCELERATION * dt / max(math.hypot(dx, dy), 1e-9))
        self.vx, self.vy = self.vx + share * dx, self.vy + share * dy
        self.x, self.y = self.x + self.vx * dt, self.y + self.vy * dt
        if self.speed > 0.2:
            self.heading = math.atan2(self.vy, self.vx)
        self.phase += self.speed * dt * math.pi / 0.75


class People:
    """All people.

    Attributes:
      person: the one who is followed.
      others: the others.
      walked_m: how far the person has walked.
    """

    def __init__(self, course: Course, others: int, pace: float, random: np.random.Generator) -> None:
        self._course, self._random, self._pace = course, random, pace
        self.walked_m, self._now_s, self._speed = 0.0, 0.0, 0.0
        x, y = course.way.at(0.0)
        self.person = Walker(float(x), float(y), course.way.heading(0.0), _clothes(random))
        self._placed_m = 6.0
        self.others = [self._placed() for _ in range(others)]

    def step(self, dt: float, robot: Any) -> None:
        """Let time pass; `robot` is the vehicle."""
        self._now_s += dt
        self._walk(dt)
        for number, one in enumerate(self.others):
            if math.dist((one.x, one.y), (self.person.x, self.person.y)) > _GONE_M and self._behind(one):
                self.others[number] = self._placed()
        for one in self.others:
            vx, vy = self._wish(one)
            if not one.speed and vx == vy == 0 and math.dist((one.x, one.y), (robot.x, robot.y)) > 4:
                continue
            one.turn_to(*self._kept_clear(one, vx, vy, robot), dt)

    def cylinders(self) -> Array:
        """Return their bodies: a row of x, y, radius, lowest and highest height for each part."""
        rows = []
        for one in (self.person, *self.others):
            z = float(self._course.ground.height(one.x, one.y))
            cos, sin = math.cos(one.heading), math.sin(one.heading)
            swing = math.sin(one.phase) * min(1.0, one.speed)
            for radius, low, high, ahead, left in _PARTS:
                far = ahead * swing
                rows.append((one.x + cos * far - sin * left, one.y + sin * far + cos * left, radius, z + low, z + high))
        return np.array(rows)

    # --- the person

    def _walk(self, dt: float) -> None:
        """Let the person walk on along the way: faster and slower, with a stop each minute."""
        t = self._now_s - _STANDS_S
        wanted = 0.0
        if t > 0:
            wanted = self._pace + 0.55 * math.sin(t / 9)
            if (t % 60) > 56:
                wanted = 0.0
        most = 1.5 * dt
        self._speed += max(-most, min(most, wanted - self._speed))
        self.walked_m += self._speed * dt
        one, (x, y) = self.person, self._course.way.at(self.walked_m)
        one.vx, one.vy = (float(x) - one.x) / dt, (float(y) - one.y) / dt
        one.x, one.y = float(x), float(y)
        one.heading = self._course.way.heading(self.walked_m)
        one.phase += self._speed * dt * math.pi / 0.75

    # --- the others

    def _behind(self, one: Walker) -> bool:
        return one.at_m < self.walked_m or one.errand in ("towards", "along")

    def _placed(self) -> Walker:
        """Place a person ahead."""
        random, way = self._random, self._course.way
        self._placed_m = max(self._placed_m, self.walked_m + 14.0) + float(random.uniform(6.0, 16.0))
        errand = str(random.choice(ERRANDS, p=(0.55, 0.15, 0.15, 0.15)))
        at_m, side = self._placed_m, float(random.choice((-1.0, 1.0)))
        aside = side * {"cross": _BESIDE_M, "towards": 1.3, "along": 1.6, "stand": 2.2}[errand]
        begin_m = at_m + (8.0 if errand == "towards" else 0.0)
        x, y = self._beside(begin_m, aside)
        pace = float(random.uniform(1.1, 1.8))
        heading = way.heading(begin_m) + math.pi
        return Walker(x, y, heading, _clothes(random), errand, at_m, aside, pace)

    def _beside(self, metres: float, aside: float) -> tuple[float, float]:
        """Return a place at the side of the way, moved to where no trunk is."""
        x, y = self._course.way.at(metres)
        turn = self._course.way.heading(metres)
        place = np.array([x - math.sin(turn) * aside, y + math.cos(turn) * aside])
        trunks = self._course.trunks
        for _ in range(20):
            off = place - trunks[:, :2]
            gap = np.hypot(off[:, 0], off[:, 1]) - trunks[:, 2]
            nearest = int(gap.argmin()) if len(gap) else -1
            if nearest < 0 or gap[nearest] > 0.4:
                break
            place = place + off[nearest] / max(float(np.hypot(*off[nearest])), 1e-6) * (0.45 - gap[nearest])
        return float(place[0]), float(place[1])

    def _wish(self, one: Walker) -> tuple[float, float]:
        """Return the velocity that a person wants."""
        ahead = one.at_m - self.walked_m
        if one.errand == "stand":
            return 0.0, 0.0
        if not one.walks and ahead > 25:
            return 0.0, 0.0
        if one.errand == "cross":
            # So that the way is crossed a little after the person.
            lead = _BESIDE_M / one.pace * max(self._speed, 0.3)
            one.walks = one.walks or ahead + 2.0 < lead
            goal = self._beside_quickly(one.at_m, -2 * one.aside_m)
        elif one.errand == "towards":
            one.walks = one.walks or ahead < 8.0
            along = self._along(one)
            goal = self._beside_quickly(along - 2.0, one.aside_m)
        else:
            one.walks = one.walks or ahead < 1.0
            goal = self._beside_quickly(self._along(one) + 2.0, one.aside_m)
        if not one.walks:
            return 0.0, 0.0
        dx, dy = goal[0] - one.x, goal[1] - one.y
        far = math.hypot(dx, dy)
        if far < 0.3:
            return 0.0, 0.0
        pace = max(0.8, min(self._speed, 2.0)) if one.errand == "along" and ahead > -25 else one.pace
        return pace * dx / far, pace * dy / far

    def _beside_quickly(self, metres: float, aside: float) -> tuple[float, float]:
        x, y = self._course.way.at(metres)
        turn = self._course.way.heading(metres)
        return float(x - math.sin(turn) * aside), float(y + math.cos(turn) * aside)

    def _along(self, one: Walker) -> float:
        """Return how far along the way one of the others is, near the person."""
        metres = self.walked_m + np.arange(-30.0, 30.0, 1.0)
        way = self._course.way
        index = ((metres % way.lap) / way.lap * (len(way.points) - 1)).astype(int)
        off = way.points[index] - (one.x, one.y)
        return float(metres[int((off * off).sum(1).argmin())])

    def _kept_clear(self, one: Walker, vx: float, vy: float, robot: Any) -> tuple[float, float]:
        """Change a wish so that nothing is walked into."""
        fast = math.hypot(vx, vy)
        for x, y, radius, reach in self._near(one):
            dx, dy = one.x - x, one.y - y
            far = max(math.hypot(dx, dy), 1e-6)
            gap = far - radius - RADIUS_M
            if gap < reach:
                push = 1.6 * (1 - max(gap, 0.0) / reach) ** 2 * max(fast, 0.5 if gap < 0.15 else 0.0)
                # Go round it, to the side that is nearer to where the way leads.
                side = 1.0 if dx * vy - dy * vx > 0 else -1.0
                vx += push * (dx - 0.8 * side * dy) / far
                vy += push * (dy + 0.8 * side * dx) / far
        dx, dy = robot.x - one.x, robot.y - one.y
        far = math.hypot(dx, dy)
        gap = robot.gap(one.x, one.y, RADIUS_M)
        if gap < 1.2 and far > 1e-6:
            towards = (vx * dx + vy * dy) / far
            if towards > 0:  # do not walk into it
                stop = min(1.0, max(0.0, 1.2 - gap) / 0.6)
                vx, vy = vx - stop * towards * dx / far, vy - stop * towards * dy / far
            if gap < 0.35:  # step back
                vx, vy = vx - 0.8 * dx / far, vy - 0.8 * dy / far
        now = math.hypot(vx, vy)
        most = max(fast, 0.8)
        return (vx, vy) if now <= most else (vx * most / now, vy * most / now)

    def _near(self, one: Walker) -> list[tuple[float, float, float, float]]:
        trunks = self._course.trunks
        off = trunks[:, :2] - (one.x, one.y)
        near = np.flatnonzero((np.abs(off[:, 0]) < 1.6) & (np.abs(off[:, 1]) < 1.6))
        found = [(float(x), float(y), float(r), 0.6) for x, y, r, _ in trunks[near]]
        others = (other for other in (self.person, *self.others) if other is not one)
        return found + [(other.x, other.y, RADIUS_M, 0.6) for other in others]


def _clothes(random: np.random.Generator) -> Array:
    """Draw the colours of shirt and trousers."""
    shirt = _coloured(float(random.uniform(0, 1)), float(random.uniform(0.5, 0.9)), float(random.uniform(0.45, 0.9)))
    trousers = _coloured(float(random.uniform(0, 1)), float(random.uniform(0.1, 0.5)), float(random.uniform(0.15, 0.5)))
    return np.array([shirt, trousers])


def _coloured(hue: float, saturation: float, value: float) -> tuple[float, float, float]:
    import colorsys

    red, green, blue = colorsys.hsv_to_rgb(hue, saturation, value)
    return blue, green, red
