"""Marks that people hang up for robots: bull's-eyes and framed signs, located to a fraction of a pixel.

Both are dark on light, so both begin with what is darker than its surroundings, once near and once far: a threshold
over a small neighbourhood parts the rings of a far mark, one over a large neighbourhood does not eat the broad rings of
a near one. What is found so lies on whole pixels; the borders are then looked for again in the gray levels.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, Final, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from annotated_types import Interval, Unit

from hfg.images import Picture, Rows, wrong_image
from hfg.nodes._pictures import gray
from hfg.nodetypes.functions import node
from hfg.types import Named

Corners = Annotated[npt.NDArray[np.float32], Rows(2), Named("Corners")]
_Points = npt.NDArray[np.float64]

_NEAR_AND_FAR: Final = (41, 161)  # pixels: sides of the neighbourhoods
_DARKER: Final = 10  # gray levels below the mean of the neighbourhood
_FLATTEST: Final = 0.3  # minor by major axis: about 72 degrees from the side
_CONCENTRIC: Final = 0.18  # of the diameter


class Bullseye(NamedTuple):
    """A bull's-eye in a picture.

    Attributes:
      x: where the middle of the rings is, from the left, in pixels.
      y: from above.
      major: the longer axis of the outermost ellipse, in pixels.
      minor: the shorter one.
      angle: of the longer axis, in radians from the right, clockwise as y goes down.
      lean_x: how far the middle of the rings lies from the middle of the outermost ellipse, in pixels: towards the side
        that is farther away.
      lean_y: the same, down.
      rings: how many circles were found inside of each other.
    """

    x: float
    y: float
    major: float
    minor: float
    angle: float
    lean_x: float
    lean_y: float
    rings: int


class _Ellipse(NamedTuple):
    x: float
    y: float
    major: float
    minor: float
    angle: float


@node
def find_bullseyes(
    image: Picture,
    *,
    rings: Annotated[int, Interval(ge=2, le=9)] = 3,
    smallest: Annotated[float, Interval(ge=4), Unit("px")] = 8.0,
) -> list[Bullseye]:
    """Find bull's-eyes: dark and light rings around a middle, the outermost dark on light.

    Fires once per picture; one without a bull's-eye gives an empty list. A circle that is looked at from the side is an
    ellipse, of which the longer axis says how far it is, and the shorter one how far from the side it is seen.

    Args:
      image: the picture: gray, or in colour, which is made gray.
      rings: how many circles inside of each other make a bull's-eye.
      smallest: the least diameter of the outermost, in pixels.

    Returns:
      out: the largest first.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty, or has two channels.
    """
    picture = _checked(image, "find_bullseyes")
    found: list[Bullseye] = []
    for dark in _dark(picture):
        contours, hierarchy = cv2.findContours(dark, cv2.RETR_TREE, cv2.CHAIN_APPROX_NONE)
        if hierarchy is not None:
            found += _concentric(picture, contours, hierarchy[0], rings, smallest)
    found.sort(key=lambda one: -one.major)
    kept: list[Bullseye] = []
    for one in found:  # both thresholds see most of them
        if all(np.hypot(one.x - other.x, one.y - other.y) > 0.3 * other.major for other in kept):
            kept.append(one)
    return kept


@node
def find_quadrilaterals(
    image: Picture,
    *,
    smallest: Annotated[float, Interval(ge=4), Unit("px")] = 11.0,
) -> list[Corners]:
    """Find the corners of dark quadrilaterals on light ground, such as the frames of signs.

    Fires once per picture; one without a quadrilateral gives an empty list.

    Args:
      image: the picture: gray, or in colour, which is made gray.
      smallest: the side of a square that is just large enough, in pixels.

    Returns:
      out: four corners each: upper left, upper right, lower right, lower left, in pixels; the largest first. They are
      the outer corners of a frame.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty, or has two channels.
    """
    picture = _checked(image, "find_quadrilaterals")
    kept: list[tuple[Any, Any]] = []  # as found first, and as refined
    for dark in _dark(picture):
        contours, hierarchy = cv2.findContours(dark, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        for index, contour in enumerate(contours):
            if len(contour) < 3 * smallest or hierarchy[0, index, 3] >= 0:  # too small, or a hole
                continue
            if cv2.contourArea(contour) < smallest**2:
                continue
            rough = _quadrilateral(contour)
            if rough is None:
                continue
            same = 2 + 0.1 * float(np.ptp(rough, 0).max())
            if any(np.abs(rough - other).max() < same for other, _ in kept):
                continue  # both thresholds see most of them
            refined = _refined(picture, rough)
            if refined is not None:
                kept.append((rough, refined))
    return sorted((refined for _, refined in kept), key=lambda one: -float(cv2.contourArea(one)))


def _checked(image: Any, name: str) -> Any:
    wrong = wrong_image(image, Picture)
    if wrong is not None:
        raise TypeError(f'input "image" of {name}: {wrong}')
    if image.size == 0:
        raise ValueError(f'input "image" of {name} is empty')
    return np.ascontiguousarray(gray(image))


def _dark(picture: Any) -> Iterator[Any]:
    """Yield what is darker than its surroundings, for a small and a large neighbourhood."""
    smooth = cv2.GaussianBlur(picture, (3, 3), 0)  # else each grain of noise is a contour of its own
    for side in _NEAR_AND_FAR:
        yield cv2.adaptiveThreshold(smooth, 255, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY_INV, side, _DARKER)


def _concentric(picture: Any, contours: Any, links: Any, rings: int, smallest: float) -> list[Bullseye]:
    """Walk from each ellipse inwards, as long as there is another around the same middle."""
    parents, first_child, following = links[:, 3], links[:, 2], links[:, 0]
    holders = np.arange(len(contours))
    for _ in range(rings - 1):  # those with so many contours inside of each other; all others are never looked at
        holders = np.unique(parents[holders])
        holders = holders[holders >= 0]
    ellipses: dict[int, _Ellipse | None] = {-1: None}

    def ellipse(index: int) -> _Ellipse | None:
        if index not in ellipses:
            ellipses[index] = _ellipse(contours[index])
        return ellipses[index]

    def inside(index: int, outer: _Ellipse) -> Iterator[tuple[int, _Ellipse]]:
        child = int(first_child[index])
        while child >= 0:
            inner = ellipse(child)
            if inner is not None and _same_middle(inner, outer) and 0.35 < inner.major / outer.major < 0.93:
                yield child, inner
            child = int(following[child])

    found = []
    for index in holders.tolist():
        outer, around = ellipse(index), ellipse(int(parents[index]))
        if outer is None or outer.major < smallest or (around is not None and _same_middle(outer, around)):
            continue
        chain, at = [outer], index
        while (step := next(inside(at, chain[-1]), None)) is not None:
            at = step[0]
            chain.append(step[1])
        if len(chain) >= rings:
            bullseye = _measured(picture, chain)
            if bullseye is not None:
                found.append(bullseye)
    return found


def _same_middle(inner: _Ellipse, outer: _Ellipse) -> bool:
    return bool(np.hypot(inner.x - outer.x, inner.y - outer.y) < _CONCENTRIC * outer.major)


def _ellipse(contour: Any) -> _Ellipse | None:
    """Fit an ellipse; None if the contour is not an ellipse.

    A square can have the area of its ellipse, too, so radii are compared.
    """
    if len(contour) < 8:
        return None
    fitted = _fit(contour.reshape(-1, 2))
    if fitted is None or fitted.minor < 2 or fitted.minor < _FLATTEST * fitted.major:
        return None
    radii = _radii(contour.reshape(-1, 2), fitted)
    if radii.std() > 0.04 + 0.6 / fitted.major:
        return None
    area = cv2.contourArea(contour)
    if abs(area - np.pi / 4 * fitted.major * fitted.minor) > 0.3 * area + np.pi * fitted.major / 2:
        return None  # only a part of it; a contour runs through the middle of its pixels, hence the last term
    return fitted


def _fit(points: Any) -> _Ellipse | None:
    (x, y), (first, second), degrees = cv2.fitEllipse(np.ascontiguousarray(points, np.float32))
    angle = np.radians(degrees)
    if second > first:
        first, second, angle = second, first, angle + np.pi / 2
    values = (x, y, first, second, angle)
    return _Ellipse(*map(float, values)) if np.isfinite(values).all() and second > 0 else None


def _radii(points: Any, ellipse: _Ellipse) -> _Points:
    """Return how far points are from the middle, where 1 is on the ellipse."""
    across, down = points[:, 0] - ellipse.x, points[:, 1] - ellipse.y
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    first = (across * cos + down * sin) / (ellipse.major / 2)
    second = (down * cos - across * sin) / (ellipse.minor / 2)
    return np.asarray(np.hypot(first, second), np.float64)


def _measured(picture: Any, chain: list[_Ellipse]) -> Bullseye | None:
    """Look for the outermost border in the gray levels, and for where the middle of the rings really is.

    The middle of an ellipse is not the image of the middle of its circle: it moves towards the near side with the
    square of the radius. So the middles of several circles say where it would be for a circle of no size.
    """
    outer = chain[0]
    turn = np.arange(48) * (2 * np.pi / 48)
    cos, sin = np.cos(outer.angle), np.sin(outer.angle)
    first, second = np.cos(turn), np.sin(turn)
    a, b = outer.major / 2, outer.minor / 2
    places = np.stack([outer.x + a * first * cos - b * second * sin, outer.y + a * first * sin + b * second * cos], 1)
    normals = np.stack([b * first * cos - a * second * sin, b * first * sin + a * second * cos], 1)
    normals /= np.hypot(normals[:, 0], normals[:, 1])[:, None]
    reach = float(np.clip(0.4 * (outer.minor - chain[1].minor * outer.major / chain[1].major) / 2, 1.5, 6.0))
    borders, clear = _borders(picture, places, normals, reach)
    refined = _fit(borders[clear]) if clear.sum() >= 24 else None
    if refined is None or not 0.7 < refined.major / outer.major < 1.4:
        return None
    sizes = np.array([one.major**2 for one in chain]) / refined.major**2
    middles = np.array([(one.x, one.y) for one in chain])
    middles[0] = refined.x, refined.y
    slope = ((sizes - sizes.mean())[:, None] * middles).sum(0) / ((sizes - sizes.mean()) ** 2).sum()
    x, y = middles.mean(0) - slope * sizes.mean()
    return Bullseye(
        float(x), float(y), refined.major, refined.minor, refined.angle, float(-slope[0]), float(-slope[1]), len(chain)
    )


def _borders(picture: Any, places: _Points, normals: _Points, reach: float) -> tuple[_Points, Any]:
    """Move points along their normals to where it becomes light: the middle of the rise of the gray levels.

    Also gives which of them have a border there at all.
    """
    steps = np.linspace(-reach, reach, 4 * round(reach) + 1)
    along = (places[:, None] + steps[None, :, None] * normals[:, None]).astype(np.float32)
    levels = cv2.remap(
        picture, along[:, :, 0], along[:, :, 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    ).astype(np.float64)
    rise = np.maximum(levels[:, 1:] - levels[:, :-1], 0)
    total = rise.sum(1)
    moved = rise @ ((steps[1:] + steps[:-1]) / 2) / np.maximum(total, 1)
    return places + moved[:, None] * normals, total > 20  # gray levels; less is noise


def _quadrilateral(contour: Any) -> Any:
    """Return the corners of a contour that has and fills four of them, clockwise from the upper left, else None."""
    hull = cv2.convexHull(contour)
    rough = cv2.approxPolyDP(hull, 0.05 * cv2.arcLength(hull, closed=True), closed=True)
    if len(rough) != 4 or cv2.contourArea(contour) < 0.85 * cv2.contourArea(rough):
        return None
    corners = rough.reshape(4, 2).astype(np.float64)
    spokes = corners - corners.mean(0)
    corners = corners[np.argsort(np.arctan2(spokes[:, 1], spokes[:, 0]))]
    return np.roll(corners, -int(np.argmin(corners.sum(1))), 0)


_SHARES: Final = np.linspace(0.12, 0.88, 24)  # of a side, away from its corners


def _refined(picture: Any, corners: _Points) -> Any:
    """Look for the four sides in the gray levels, and give where they cross; None if one of them is not there."""
    sides = np.roll(corners, -1, 0) - corners
    lengths = np.hypot(sides[:, 0], sides[:, 1])
    if lengths.min() < 4:
        return None
    outwards = np.stack([sides[:, 1], -sides[:, 0]], 1) / lengths[:, None]  # clockwise, as y goes down
    places = corners[:, None] + _SHARES[None, :, None] * sides[:, None]
    reach = float(np.clip(0.05 * lengths.min(), 1.5, 4.0))
    borders, clear = _borders(picture, places.reshape(-1, 2), np.repeat(outwards, len(_SHARES), 0), reach)
    lines = []
    for side in range(4):
        part = slice(side * len(_SHARES), (side + 1) * len(_SHARES))
        if clear[part].sum() < 0.6 * len(_SHARES):
            return None
        lines.append(_line(borders[part][clear[part]]))
    found = np.empty((4, 2))
    for corner in range(4):
        (a, b, c), (d, e, f) = lines[corner - 1], lines[corner]
        slant = a * e - b * d
        if abs(slant) < 0.1:
            return None
        found[corner] = (c * e - b * f) / slant, (a * f - c * d) / slant
    if np.abs(found - corners).max() > 0.15 * lengths.max() + 2:
        return None
    return found.astype(np.float32)


def _line(points: _Points) -> tuple[float, float, float]:
    """Return the line through points: its normal, and how far from the origin it is; points far off do not count."""
    for _ in range(2):
        x, y = points.mean(0).tolist()
        across, down = points[:, 0] - x, points[:, 1] - y
        angle = 0.5 * math.atan2(2 * float(across @ down), float(across @ across - down @ down))
        a, b = -math.sin(angle), math.cos(angle)
        off = np.abs(a * across + b * down)
        points = points[off <= max(2.5 * float(np.median(off)), 0.3)]
    return a, b, a * x + b * y
