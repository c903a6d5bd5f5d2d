"""The arena with the ways of the robots, as a drawing in SVG: sharp at any size, and small."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, Final

from examples.fetch_delivery.showing.observing import Seen
from examples.fetch_delivery.showing.top_view import COLOURS, corners, digit_place
from examples.fetch_delivery.world import Simulation, Station

_SIZE: Final = 12.8  # metres
_NEAR: Final = 0.02  # metres: points of a way that are nearer to the last one are left out


def ways(simulation: Simulation, robots: Sequence[Seen]) -> str:
    """Draw where robots really were, where they believed to be, and which signs they have learned."""
    half = _SIZE / 2
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="760" height="{760 * (_SIZE + 0.5) / _SIZE:.0f}" '
        f'viewBox="{-half} {-half} {_SIZE} {_SIZE + 0.5}" font-family="Verdana, DejaVu Sans, sans-serif" '
        'stroke-linejoin="round" stroke-linecap="round">\n'
        f'<rect x="{-half}" y="{-half}" width="{_SIZE}" height="{_SIZE + 0.5}" fill="#f6f8fa"/>\n'
    ]
    wall, octagon = corners(simulation.arena)
    parts.append(f'<polygon points="{_points(wall)}" fill="#e4e8ec" stroke="#828c96" stroke-width="0.06"/>\n')
    parts.append(f'<polygon points="{_points(octagon)}" fill="#f6f8fa" stroke="#828c96" stroke-width="0.04"/>\n')
    for station in simulation.arena.stations:
        parts += _station(station)
    for number, seen in enumerate(robots):
        parts += _robot(_colour(number), seen)
    for number, body in enumerate(simulation.robots):
        nose = (body.x + 0.25 * math.cos(body.theta), body.y + 0.25 * math.sin(body.theta))
        parts.append(
            f'<circle cx="{body.x:.3f}" cy="{0 - body.y:.3f}" r="0.25" fill="{_colour(number)}"/>'
            f'<path d="{_path([(body.x, body.y), nose])}" stroke="#ffffff" stroke-width="0.06"/>\n'
        )
    legend = _legend(half) if any(seen.way for seen in robots) else ()
    return "".join([*parts, *legend, "</svg>\n"])


def _station(station: Station) -> Iterator[str]:
    for radius, colour in ((0.14, "#262c32"), (0.09, "#ffffff"), (0.045, "#262c32")):
        yield f'<circle cx="{station.x:.3f}" cy="{0 - station.y:.3f}" r="{radius}" fill="{colour}"/>'
    if station.kind == "delivery":
        x, y = (0.955 * one for one in digit_place(station))
        yield _text(str(station.number), x, y, 0.42, "#262c32")
    yield "\n"


def _robot(colour: str, seen: Seen) -> Iterator[str]:
    yield f'<path d="{_path(seen.way)}" fill="none" stroke="{colour}" stroke-width="0.05" opacity="0.75"/>\n'
    dashes = 'stroke="#262c32" stroke-width="0.025" stroke-dasharray="0.08 0.08"'
    yield f'<path d="{_path(seen.believed)}" fill="none" {dashes}/>\n'
    if seen.way:
        x, y = seen.way[0]
        yield f'<circle cx="{x:.3f}" cy="{0 - y:.3f}" r="0.09" fill="#ffffff" stroke="{colour}" stroke-width="0.05"/>\n'
    for digit, sign in seen.signs.items():
        x, y = (float(one) for one in seen.in_arena((sign.x, sign.y)))
        radius = max(2 * sign.sigma, 0.08)
        drawn = f'fill="none" stroke="{colour}" stroke-width="0.035"'
        yield f'<circle cx="{x:.3f}" cy="{0 - y:.3f}" r="{radius:.3f}" {drawn}/>'
        far = 1 + 0.24 / max(math.hypot(x, y), 1.0)
        yield _text(str(digit), far * x, far * y, 0.26, colour) + "\n"


def _legend(half: float) -> Iterator[str]:
    y = half + 0.22
    yield f'<path d="M{-half + 0.2} {y} h0.6" stroke="{_colour(0)}" stroke-width="0.05"/>'
    yield _text("where it was", -half + 0.9, -y, 0.24, "#262c32", "start")
    yield f'<path d="M{-half + 3.0} {y} h0.6" stroke="#262c32" stroke-width="0.025" stroke-dasharray="0.08 0.08"/>'
    yield _text("where it believed to be", -half + 3.7, -y, 0.24, "#262c32", "start")
    yield f'<circle cx="{-half + 7.4}" cy="{y}" r="0.1" fill="none" stroke="{_colour(0)}" stroke-width="0.035"/>'
    yield _text("digits as it has learned them", -half + 7.65, -y, 0.24, "#262c32", "start")


def _text(text: str, x: float, y: float, size: float, colour: str, anchor: str = "middle") -> str:
    looks = f'font-size="{size}" text-anchor="{anchor}" fill="{colour}"'
    return f'<text x="{x:.3f}" y="{-y + 0.36 * size:.3f}" {looks}>{text}</text>'


def _points(points: Iterable[Any]) -> str:
    return " ".join(f"{float(x):.3f},{0 - float(y):.3f}" for x, y in points)


def _path(points: Iterable[tuple[float, float]]) -> str:
    """Return a path; it has a gap where a place is not known."""
    parts, last = [], None
    for x, y in points:
        if math.isnan(x):
            last = None
        elif last is None:
            parts.append(f"M{x:.3f} {0 - y:.3f}")
            last = (x, y)
        elif math.hypot(x - last[0], y - last[1]) >= _NEAR:
            parts.append(f"L{x:.3f} {0 - y:.3f}")
            last = (x, y)
    return "".join(parts)


def _colour(number: int) -> str:
    blue, green, red = COLOURS[number]
    return f"#{red:02x}{green:02x}{blue:02x}"
