"""The arena from above, as one picture of a video: where robots are, where they believe to be, what they know and want.

What a robot believes is laid into the arena by turning its map, which a robot may have turned by any eighth: the rules
do not say which side of the octagon is the first.
"""

from __future__ import annotations

import math
from typing import Any, Final

import cv2
import numpy as np

from examples.fetch_delivery.messages import Picture, Vector
from examples.fetch_delivery.showing import cameras
from examples.fetch_delivery.showing.observing import Seen
from examples.fetch_delivery.world import Arena, Simulation, Station
from examples.fetch_delivery.world.arena import DIGIT_BESIDE, WALL_PANELS
from examples.fetch_delivery.world.robots import RADIUS_M
from examples.fetch_delivery.world.robots import Robot as Body

SIDE: Final = 600  # pixels of the arena
_CAMERA: Final = 400  # pixels for a camera of one robot, of those of several half as many
SIZE: Final = (SIDE + _CAMERA, SIDE)
_PER_M: Final = SIDE / 12.7
_SHIFT: Final = 4  # bits behind the point of a pixel, so that slow things do not jump
_FONT: Final = cv2.FONT_HERSHEY_SIMPLEX

Colour = tuple[int, int, int]
COLOURS: Final[tuple[Colour, ...]] = ((176, 98, 31), (38, 112, 217), (90, 140, 30), (150, 60, 150))  # blue, green, red
_PAPER, _FLOOR, _WALL, _INK, _SOFT = (250, 248, 246), (236, 232, 228), (150, 140, 130), (50, 44, 38), (150, 142, 134)
_LAMP: Final = (70, 210, 90)


def _pixels(points: Any) -> Any:
    """Return points of the arena as OpenCV takes them; y leads upwards."""
    points = np.atleast_2d(np.asarray(points, np.float64))
    middle = SIDE / 2
    at = np.stack([middle + points[:, 0] * _PER_M, middle - points[:, 1] * _PER_M], axis=1)
    return np.rint(at * (1 << _SHIFT)).astype(np.int32)


def _line(picture: Picture, points: Any, colour: Colour, width: int = 1, *, closed: bool = False) -> None:
    cv2.polylines(picture, [_pixels(points)], closed, colour, width, cv2.LINE_AA, _SHIFT)


def _disc(picture: Picture, place: Any, radius_m: float, colour: Colour, width: int = -1) -> None:
    ((x, y),) = _pixels(place).tolist()
    cv2.circle(picture, (x, y), round(radius_m * _PER_M * (1 << _SHIFT)), colour, width, cv2.LINE_AA, _SHIFT)


def _text(picture: Picture, text: str, at: tuple[int, int], colour: Colour = _INK, size: float = 0.45) -> None:
    cv2.putText(picture, text, at, _FONT, size, colour, 1, cv2.LINE_AA)


def _middle_text(picture: Picture, text: str, place: Any, colour: Colour, size: float) -> None:
    (width, height), _ = cv2.getTextSize(text, _FONT, size, 1)
    ((x, y),) = (_pixels(place) >> _SHIFT).tolist()
    _text(picture, text, (x - width // 2, y + height // 2), colour, size)


def digit_place(station: Station) -> tuple[float, float]:
    """Return where the digit of a delivery station hangs."""
    at, far = math.atan2(station.y, station.x) + DIGIT_BESIDE, math.hypot(station.x, station.y)
    return far * math.cos(at), far * math.sin(at)


def corners(arena: Arena) -> tuple[Vector, Vector]:
    """Return the corners of the wall and of the octagon."""
    wall = 2 * math.pi * np.arange(WALL_PANELS) / WALL_PANELS
    octagon = math.pi / 4 * (np.arange(8) + 0.5)
    radius = arena.radius, arena.octagon_m / math.cos(math.pi / 8)
    return tuple(  # type: ignore[return-value]
        far * np.stack([np.cos(at), np.sin(at)], axis=1) for far, at in zip(radius, (wall, octagon), strict=True)
    )


class TopView:
    """Draws one run."""

    def __init__(self, simulation: Simulation, seed: int) -> None:
        """Draw what stands still, once."""
        self._simulation = simulation
        self._seed = seed
        self._ground = np.full((SIZE[1], SIZE[0], 3), _PAPER, np.uint8)
        self._drawn = [0] * len(simulation.robots)  # so many points of each way are on the ground already
        wall, octagon = corners(simulation.arena)
        cv2.fillPoly(self._ground, [_pixels(wall)], _FLOOR, cv2.LINE_AA, _SHIFT)
        _line(self._ground, wall, _WALL, 3, closed=True)
        cv2.fillPoly(self._ground, [_pixels(octagon)], _PAPER, cv2.LINE_AA, _SHIFT)
        _line(self._ground, octagon, _WALL, 2, closed=True)
        for station in simulation.arena.stations:
            self._station(station)

    def draw(self, robots: list[Seen]) -> Picture:
        """Draw this moment."""
        self._ways(robots)
        picture = self._ground.copy()
        for number, seen in enumerate(robots):
            self._belief(picture, number, seen)
        for number, body in enumerate(self._simulation.robots):
            self._robot(picture, number, body, robots[number])
        self._corner_texts(picture, robots)
        self._pictures(picture, robots)
        return picture

    # --- what stays ---

    def _station(self, station: Station) -> None:
        place = (station.x - 0.02 * math.cos(station.facing), station.y - 0.02 * math.sin(station.facing))
        for radius, colour in ((0.14, _INK), (0.09, _PAPER), (0.045, _INK)):
            _disc(self._ground, place, radius, colour)
        if station.kind == "delivery":
            x, y = digit_place(station)
            _middle_text(self._ground, str(station.number), (x * 0.965, y * 0.965), _INK, 0.8)

    def _ways(self, robots: list[Seen]) -> None:
        for number, seen in enumerate(robots):
            first, self._drawn[number] = max(self._drawn[number] - 1, 0), len(seen.way)
            if len(seen.way) - first < 2:
                continue
            blue, green, red = (int(0.45 * one + 0.55 * 236) for one in COLOURS[number])
            _line(self._ground, seen.way[first:], (blue, green, red), 2)

    # --- what moves ---

    def _belief(self, picture: Picture, number: int, seen: Seen) -> None:
        """Draw a robot's map, its way, and where it believes to be."""
        if seen.turn is None or seen.localised is None:
            return
        colour = COLOURS[number]
        for digit, sign in seen.signs.items():
            place = seen.in_arena((sign.x, sign.y))
            _disc(picture, place, max(2 * sign.sigma, 0.1), colour, 1)
            _middle_text(picture, str(digit), place * (1 + 0.26 / max(np.hypot(*place), 1)), colour, 0.45)
        for known in seen.filling:
            x, y = known.x + 0.2 * math.cos(known.theta), known.y + 0.2 * math.sin(known.theta)
            _disc(picture, seen.in_arena((x, y)), 0.05, colour, 1)
        if seen.path is not None and len(seen.path) > 1:
            _line(picture, seen.in_arena(seen.path), colour, 1)
            _disc(picture, seen.in_arena(seen.path[-1]), 0.07, colour, 1)
        x, y, theta = (float(one) for one in seen.localised.pose)
        place, ahead = seen.in_arena([(x, y), (x + 0.45 * math.cos(theta), y + 0.45 * math.sin(theta))])
        ghost = _INK if seen.localised.sure else _SOFT
        _disc(picture, place, RADIUS_M + 0.05, ghost, 1)
        _line(picture, [place, ahead], ghost, 1)

    def _robot(self, picture: Picture, number: int, body: Body, seen: Seen) -> None:
        place = (body.x, body.y)
        if body.lamp:
            _disc(picture, place, RADIUS_M + 0.13, _LAMP)
        _disc(picture, place, RADIUS_M, COLOURS[number])
        if body.contact:
            _disc(picture, place, RADIUS_M + 0.08, (40, 40, 230), 3)
        nose = [(body.x + far * math.cos(body.theta), body.y + far * math.sin(body.theta)) for far in (0.12, 0.25)]
        _line(picture, nose, (255, 255, 255), 3)
        cube = self._simulation.cube(number)
        if cube is not None:
            ((x, y),) = (_pixels(place) >> _SHIFT).tolist()
            cv2.rectangle(picture, (x - 7, y - 8), (x + 7, y + 8), (255, 255, 255), -1)
            _middle_text(picture, str(cube), place, _INK, 0.45)

    def _corner_texts(self, picture: Picture, robots: list[Seen]) -> None:
        _text(picture, f"{self._simulation.now_s:.1f} s", (10, 24), size=0.7)
        _text(picture, f"seed {self._seed}", (10, 44), _SOFT)
        for row, (says, colour) in enumerate((("outlined: believed", _INK), ("outside: its map", _SOFT))):
            (width, _), _ = cv2.getTextSize(says, _FONT, 0.4, 1)
            _text(picture, says, (SIDE - width - 8, 18 + 16 * row), colour, 0.4)
        for number, score in enumerate(self._simulation.scores):
            left, row = number % 2 == 0, number // 2
            at = (10 if left else SIDE - 130, SIDE - 30 + 18 * row)
            cv2.circle(picture, (at[0] + 5, at[1] - 4), 5, COLOURS[number], -1, cv2.LINE_AA)
            _text(picture, f"{len(score.delivered)} delivered", (at[0] + 16, at[1]))

    def _pictures(self, picture: Picture, robots: list[Seen]) -> None:
        """Put what the cameras saw beside the arena: one robot's below each other, those of more side by side."""
        wide = _CAMERA if len(robots) == 1 else _CAMERA // 2
        high = wide * 3 // 4
        for number, seen in enumerate(robots):
            x, y = SIDE, 0 if wide == _CAMERA else number * high
            if seen.front is not None:
                looked = cameras.ahead(seen.front, seen.targets or [], seen.digits or [], wide)
                picture[y : y + high, x : x + wide] = looked
            if seen.basket is not None:
                below, beside = (y + high, x) if wide == _CAMERA else (y, x + wide)
                picture[below : below + high, beside : beside + wide] = cameras.basket(seen.basket, seen.cube, wide)
            cv2.rectangle(picture, (x, y), (SIZE[0], y + 18), (255, 255, 255), -1)
            cv2.circle(picture, (x + 9, y + 9), 5, COLOURS[number], -1, cv2.LINE_AA)
            _text(picture, seen.step[:50], (x + 20, y + 13), size=0.42)
