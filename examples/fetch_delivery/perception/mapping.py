"""How large the arena is: measured in the first scan, and better with each one after it.

What belongs to the wall and what to the octagon is found without any measure: most of what a laser sees from inside of
a circle lies on it, and what lies near to its middle is the octagon. Later each scan that fits the map also pulls at
it: by as much as the map is unsure.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from examples.fetch_delivery.perception.shape import FLAT, STEP, TURN, Shape, from_panel, from_side

_RADII: Final = (3.0, 12.0)  # metres: what may be a wall
_MIDDLE: Final = 0.4  # of its radius: what lies nearer to its middle may be the octagon
_FIRST: Final = 0.03  # metres: how sure the measures of one scan are
_LEAST: Final = 0.001  # and those of many
_NOISE: Final = 0.05  # of a point; neighbouring beams err alike, so that is more than the laser's own
_WIDTH: Final = 0.15  # what lies farther off a wall does not pull at it


class Survey:
    """The map so far, and how sure it is.

    Attributes:
      shape: the map.
    """

    def __init__(self, shape: Shape) -> None:
        """Begin with what one scan has said."""
        self.shape = shape
        self._covariance: Any = np.diag([_FIRST**2, _FIRST**2])

    def learn(self, points: Any, pose: Any) -> None:
        """Let a scan pull at the map. The pose gives way as well, because it came from the map.

        Args:
          points: of the scan, in the robot's frame.
          pose: in the map.
        """
        off, slopes = self._pull(points, pose)
        if len(off) < 20:
            return
        share = np.minimum(np.abs(off) / _WIDTH, 1.0)
        weighted = slopes * ((1 - share * share) ** 2 / _NOISE**2)[:, None]
        information = weighted.T @ slopes + np.diag([100.0, 100.0, 400.0, 0.0, 0.0])
        information[3:, 3:] += np.linalg.inv(self._covariance)
        step = np.linalg.solve(information, -(weighted.T @ off))[3:]
        self._covariance = np.linalg.inv(information)[3:, 3:] + np.diag([_LEAST**2 / 50] * 2)
        self.shape = Shape(self.shape.radius + float(step[0]), self.shape.octagon + float(step[1]))

    def _pull(self, points: Any, pose: Any) -> tuple[Any, Any]:
        """Return how far points are off their walls, and how that changes with pose, radius and octagon."""
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        arms = points @ np.array([[cos, sin], [-sin, cos]])
        places = arms + pose[:2]
        at = np.arctan2(places[:, 1], places[:, 0])
        inside, outside = self.shape.distances(places)
        walls, sides = np.abs(inside) < _WIDTH, np.abs(outside) < _WIDTH
        return (
            np.concatenate([-inside[walls], outside[sides]]),
            np.concatenate(
                [
                    _slopes((at - from_panel(at))[walls], arms[walls], (-FLAT, 0.0)),
                    _slopes((at - from_side(at))[sides], arms[sides], (0.0, -1.0)),
                ]
            ),
        )


def _slopes(normals: Any, arms: Any, measures: tuple[float, float]) -> Any:
    x, y = np.cos(normals), np.sin(normals)
    turn = y * arms[:, 0] - x * arms[:, 1]
    return np.stack([x, y, turn, np.full(len(x), measures[0]), np.full(len(x), measures[1])], 1)


def first_map(points: Any) -> Shape | None:
    """Measure wall and octagon in one scan; None if it does not show both."""
    circle = _circle(points)
    if circle is None:
        return None
    middle, radius = circle
    octagon = _octagon(points - middle, radius)
    # A polygon is nearer than its corners, by a third of what is between them and the middles of its sides, on average.
    return None if octagon is None else Shape(radius / (1 - (STEP / 2) ** 2 / 3), octagon)


def circle_of(points: Any, radius: float) -> Any:
    """Find the middle of a circle of known radius in the robot's frame; None if the points show none."""
    some = points[:: max(1, len(points) // 90)]
    if len(some) < 12:
        return None
    first, second = np.triu_indices(len(some), 7)
    first, second = first[::7], second[::7]
    chord = some[second] - some[first]
    length = np.hypot(chord[:, 0], chord[:, 1])
    wide = (length > 1.0) & (length < 1.9 * radius)
    chord, length, first = chord[wide], length[wide], first[wide]
    up = np.sqrt(radius**2 - (length / 2) ** 2)[:, None] * np.stack([-chord[:, 1], chord[:, 0]], 1) / length[:, None]
    half = some[first] + chord / 2
    middles = np.concatenate([half + up, half - up])
    best = _likeliest(some, middles, np.full(len(middles), radius))
    if best is None:
        return None
    middle, _ = best
    for _ in range(5):
        rays = points - middle
        far = np.hypot(rays[:, 0], rays[:, 1])
        on = np.abs(far - radius) < 0.1
        if on.sum() < 10:
            return None
        slopes, off = -rays[on] / far[on, None], far[on] - radius
        middle = middle + np.linalg.lstsq(slopes, -off, rcond=None)[0]
    return middle


def _circle(points: Any) -> tuple[Any, float] | None:
    """Find the circle with most of the points on it: its middle and its radius."""
    some = points[:: max(1, len(points) // 90)]
    if len(some) < 12:
        return None
    best = _likeliest(some, *_through_three(some[:: max(1, len(some) // 24)]))
    if best is None:
        return None
    middle, radius = best
    for near in (0.25, 0.15, 0.1, 0.1, 0.1):
        rays = points - middle
        far = np.hypot(rays[:, 0], rays[:, 1])
        on = np.abs(far - radius) < near
        if on.sum() < 20:
            return None
        slopes = np.column_stack([-rays[on] / far[on, None], -np.ones(int(on.sum()))])
        step = np.linalg.lstsq(slopes, radius - far[on], rcond=None)[0]
        middle, radius = middle + step[:2], radius + float(step[2])
    return middle, radius


def _through_three(points: Any) -> tuple[Any, Any]:
    """Return the circles through every three points that are not too near to each other: middles and radii."""
    first, second, third = (points[[*index]] for index in np.array(_threes(len(points))).T)
    one, other = second - first, third - first
    area = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    wide = np.minimum(np.hypot(*one.T), np.hypot(*(third - second).T)) > 1.0
    keep = wide & (np.abs(area) > 0.5)
    one, other, area, first = one[keep], other[keep], area[keep], first[keep]
    squares = (one**2).sum(1), (other**2).sum(1)
    x = (other[:, 1] * squares[0] - one[:, 1] * squares[1]) / (2 * area)
    y = (one[:, 0] * squares[1] - other[:, 0] * squares[0]) / (2 * area)
    radii = np.hypot(x, y)
    return first + np.stack([x, y], 1), radii


def _threes(count: int) -> list[tuple[int, int, int]]:
    return [(a, b, c) for a in range(count) for b in range(a + 2, count) for c in range(b + 2, count)]


def _likeliest(points: Any, middles: Any, radii: Any) -> tuple[Any, float] | None:
    """Return the circle with most points on it, of those around the robot."""
    keep = (radii > _RADII[0]) & (radii < _RADII[1]) & (np.hypot(middles[:, 0], middles[:, 1]) < radii)
    middles, radii = middles[keep], radii[keep]
    if not len(middles):
        return None
    far = np.hypot(middles[:, None, 0] - points[:, 0], middles[:, None, 1] - points[:, 1])
    votes = np.maximum(1 - np.abs(far - radii[:, None]) / 0.08, 0).sum(1)
    best = int(np.argmax(votes))
    return middles[best], float(radii[best])


def _octagon(rays: Any, radius: float) -> float | None:
    """Measure the octagon: turned rightly, most of what is near to the middle is equally far, seen along the sides."""
    far = np.hypot(rays[:, 0], rays[:, 1])
    rays, far = rays[far < _MIDDLE * radius], far[far < _MIDDLE * radius]
    if len(far) < 10:
        return None
    headings = np.arange(0, TURN, math.radians(0.75))
    along = np.sort(far * np.cos(from_side(np.arctan2(rays[:, 1], rays[:, 0]) + headings[:, None])), 1)
    most = round(0.6 * len(far))
    wide = along[:, most:] - along[:, :-most]
    heading, first = np.unravel_index(int(np.argmin(wide)), wide.shape)
    if wide[heading, first] > 0.12:
        return None
    return float(along[heading, first : first + most + 1].mean())
