"""Signs in the pictures of the front camera: where they hang, and which digit is on them.

The camera looks straight ahead and the signs hang upright, so how high something appears says how far it is, however
much it is turned away; a digit's frame has two upright edges, which say how far each side is.
"""

from __future__ import annotations

import functools
import math
from typing import Any, Final

import cv2
import numpy as np

import hfg
from examples.fetch_delivery import signs
from examples.fetch_delivery.perception.records import Sighting
from hfg.images import Gray
from hfg.nodes.vision import Bullseye, find_bullseyes, find_quadrilaterals

FOCAL: Final = 240 / math.tan(math.radians(23))  # pixels
MIDDLE: Final = (319.5, 239.5)
AHEAD: Final = 0.2  # the camera before the robot's centre
HEIGHT: Final = 0.36

_BULLSEYE: Final = signs.BULLSEYE_M * signs.RINGS_SHARE  # diameter of the outermost ring
_SMALLEST: Final = 12.0  # pixels
_SIZE: Final = 40  # pixels of a digit that is compared
_LIKE: Final = 0.7
_BETTER: Final = 0.08  # than any other digit

# Rows of the picture, for the camera looks level: bull's-eyes hang as high as it is, 0.45 m away or more, and digits
# above it. To search only there costs about half.
_TARGETS: Final = (75, 405)
_DIGITS: Final = (0, 250)


@hfg.node
def find_targets(image: Gray) -> list[Sighting]:
    """Find bull's-eyes and where they are.

    Args:
      image: of the front camera.

    Returns:
      out: the nearest first.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty.
    """
    found = []
    band, top = _band(image, *_TARGETS)
    for one in find_bullseyes.function(band, smallest=10.0):
        seen = _target(one._replace(y=one.y + top))
        if seen is not None:
            found.append(seen)
    return sorted(found, key=lambda seen: seen.distance)


def _band(image: Any, top: int, bottom: int) -> tuple[Any, int]:
    """Return some rows of a picture, and how many are above them; a picture of another size as it is."""
    return (image[top:bottom], top) if image.shape[0] == 480 else (image, 0)


def _target(one: Bullseye) -> Sighting | None:
    a, b = one.major / 2, one.minor / 2
    cos, sin = math.cos(one.angle), math.sin(one.angle)
    tall, wide = 2 * math.hypot(a * sin, b * cos), 2 * math.hypot(a * cos, b * sin)
    if wide > 1.08 * tall + 1.5:
        return None  # an upright circle is never wider than tall
    ahead = FOCAL * _BULLSEYE / tall
    left = (MIDDLE[0] - one.x) / FOCAL * ahead
    height = HEIGHT + (MIDDLE[1] - one.y) / FOCAL * ahead
    if abs(height - signs.BULLSEYE_HEIGHT_M) > 0.05 + 0.02 * ahead:
        return None
    facing = math.remainder(math.pi + _turned(wide / tall, -left / ahead, one.lean_x, ahead), 2 * math.pi)
    return Sighting("bullseye", ahead + AHEAD, left, facing, min(1.0, one.rings / 5))


def _turned(ratio: float, right: float, lean: float, ahead: float) -> float:
    """Return how far the right edge of a circle is turned away, or NaN if the picture does not tell.

    A circle that is `ratio` as wide as tall is turned to one side or the other. Which one tells the middle of its
    rings, which does not lie in the middle of its outermost ellipse; far away that is too little to be seen.
    """
    aside = math.atan(right)
    opening = math.acos(min(1.0, ratio * math.cos(aside)))
    turns = [opening - aside, -opening - aside]
    leans = [_lean(turn, right, ahead) for turn in turns]
    if 2 * opening < 0.3:
        return -aside
    if abs(leans[0] - leans[1]) < 0.6 or abs(lean - (leans[0] + leans[1]) / 2) < 0.15:
        return math.nan
    return turns[0] if abs(lean - leans[0]) < abs(lean - leans[1]) else turns[1]


def _lean(turn: float, right: float, ahead: float) -> float:
    sin, cos = math.sin(turn), math.cos(turn)
    return FOCAL * (_BULLSEYE / 2 / ahead) ** 2 * sin * (cos - right * sin)


@hfg.node
def read_digits(image: Gray) -> list[Sighting]:
    """Find the signs with digits, read them, and say where they are.

    Args:
      image: of the front camera.

    Returns:
      out: the nearest first; what is framed but no digit is left out.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty.
    """
    found = []
    band, _ = _band(image, *_DIGITS)
    for corners in find_quadrilaterals.function(band, smallest=_SMALLEST):
        seen = _digit(image, corners.astype(np.float64))
        if seen is not None:
            found.append(seen)
    return sorted(found, key=lambda seen: seen.distance)


def _digit(image: Any, corners: Any) -> Sighting | None:
    side, prints = _prints()
    upper_left, upper_right, lower_right, lower_left = corners
    left_edge, right_edge = lower_left[1] - upper_left[1], lower_right[1] - upper_right[1]
    if min(left_edge, right_edge) < _SMALLEST or not 0.6 < left_edge / right_edge < 1.67:
        return None
    if max(abs(upper_left[0] - lower_left[0]), abs(upper_right[0] - lower_right[0])) > 2 + 0.1 * left_edge:
        return None  # not upright
    ahead = FOCAL * side / np.array([left_edge, right_edge])
    middles = np.array([(upper_left + lower_left)[0], (upper_right + lower_right)[0]]) / 2
    left = (MIDDLE[0] - middles) / FOCAL * ahead
    down = (corners[:, 1].mean() - MIDDLE[1]) / FOCAL * ahead.mean()
    if abs(HEIGHT - down - signs.DIGIT_HEIGHT_M) > 0.1 + 0.03 * ahead.mean():
        return None
    label, score = _read(image, corners, prints)
    if not label:
        return None
    width = math.hypot(ahead[1] - ahead[0], left[1] - left[0])
    if not 0.5 < width / side < 1.5:
        return None
    # From the right edge to the left one the panel runs to the left of who stands before it; it looks back at him.
    facing = math.atan2(left[0] - left[1], ahead[0] - ahead[1]) + math.pi / 2
    x, y = float(ahead.mean()) + AHEAD, float(left.mean())
    return Sighting(label, x, y, math.remainder(facing, 2 * math.pi), score)


def _read(image: Any, corners: Any, prints: dict[str, Any]) -> tuple[str, float]:
    """Lay the frame onto a square and compare it with each print; "" if it is like none, or like two."""
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32) * _SIZE - 0.5
    homography = cv2.getPerspectiveTransform(corners.astype(np.float32), square)
    upright = cv2.warpPerspective(image, homography, (_SIZE, _SIZE), borderMode=cv2.BORDER_REPLICATE)
    inner = _normal(upright)
    if inner is None:
        return "", 0.0
    likeness = {label: float((inner * one).mean()) for label, one in prints.items()}
    best = max(likeness, key=lambda label: likeness[label])
    second = max(value for label, value in likeness.items() if label != best)
    if likeness[best] < _LIKE or likeness[best] < second + _BETTER:
        return "", 0.0
    return best, likeness[best]


@functools.cache
def _prints() -> tuple[float, dict[str, Any]]:
    """Return the side of a frame in metres, from outer edge to outer edge, and how each digit looks in it."""
    prints, side = {}, 0.0
    for digit in range(1, 5):
        panel = signs.digit_sign(digit, 512)
        dark = np.flatnonzero((panel < 128).any(0))
        first, last = int(dark[0]), int(dark[-1])
        side = (last + 1 - first) / 512 * signs.DIGIT_M
        framed = panel[first : last + 1, first : last + 1]
        inner = _normal(cv2.resize(framed, (_SIZE, _SIZE), interpolation=cv2.INTER_AREA))
        assert inner is not None
        prints[str(digit)] = inner
    return side, prints


def _normal(upright: Any) -> Any:
    """Cut the frame off, and take brightness and contrast out; None if there is no contrast."""
    rim = round(_SIZE * 0.13)
    inner = cv2.GaussianBlur(upright, (3, 3), 0)[rim:-rim, rim:-rim].astype(np.float64)
    spread = inner.std()
    return (inner - inner.mean()) / spread if spread > 10 else None
