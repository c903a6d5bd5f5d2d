"""Dubins curves: the shortest ways of a car that drives forwards only, from one pose to another."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

_ROUND = 2 * math.pi


class Curve(NamedTuple):
    """Three arcs or lines in a row.

    Attributes:
      bends: curvature of each, by the radius: 1 is to the left, -1 to the right, 0 straight.
      lengths: of each, in metres.
    """

    bends: tuple[int, int, int]
    lengths: tuple[float, float, float]

    @property
    def length(self) -> float:
        """Of all three."""
        return sum(self.lengths)


def dubins(start: Any, goal: Any, radius: float) -> Curve:
    """Return the shortest Dubins curve.

    L. Dubins, American Journal of Mathematics 79 (1957); the formulas are those of A. Shkel and V. Lumelsky,
    Classification of the Dubins Set, Robotics and Autonomous Systems 34 (2001).

    Args:
      start: x, y and heading.
      goal: x, y and heading.
      radius: of the narrowest turn.
    """
    across, up = float(goal[0] - start[0]), float(goal[1] - start[1])
    bearing = math.atan2(up, across)
    words = _words(math.hypot(across, up) / radius, float(start[2]) - bearing, float(goal[2]) - bearing)
    bends, parts = min(words, key=lambda word: sum(word[1]))
    return Curve(bends, (parts[0] * radius, parts[1] * radius, parts[2] * radius))


def _words(d: float, a: float, b: float) -> Iterator[tuple[tuple[int, int, int], tuple[float, float, float]]]:
    """Yield all words that lead there, in units of the radius: d is the distance, a and b are the headings."""
    sa, sb, ca, cb, cab = math.sin(a), math.sin(b), math.cos(a), math.cos(b), math.cos(a - b)
    # Both turns to one side: for the right, mirror the plane.
    for side, s in ((1, sa - sb), (-1, sb - sa)):
        square = max(0.0, 2 + d * d - 2 * cab + 2 * d * s)
        turn = math.atan2(cb - ca, d + s)
        yield (side, 0, side), ((turn - side * a) % _ROUND, math.sqrt(square), (side * b - turn) % _ROUND)
        share = (6 - d * d + 2 * cab - 2 * d * s) / 8
        if abs(share) <= 1:
            middle = _ROUND - math.acos(share)
            first = (turn - side * a + middle / 2) % _ROUND
            yield (side, -side, side), (first, middle, (side * (b - a) - first + middle) % _ROUND)
    for side, s in ((1, sa + sb), (-1, -sa - sb)):
        square = d * d - 2 + 2 * cab + 2 * d * s
        if square >= 0:
            line = math.sqrt(square)
            turn = math.atan2(-ca - cb, d + s) + math.atan2(2.0, line)
            yield (side, 0, -side), ((turn - side * a) % _ROUND, line, (turn - side * b) % _ROUND)


def driven(start: Any, bends: Any, lengths: Any, radius: float, step: float) -> Any:
    """Return poses on a curve, at most a step apart: x, y and heading of each, with the start and the end.

    Args:
      start: x, y and heading.
      bends: curvature of each part, by the radius.
      lengths: of each part; negative is backwards.
      radius: of the narrowest turn.
      step: in metres.
    """
    poses = [np.array([start], np.float64)]
    for bend, length in zip(bends, lengths, strict=True):
        if abs(length) > 1e-9:
            ways = np.linspace(0, length, max(2, math.ceil(abs(length) / step) + 1))[1:]
            poses.append(moved(poses[-1][-1], bend / radius, ways))
    return np.concatenate(poses)


def moved(pose: Any, curvature: float, ways: Any) -> Any:
    """Return poses after ways on one arc.

    Args:
      pose: x, y and heading.
      curvature: in 1/m.
      ways: in metres; negative is backwards.
    """
    x, y, heading = pose
    turned = heading + curvature * ways
    if curvature == 0:
        return np.stack([x + ways * math.cos(heading), y + ways * math.sin(heading), turned], 1)
    across = (np.sin(turned) - math.sin(heading)) / curvature
    up = (math.cos(heading) - np.cos(turned)) / curvature
    return np.stack([x + across, y + up, turned], 1)
