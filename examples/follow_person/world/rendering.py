"""Pictures of a camera that looks ahead: sky, ground, trunks, bushes and people, the near ones before the far ones."""

from __future__ import annotations

import math
from typing import Any, Final

import cv2
import numpy as np

from examples.follow_person.messages import Array, Camera, Picture
from examples.follow_person.world.course import Ground
from examples.follow_person.world.people import HEIGHT_M, Walker

_SKY: Final = (0.86, 0.78, 0.7)
_GROUND: Final = (0.45, 0.62, 0.58)
_BARK: Final = (0.16, 0.24, 0.32)
_LEAVES: Final = (0.14, 0.34, 0.16)
_SKIN: Final = (0.5, 0.62, 0.82)
_FAR_M: Final = 40.0
_NEAR_M: Final = 0.6


class Photographer:
    """Takes pictures.

    Args:
      camera: that takes them.
      noise: standard deviation of a pixel, in grey levels.
      random: decides the noise, of which a stock is made.
    """

    def __init__(self, camera: Camera, noise: float, random: np.random.Generator) -> None:
        self.camera = camera
        size = (camera.height + 64, camera.width + 64, 3)
        self._stock = random.normal(0, noise, size).astype(np.int16)
        self._random = random

    def take(
        self,
        place: tuple[float, float, float],
        turn: Any,
        ground: Ground,
        trunks: Array,
        people: list[Walker],
        light: float,
    ) -> Picture:
        """Take one.

        Args:
          place: x, y and height of the camera.
          turn: rotation of the robot, 3 x 3.
          ground: below.
          trunks: a row of x, y, radius, height for each.
          people: all of them.
          light: how bright it is; 1 is a clear day.
        """
        picture = self._background(turn, light)
        views = [(self._seen(x, y, place, turn), "trunk", row) for x, y, *row in trunks.tolist()]
        views += [(self._seen(one.x, one.y, place, turn), "person", one) for one in people]
        shown = [view for view in views if _NEAR_M < view[0][0] < _FAR_M and abs(view[0][1]) < view[0][0] * 1.1 + 1]
        for (ahead, left), kind, what in sorted(shown, key=lambda view: -view[0][0]):
            x = place[0] + turn[0, 0] * ahead - turn[1, 0] * left
            y = place[1] + turn[1, 0] * ahead + turn[0, 0] * left
            above = float(ground.height(x, y)) - place[2]
            if kind == "trunk":
                self._trunk(picture, ahead, left, above, what, turn, light)
            else:
                self._person(picture, ahead, left, above, what, turn, light)
        row, column = self._random.integers(0, 64, 2)
        noise = self._stock[row : row + self.camera.height, column : column + self.camera.width]
        noisy: Picture = np.clip(picture.astype(np.int16) + noise, 0, 255).astype(np.uint8)
        return noisy

    def _seen(self, x: float, y: float, place: Any, turn: Any) -> tuple[float, float]:
        """Return how far ahead and to the left something is."""
        norm = math.hypot(turn[0, 0], turn[1, 0])
        cos, sin = turn[0, 0] / norm, turn[1, 0] / norm
        dx, dy = x - place[0], y - place[1]
        return cos * dx + sin * dy, cos * dy - sin * dx

    def _pixel(self, ahead: float, left: float, above: float, turn: Any) -> tuple[int, int]:
        """Return where a point appears, in sixteenths of a pixel; `turn` tilts the camera."""
        norm = math.hypot(turn[0, 0], turn[1, 0])
        yaw = np.array([[turn[0, 0], turn[1, 0], 0], [-turn[1, 0], turn[0, 0], 0], [0, 0, norm]]) / norm
        x, y, z = (turn.T @ yaw.T) @ (ahead, left, above)
        x = max(x, 0.1)
        u, v = self.camera.width / 2 - self.camera.focal * y / x, self.camera.height / 2 - self.camera.focal * z / x
        limit = 20_000
        return round(16 * max(-limit, min(limit, u))), round(16 * max(-limit, min(limit, v)))

    def _background(self, turn: Any, light: float) -> Picture:
        camera = self.camera
        picture = np.empty((camera.height, camera.width, 3), np.uint8)
        left, right = (self._pixel(30.0, side, -camera.above - 0.5, turn) for side in (60.0, -60.0))
        picture[:] = _shade(_SKY, light)
        corners = [
            left,
            right,
            (16 * camera.width * 4, 16 * camera.height * 4),
            (-16 * camera.width * 4, 64 * camera.height),
        ]
        _fill(picture, corners, _shade(_GROUND, light))
        return picture

    def _box(
        self, picture: Picture, sides: tuple[Any, Any, Any], height: tuple[float, float], turn: Any, shade: Any
    ) -> None:
        """Draw an upright rectangle: distance ahead, middle to the left and half of its width; lowest and highest."""
        ahead, left, half = sides
        corners = [
            self._pixel(ahead, left + side * half, height[end], turn)
            for side, end in ((1, 0), (1, 1), (-1, 1), (-1, 0))
        ]
        _fill(picture, corners, shade)

    def _trunk(
        self, picture: Picture, ahead: float, left: float, above: float, row: Any, turn: Any, light: float
    ) -> None:
        radius, height = row
        colour = _BARK if height > 2 else _LEAVES
        self._box(picture, (ahead, left, radius), (above, above + height), turn, _shade(colour, light))

    def _person(
        self, picture: Picture, ahead: float, left: float, above: float, one: Walker, turn: Any, light: float
    ) -> None:
        yaw = math.atan2(turn[1, 0], turn[0, 0])
        shirt, trousers = (_shade(colour, light) for colour in one.clothes)
        look = one.heading - yaw
        cos, sin = math.cos(look), math.sin(look)
        swing = math.sin(one.phase) * min(1.0, one.speed)
        for side in (-1.0, 1.0):
            foot = sin * side * 0.3 * swing + cos * side * 0.1
            hip = cos * side * 0.09
            self._limb(picture, ahead, (left + hip, above + 0.82), (left + foot, above + 0.03), 0.085, turn, trousers)
        for side in (-1.0, 1.0):
            hand = -sin * side * 0.25 * swing + cos * side * 0.28
            shoulder = cos * side * 0.2
            self._limb(picture, ahead, (left + shoulder, above + 1.4), (left + hand, above + 0.85), 0.05, turn, shirt)
        wide = 0.13 + 0.07 * abs(cos)
        self._box(picture, (ahead, left, wide), (above + 0.78, above + 1.46), turn, shirt)
        self._limb(picture, ahead, (left, above + 1.44), (left, above + 1.52), 0.06, turn, _shade(_SKIN, light))
        u, v = self._pixel(ahead, left, above + HEIGHT_M - 0.12, turn)
        size = max(1, round(16 * self.camera.focal * 0.115 / max(ahead, 0.1)))
        cv2.circle(picture, (u, v), size, _shade(_SKIN, light), -1, cv2.LINE_AA, 4)

    def _limb(self, picture: Picture, ahead: float, top: Any, bottom: Any, half: float, turn: Any, shade: Any) -> None:
        corners = [
            self._pixel(ahead, end[0] + side * half, end[1], turn)
            for end, side in ((top, 1), (top, -1), (bottom, -1), (bottom, 1))
        ]
        _fill(picture, corners, shade)


def _fill(picture: Picture, corners: list[tuple[int, int]], shade: tuple[float, float, float]) -> None:
    cv2.fillConvexPoly(picture, np.array(corners, np.int32), shade, cv2.LINE_AA, 4)


def _shade(colour: Any, light: float) -> tuple[float, float, float]:
    blue, green, red = (min(255.0, 255.0 * light * float(one)) for one in colour)
    return blue, green, red
