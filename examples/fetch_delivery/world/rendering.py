"""What the cameras see: flat panels in perspective, painted from far to near, blurred by motion, with noise.

A light renderer of NumPy and OpenCV. Pictures take most of the time of a simulation, so corners are projected all at
once, what is behind, turned away or out of sight is left out before anything is painted, smaller copies of the prints
are made once, and noise is cut from a sheet instead of being drawn anew.

Painting from far to near needs no depth: what hangs at the outer wall is behind all else, the octagon is convex, and
round things are before or behind it as a whole.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np

from examples.fetch_delivery import signs
from examples.fetch_delivery.messages import Picture, Vector
from examples.fetch_delivery.world.arena import DIGIT_BESIDE, WALL_HEIGHT_M, WALL_PANELS, Arena

WIDTH, HEIGHT = 640, 480
FOCAL_PX = HEIGHT / 2 / math.tan(math.radians(46) / 2)
NOISE_LEVELS = 4.0  # standard deviation
EXPOSURE_S = 0.01
NEAR_M = 0.08
SKY, FLOOR = 190, 110
_MARGIN = 128  # of the sheet of noise, by which its cut can move


class Camera(NamedTuple):
    """Where on the robot a camera sits, and how far it looks down."""

    ahead: float
    height: float
    pitch: float = 0.0


FRONT = Camera(0.2, 0.36)
BASKET = Camera(-0.06, 0.42, math.atan(0.2))


class Round(NamedTuple):
    """Something round that stands about: a robot or a crate."""

    x: float
    y: float
    radius: float
    height: float
    shade: int


@dataclass(frozen=True)
class Cube:
    """How a cube lies in the basket: how far before the camera, how far to its left, how it is turned."""

    number: int
    distance: float = 0.2
    left: float = 0.0
    yaw: float = 0.0
    smeared: bool = False


def _standing(x: float, y: float, z: float, facing: float, half_width: float, half_height: float) -> Vector:
    """Return the corners of an upright panel: top left, top right, bottom right, bottom left, seen from its front."""
    left = np.array([math.sin(facing), -math.cos(facing), 0.0]) * half_width
    up = np.array([0.0, 0.0, half_height])
    middle = np.array([x, y, z])
    return np.stack([middle + left + up, middle - left + up, middle - left - up, middle + left - up])


def _smaller_and_smaller(print_: Picture) -> list[Picture]:
    copies = [print_]
    while copies[-1].shape[0] > 12:
        copies.append(np.asarray(cv2.pyrDown(copies[-1]), np.uint8))
    return copies


class _Panels:
    """Panels of one layer that stand still: all corners in one array, and a shade or a print for each."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.surfaces: list[int | list[Picture]] = []
        self._corners: list[Vector] = []

    def add(self, corners: Vector, surface: int | list[Picture], name: str = "") -> None:
        self._corners.append(corners)
        self.surfaces.append(surface)
        self.names.append(name)

    def close(self) -> None:
        self.corners = np.stack(self._corners)
        normals = np.cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 3] - self.corners[:, 0])
        self.normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        self.offsets = np.einsum("ij,ij->i", self.normals, self.corners[:, 0])


class Renderer:
    """Takes pictures of one arena."""

    def __init__(self, arena: Arena) -> None:
        """Print the signs and set up the panels."""
        self._prints = {f"digit {number}": _smaller_and_smaller(signs.digit_sign(number)) for number in range(1, 5)}
        self._prints["bullseye"] = _smaller_and_smaller(signs.bullseye())
        for number in range(1, 5):
            face = signs.cube_face(number)
            smeared = face.copy()
            smeared[:, 200:330] = 90
            self._prints[f"cube {number}"] = _smaller_and_smaller(face)
            self._prints[f"smeared {number}"] = _smaller_and_smaller(smeared)
        self._outer, self._inner = _Panels(), _Panels()
        self._octagon_m = arena.octagon_m
        self._set_up_walls(arena)
        self._set_up_signs(arena)
        self._outer.close()
        self._inner.close()
        sheet = np.random.default_rng(0).normal(0.0, NOISE_LEVELS, (HEIGHT + _MARGIN, WIDTH + _MARGIN))
        self._brighter = np.rint(np.maximum(sheet, 0)).astype(np.uint8)
        self._darker = np.rint(np.maximum(-sheet, 0)).astype(np.uint8)
        self._empty = np.full((HEIGHT, WIDTH), SKY, np.uint8)
        self._empty[HEIGHT // 2 :] = FLOOR
        rows = np.linspace(120, 160, HEIGHT, dtype=np.float64)[:, None]
        self._basket = np.repeat(rows, WIDTH, axis=1).astype(np.uint8)
        self._basket[: HEIGHT // 6] = 70

    def front(
        self,
        pose: tuple[float, float, float],
        *,
        around: tuple[Round, ...] = (),
        hidden: frozenset[str] = frozenset(),
        turning: float = 0.0,
        sideways: float = 0.0,
        shake: tuple[int, int] = (0, 0),
        light: float = 1.0,
        exposure_s: float = EXPOSURE_S,
    ) -> Picture:
        """Take a picture with the front camera.

        Args:
          pose: of the robot, in the arena's frame.
          around: what stands about.
          hidden: names of signs that cannot be seen, such as "digit 3".
          turning: how fast the robot turns, in rad/s; blurs the picture.
          sideways: how fast it moves to its side, in m/s; blurs it a little.
          shake: where the noise is cut from, below 128 each.
          light: how bright it is, 1 as usual. The noise stays the same.
          exposure_s: how long it is exposed; blurs what moves.
        """
        picture = self._draw_front(pose, around, hidden)
        length = round(FOCAL_PX * exposure_s * (abs(turning) + abs(sideways) / 3))
        if length > 1:
            picture = np.asarray(cv2.blur(picture, (length, 1)), np.uint8)
        return self._with_noise(_lit(picture, light), shake)

    def basket(self, cube: Cube | None, *, shake: tuple[int, int] = (0, 0), light: float = 1.0) -> Picture:
        """Take a picture of the basket."""
        return self._with_noise(_lit(self._draw_basket(cube), light), shake)

    def _draw_front(
        self, pose: tuple[float, float, float], around: tuple[Round, ...], hidden: frozenset[str]
    ) -> Picture:
        """Draw what is ahead, sharp and clean."""
        eye, turn = _camera(pose, FRONT)
        picture = self._empty.copy()
        self._paint(picture, self._outer, eye, turn, hidden)
        far, near = _before_and_behind(eye, around, self._octagon_m)
        for thing in far:
            _paint_round(picture, thing, eye, turn)
        self._paint(picture, self._inner, eye, turn, hidden)
        for thing in near:
            _paint_round(picture, thing, eye, turn)
        return picture

    def _draw_basket(self, cube: Cube | None) -> Picture:
        """Draw the basket, sharp and clean."""
        picture = self._basket.copy()
        if cube is not None:
            eye, turn = _camera((0.0, 0.0, 0.0), BASKET)
            half, z = signs.CUBE_M / 2, BASKET.height - 0.05
            x, y = BASKET.ahead + cube.distance + half, cube.left
            print_ = self._prints[f"{'smeared' if cube.smeared else 'cube'} {cube.number}"]
            sides = [cube.yaw + math.pi + quarter * math.pi / 2 for quarter in range(4)]
            for facing in sides:
                middle = (x + half * math.cos(facing), y + half * math.sin(facing))
                corners = _standing(*middle, z, facing, half, half)
                if (eye[0] - middle[0]) * math.cos(facing) + (eye[1] - middle[1]) * math.sin(facing) > 0:
                    _paint_one(picture, (corners - eye) @ turn.T, print_)
            top = np.array([[x + half * math.sqrt(2) * math.cos(f + 0.785), 0, z + half] for f in sides])
            top[:, 1] = [y + half * math.sqrt(2) * math.sin(f + 0.785) for f in sides]
            _paint_one(picture, (top - eye) @ turn.T, 225)
        return picture

    def _set_up_walls(self, arena: Arena) -> None:
        half = arena.radius * math.sin(math.pi / WALL_PANELS)
        for number, (nx, ny) in enumerate(arena.wall.normals):
            middle = (arena.apothem * nx, arena.apothem * ny, WALL_HEIGHT_M / 2)
            facing = math.atan2(ny, nx) + math.pi
            self._outer.add(_standing(*middle, facing, half, WALL_HEIGHT_M / 2), 150 + number % 2 * 6)
        half = arena.octagon_m * math.tan(math.pi / 8)
        for number, (nx, ny) in enumerate(arena.octagon.normals):
            middle = (arena.octagon_m * nx, arena.octagon_m * ny, WALL_HEIGHT_M / 2)
            self._inner.add(_standing(*middle, math.atan2(ny, nx), half, WALL_HEIGHT_M / 2), 165 + number % 2 * 6)

    def _set_up_signs(self, arena: Arena) -> None:
        half = signs.BULLSEYE_M / 2
        for station in arena.stations:
            x, y, facing = station.x, station.y, station.facing
            if station.kind == "filling":
                middle = (x + 0.02 * math.cos(facing), y + 0.02 * math.sin(facing), signs.BULLSEYE_HEIGHT_M)
                self._inner.add(
                    _standing(*middle, facing, half, half), self._prints["bullseye"], f"filling {station.number}"
                )
                continue
            self._outer.add(
                _standing(x, y, signs.BULLSEYE_HEIGHT_M, facing, half, half),
                self._prints["bullseye"],
                f"delivery {station.number}",
            )
            angle, distance = math.atan2(y, x) + DIGIT_BESIDE, math.hypot(x, y)
            middle = (distance * math.cos(angle), distance * math.sin(angle), signs.DIGIT_HEIGHT_M)
            corners = _standing(*middle, angle + math.pi, signs.DIGIT_M / 2, signs.DIGIT_M / 2)
            self._outer.add(corners, self._prints[f"digit {station.number}"], f"digit {station.number}")

    def _paint(self, picture: Picture, panels: _Panels, eye: Vector, turn: Vector, hidden: frozenset[str]) -> None:
        seen = np.flatnonzero(panels.normals @ eye < panels.offsets)  # the normals of these corners look backwards
        corners = (panels.corners[seen] - eye) @ turn.T
        right, ahead = corners[..., 0], corners[..., 2]
        wide = WIDTH / 2 / FOCAL_PX * ahead
        outside = (ahead < NEAR_M).all(1) | (right > wide).all(1) | (right < -wide).all(1)
        for number in np.flatnonzero(~outside):
            if panels.names[seen[number]] not in hidden:
                _paint_one(picture, corners[number], panels.surfaces[seen[number]])

    def _with_noise(self, picture: Picture, shake: tuple[int, int]) -> Picture:
        # Five times as fast as adding noise with a sign.
        down, right = shake
        cut = np.s_[down : down + HEIGHT, right : right + WIDTH]
        return np.asarray(cv2.subtract(cv2.add(picture, self._brighter[cut]), self._darker[cut]), np.uint8)


def _lit(picture: Picture, light: float) -> Picture:
    return picture if light == 1.0 else np.asarray(cv2.convertScaleAbs(picture, alpha=light), np.uint8)


def _camera(pose: tuple[float, float, float], camera: Camera) -> tuple[Vector, Vector]:
    """Return where the camera is, and the matrix whose rows look right, down and ahead."""
    x, y, theta = pose
    cos, sin = math.cos(theta), math.sin(theta)
    down, level = math.sin(camera.pitch), math.cos(camera.pitch)
    eye = np.array([x + cos * camera.ahead, y + sin * camera.ahead, camera.height])
    turn = np.array([[sin, -cos, 0.0], [-down * cos, -down * sin, -level], [level * cos, level * sin, -down]])
    return eye, turn


def _before_and_behind(eye: Vector, around: tuple[Round, ...], octagon_m: float) -> tuple[list[Round], list[Round]]:
    """Sort what stands about from far to near, and by whether the octagon can hide it."""
    tangent = math.sqrt(max(eye[0] ** 2 + eye[1] ** 2 - octagon_m**2, 0.0))
    by_distance = sorted(around, key=lambda thing: -math.hypot(thing.x - eye[0], thing.y - eye[1]))
    away = [math.hypot(thing.x - eye[0], thing.y - eye[1]) for thing in by_distance]
    far = [thing for thing, distance in zip(by_distance, away, strict=True) if distance > tangent]
    near = [thing for thing, distance in zip(by_distance, away, strict=True) if distance <= tangent]
    return far, near


def _paint_round(picture: Picture, thing: Round, eye: Vector, turn: Vector) -> None:
    facing = math.atan2(eye[1] - thing.y, eye[0] - thing.x)
    distance = math.hypot(thing.x - eye[0], thing.y - eye[1])
    if distance <= thing.radius + NEAR_M:
        return
    # The upright rectangle at its middle that covers what the round thing covers.
    half = thing.radius * distance / math.sqrt(distance**2 - thing.radius**2)
    corners = _standing(thing.x, thing.y, thing.height / 2 + 0.01, facing, half, thing.height / 2)
    corners = (corners - eye) @ turn.T
    if corners[0, 2] > NEAR_M and abs(corners[:, 0]).min() < WIDTH / 2 / FOCAL_PX * corners[0, 2] + 2 * half:
        _paint_one(picture, corners, thing.shade)


def _paint_one(picture: Picture, corners: Vector, surface: int | list[Picture]) -> None:
    """Paint a panel whose corners are given as the camera sees them: right, down, ahead."""
    if corners[:, 2].min() < NEAR_M:
        if not isinstance(surface, int):
            return
        corners = _cut_near(corners)
        if len(corners) < 3:
            return
    pixels = corners[:, :2] / corners[:, 2:] * FOCAL_PX + (WIDTH / 2, HEIGHT / 2)
    if isinstance(surface, int):
        points = np.rint(np.clip(pixels, -20000, 20000) * 16).astype(np.int32)
        cv2.fillConvexPoly(picture, points, surface, cv2.LINE_8, 4)
        return
    left, top = np.maximum(np.floor(pixels.min(0)).astype(int), 0)
    right, bottom = np.minimum(np.ceil(pixels.max(0)).astype(int) + 1, (WIDTH, HEIGHT))
    if right - left < 3 or bottom - top < 3:
        return
    span = max(math.dist(pixels[1], pixels[0]), math.dist(pixels[3], pixels[0]))
    level = min(max(0, math.floor(math.log2(max(surface[0].shape[0] / span, 1)))), len(surface) - 1)
    print_ = surface[level]
    size = print_.shape[0]
    origin = np.array([left, top])
    square = np.array([[0, 0], [size, 0], [size, size], [0, size]], np.float32)
    transform = cv2.getPerspectiveTransform(square, (pixels - origin).astype(np.float32))
    window = (int(right - left), int(bottom - top))
    patch = cv2.warpPerspective(print_, transform, window, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    mask = np.zeros(window[::-1], np.uint8)
    cv2.fillConvexPoly(mask, np.rint((pixels - origin) * 16).astype(np.int32), 255, cv2.LINE_8, 4)
    cv2.copyTo(patch, mask, picture[top:bottom, left:right])


def _cut_near(corners: Vector) -> Vector:
    kept = []
    for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if one[2] >= NEAR_M:
            kept.append(one)
        if (one[2] >= NEAR_M) != (other[2] >= NEAR_M):
            kept.append(one + (other - one) * ((NEAR_M - one[2]) / (other[2] - one[2])))
    return np.array(kept)
