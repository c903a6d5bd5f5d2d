"""Photographs of a flat panel at a known place, for tests of what finds such panels: exact geometry, real trouble."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import cv2
import numpy as np

FOCAL = 565.0
MIDDLE = (319.5, 239.5)
SHAPE = (480, 640)


class View(NamedTuple):
    """Where the middle of a panel is, seen from the camera, and how it is turned.

    Attributes:
      ahead: along the optical axis, in metres.
      left: to the left of it.
      up: above it.
      turned: how far its right edge lies farther away than its left one; 0 is parallel to the picture.
    """

    ahead: float
    left: float
    up: float
    turned: float

    def corners(self, side: float) -> Any:
        """Give where the corners are in the picture: upper left, upper right, lower right, lower left."""
        signs = np.array([(-1, 1), (1, 1), (1, -1), (-1, -1)]) * side / 2  # to the right, up
        right = signs[:, 0] * math.cos(self.turned) - self.left
        ahead = self.ahead + signs[:, 0] * math.sin(self.turned)
        up = self.up + signs[:, 1]
        return np.stack([FOCAL * right / ahead + MIDDLE[0], -FOCAL * up / ahead + MIDDLE[1]], 1)

    def off_axis(self) -> float:
        """Give the angle between the panel's normal and the line of sight."""
        return abs(self.turned - math.atan2(self.left, self.ahead))


def photograph(
    panel: Any,
    side: float,
    view: View,
    rng: np.random.Generator,
    *,
    blur: float = 0.6,
    shake: int = 1,
    noise: float = 4.0,
) -> Any:
    """Photograph a panel in front of an uneven wall: with blur, shaken sideways by some pixels, and with noise."""
    height, width = SHAPE
    image: Any = np.full(SHAPE, rng.integers(150, 200), np.float32)
    image[height // 2 :] = rng.integers(90, 130)
    image += np.linspace(0, float(rng.uniform(-20, 20)), width, dtype=np.float32)
    for _ in range(6):  # edges of walls, other things
        x, y = rng.integers(0, width), rng.integers(0, height)
        image[y : y + rng.integers(10, 120), x : x + rng.integers(10, 200)] += rng.uniform(-40, 30)
    corners = view.corners(side)
    left, upper = np.maximum(np.floor(corners.min(0)).astype(int) - 1, 0)
    right, lower = np.minimum(np.ceil(corners.max(0)).astype(int) + 2, (width, height))
    if left < right and upper < lower:
        finer = 4 if right - left < 120 else 2
        size = ((right - left) * finer, (lower - upper) * finer)
        # A pixel is a square around its whole number; each is the mean of what falls on it.
        fine = (corners - (left, upper) + 0.5) * finer - 0.5
        texture: Any = panel
        span = float(np.hypot(*(fine[2] - fine[0]))) / math.sqrt(2)
        while texture.shape[0] > 2 * span and texture.shape[0] > 8:
            texture = cv2.pyrDown(texture)
        edge = texture.shape[0] - 0.5
        source = np.array([(-0.5, -0.5), (edge, -0.5), (edge, edge), (-0.5, edge)], np.float32)
        homography = cv2.getPerspectiveTransform(source, fine.astype(np.float32))
        shown = cv2.warpPerspective(texture, homography, size, borderMode=cv2.BORDER_REPLICATE)
        share = cv2.warpPerspective(np.full_like(texture, 255), homography, size)
        small = (int(right - left), int(lower - upper))
        shown, share = (cv2.resize(one, small, interpolation=cv2.INTER_AREA) for one in (shown, share))
        place: Any = image[upper:lower, left:right]
        place += (shown - place) * (share / np.float32(255))
    image = cv2.GaussianBlur(image, (0, 0), blur)
    if shake > 1:
        image = cv2.blur(image, (shake, 1))
    return np.clip(np.rint(image + noise * rng.standard_normal(SHAPE, np.float32)), 0, 255).astype(np.uint8)
