"""Drawings in SVG: sharp at any size, and small."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np

from examples.follow_person.messages import Array
from examples.follow_person.perception.records import Scene
from examples.follow_person.world import Course

ROBOT: Final = "#1f77d0"
PERSON: Final = "#d9542b"
_INK: Final = "#262c32"
_SOFT: Final = "#828c96"
_FONT: Final = 'font-family="Verdana, DejaVu Sans, sans-serif"'
_HEAD: Final = '<svg xmlns="http://www.w3.org/2000/svg"'


def course_map(course: Course, robot: Array, person: Array, believed: Array, lost: Iterable[Array] = ()) -> str:
    """Draw trees and bushes, where robot and person were, and where the robot believed to be.

    Args:
      course: with its trees.
      robot: rows of x and y.
      person: the same.
      believed: the same, laid so that it begins where the robot began.
      lost: places where the robot has lost the person.
    """
    both = np.vstack([robot, person])
    low, high = both.min(0) - 9, both.max(0) + 9
    wide, tall = high - low
    parts = [
        f'{_HEAD} width="820" height="{820 * (tall + 5) / wide:.0f}" {_FONT} '
        f'viewBox="{low[0]:.2f} {-high[1]:.2f} {wide:.2f} {tall + 5:.2f}">',
        f'<rect x="{low[0]:.2f}" y="{-high[1]:.2f}" width="{wide:.2f}" height="{tall + 5:.2f}" fill="#eef2ea"/>',
    ]
    for x, y, radius, height in course.trunks.tolist():
        if low[0] < x < high[0] and low[1] < y < high[1]:
            colour = "#6b4f37" if height > 2 else "#5f8a4e"
            parts.append(f'<circle cx="{x:.2f}" cy="{-y:.2f}" r="{radius:.2f}" fill="{colour}"/>')
    line = max(0.12, wide / 700)
    parts.append(_line(person, PERSON, line))
    parts.append(_line(robot, ROBOT, line))
    dash = f'stroke-dasharray="{4 * line:.2f} {4 * line:.2f}"'
    parts.append(_line(believed, _INK, line / 2, dash))
    for x, y in lost:
        parts.append(
            f'<circle cx="{x:.2f}" cy="{-y:.2f}" r="{8 * line:.2f}" '
            f'fill="none" stroke="#b00" stroke-width="{line:.2f}"/>'
        )
    size, y = max(wide / 55, 0.8), -low[1] + 2.5
    x = low[0] + size
    for says, colour in (("person", PERSON), ("robot", ROBOT), ("where the robot believed to be", _INK)):
        parts.append(f'<text x="{x:.2f}" y="{y:.2f}" font-size="{size:.2f}" fill="{colour}">{says}</text>')
        x += size * (len(says) * 0.62 + 1.5)
    parts.append(_scale(x, y, size))
    return "".join([*parts, "</svg>\n"])


def _scale(x: float, y: float, size: float) -> str:
    return (
        f'<path d="M{x:.2f} {y:.2f} h10" stroke="{_INK}" stroke-width="{size / 5:.2f}"/>'
        f'<text x="{x + 10.5:.2f}" y="{y:.2f}" font-size="{size:.2f}" fill="{_INK}">10 m</text>'
    )


def _line(points: Array, colour: str, width: float, more: str = "") -> str:
    kept = points[np.isfinite(points).all(1)]
    path = " ".join(f"{x:.2f},{0 - y:.2f}" for x, y in kept.tolist())
    return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width:.3f}" {more}/>'


def curves(times: Array, distances: Array, robot: Array, person: Array, limits: tuple[float, float]) -> str:
    """Draw distance and speeds over time, below each other.

    Args:
      times: in seconds.
      distances: between robot and person.
      robot: its speed.
      person: the person's speed.
      limits: between which the distance should be.
    """
    end = max(float(times[-1]), 1.0)
    most = max(9.0, float(distances.max()) * 1.05)
    fastest = max(2.8, float(np.abs(robot).max()) * 1.05)
    parts = [f'{_HEAD} width="820" height="430" viewBox="0 0 820 430" {_FONT}>']
    parts.append('<rect width="820" height="430" fill="#ffffff"/>')
    parts += _axes(30, 170, "distance, m", range(0, math.ceil(most), 2), most, end)
    for limit in limits:
        y = 200 - 170 * limit / most
        parts.append(f'<path d="M50 {y:.1f} H800" stroke="#b00" stroke-width="1" stroke-dasharray="4 4"/>')
    parts.append(_curve(times / end, distances / most, 30, 170, _INK))
    parts += _axes(240, 150, "speed, m/s", (0, 1, 2), fastest, end)
    parts.append(_curve(times / end, person / fastest, 240, 150, PERSON))
    parts.append(_curve(times / end, np.maximum(robot, 0) / fastest, 240, 150, ROBOT))
    parts.append(f'<text x="700" y="236" font-size="12" fill="{ROBOT}">robot</text>')
    parts.append(f'<text x="750" y="236" font-size="12" fill="{PERSON}">person</text>')
    return "".join([*parts, "</svg>\n"])


def _axes(top: float, high: float, title: str, ticks: Iterable[int], most: float, end: float) -> Iterable[str]:
    yield f'<text x="50" y="{top - 6:.0f}" font-size="12" fill="{_INK}">{title}</text>'
    for tick in ticks:
        y = top + high * (1 - tick / most)
        yield f'<path d="M50 {y:.1f} H800" stroke="#e4e8ec"/>'
        yield f'<text x="44" y="{y + 4:.1f}" font-size="11" text-anchor="end" fill="{_SOFT}">{tick}</text>'
    for part in range(5):
        x = 50 + 750 * part / 4
        says = f"{end * part / 4:.0f} s"
        at = f'x="{x:.0f}" y="{top + high + 16:.0f}" font-size="11" text-anchor="middle"'
        yield f'<text {at} fill="{_SOFT}">{says}</text>'


def _curve(times: Any, values: Any, top: float, high: float, colour: str) -> str:
    step = max(1, len(times) // 1500)
    points = " ".join(
        f"{50 + 750 * t:.1f},{top + high * (1 - v):.1f}"
        for t, v in zip(times[::step].tolist(), values[::step].tolist(), strict=True)
    )
    return f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.2"/>'


def moment(scene: Scene, obstacles: Array, followed: Any, path: Any, reach: float = 12.0) -> str:
    """Draw one moment from above, in the robot's frame with ahead on top: obstacles, tracks, the person, the path.

    Args:
      scene: with the tracks.
      obstacles: points in the robot's frame.
      followed: the person; None if there is none.
      path: that is followed; None if there is none.
      reach: how much is drawn.
    """
    parts = [
        f'{_HEAD} width="420" height="420" viewBox="{-reach} {-reach} {2 * reach} {2 * reach}" {_FONT}>',
        f'<rect x="{-reach}" y="{-reach}" width="{2 * reach}" height="{2 * reach}" fill="#ffffff"/>',
    ]
    dots = "".join(f"M{0 - y:.2f} {0 - x:.2f}h.01" for x, y in obstacles.tolist())
    parts.append(f'<path d="{dots}" stroke="#c0392b" stroke-width="0.1" stroke-linecap="round"/>')
    for one in scene.tracks:
        x, y = scene.seen_from_robot(one.x, one.y)
        parts.append(
            f'<circle cx="{0 - y:.2f}" cy="{0 - x:.2f}" r="0.35" fill="none" stroke="{_SOFT}" stroke-width="0.06"/>'
        )
    if path is not None:
        points = [scene.seen_from_robot(x, y) for x, y in path.points.tolist()]
        parts.append(_line(np.array([(-y, x) for x, y in points]), ROBOT, 0.1))
    if followed is not None:
        parts.append(_arrow(scene, followed))
    parts.append(f'<rect x="-0.3" y="-0.36" width="0.6" height="0.72" fill="{ROBOT}"/></svg>\n')
    return "".join(parts)


def _arrow(scene: Scene, person: Any) -> str:
    """Draw the person as an arrow whose length is the speed (figure 21)."""
    x, y = scene.seen_from_robot(person.x, person.y)
    far_x, far_y = scene.seen_from_robot(person.x + person.vx, person.y + person.vy)
    return (
        f'<circle cx="{0 - y:.2f}" cy="{0 - x:.2f}" r="0.4" fill="{PERSON}"/>'
        f'<path d="M{0 - y:.2f} {0 - x:.2f} L{0 - far_y:.2f} {0 - far_x:.2f}" stroke="{PERSON}" stroke-width="0.2"/>'
    )


def points_of(rows: Sequence[Sequence[float]]) -> Array:
    """Return rows of x and y as an array, even if there are none."""
    return np.array(rows, np.float64).reshape(-1, 2)
