"""The arena and the pictures of a robot, as scenes of the studio: drawn only while a page shows them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from examples.fetch_delivery import signs
from examples.fetch_delivery.messages import Picture, Scan
from examples.fetch_delivery.perception.records import Sighting
from examples.fetch_delivery.perception.sighting import AHEAD, FOCAL, HEIGHT, MIDDLE
from examples.fetch_delivery.showing.top_view import corners, digit_place
from examples.fetch_delivery.world import Simulation, Station
from examples.fetch_delivery.world.robots import RADIUS_M, Robot
from hfg.panels import Colour, Scene

HALF: Final = 6.35
COLOURS: Final[tuple[Colour, ...]] = ("one", "two", "three", "four")
_RAYS: Final = 6  # of the laser's rays, every sixth is drawn


def arena(simulation: Simulation, scans: Sequence[Scan | None]) -> Scene:
    """Draw the arena from above, with what the lasers have measured last."""
    delivered = sum(len(score.delivered) for score in simulation.scores)
    scene = Scene(-HALF, -HALF, HALF, HALF, caption=f"{simulation.now_s:.1f} s · {delivered} delivered")
    wall, octagon = corners(simulation.arena)
    scene.area(wall, fill="raised", line="soft", width=2)
    for number, (body, scan) in enumerate(zip(simulation.robots, scans, strict=True)):
        if scan is not None:
            _rays(scene, body, scan, COLOURS[number])
    scene.area(octagon, fill="ground", line="soft", width=2)
    for station in simulation.arena.stations:
        _station(scene, station)
    for x, y, radius in simulation.crates():
        _crate(scene, x, y, radius)
    for number, body in enumerate(simulation.robots):
        _robot(scene, body, COLOURS[number], simulation.cube(number))
    for _, station, seconds in simulation.handing_over():
        _operator(scene, station, seconds)
    if simulation.light != 1:
        scene.text(f"light {100 * simulation.light:.0f} %", (HALF - 0.1, HALF - 0.5), 0.42, "soft", anchor="end")
    return scene


def eyes(
    front: Picture | None,
    targets: Iterable[Sighting],
    digits: Iterable[Sighting],
    basket: Picture | None,
    doing: str,
) -> Scene:
    """Draw the last pictures of both cameras, with what was found in them."""
    scene = Scene(0, 480, 968, 0, caption=doing)
    scene.area([(0, 0), (640, 0), (640, 480), (0, 480)], fill="ground")
    scene.area([(648, 0), (968, 0), (968, 240), (648, 240)], fill="ground")
    if front is not None:
        scene.image(front, 0, 480, 640, 0)
        for one in targets:
            _bullseye(scene, one)
        for one in digits:
            _digit(scene, one)
    if basket is not None:
        scene.image(basket, 648, 240, 968, 0)
    scene.text("basket", (648, 275), 34, "soft", anchor="start")
    return scene


def _rays(scene: Scene, body: Robot, scan: Scan, colour: Colour) -> None:
    angles, far = body.theta + scan.angles[::_RAYS], np.minimum(scan.ranges[::_RAYS], 2 * HALF)
    ends = np.stack([body.x + far * np.cos(angles), body.y + far * np.sin(angles)], axis=1)
    scene.rays((body.x, body.y), ends, colour)


def _station(scene: Scene, station: Station) -> None:
    for radius, colour in ((0.17, "ink"), (0.11, "raised"), (0.055, "ink")):
        scene.disc((station.x, station.y), radius, fill=colour)  # type: ignore[arg-type]
    if station.kind == "delivery":
        x, y = digit_place(station)
        scene.text(str(station.number), (0.955 * x, 0.955 * y), 0.5)
    else:
        scene.text(str(station.number), (0.66 * station.x, 0.66 * station.y), 0.4, "soft")


def _crate(scene: Scene, x: float, y: float, radius: float) -> None:
    around = _square(x, y, radius)
    scene.area(around, fill="bad", line="ink")
    scene.line([around[0], around[2]], "ink")
    scene.line([around[1], around[3]], "ink")


def _square(x: float, y: float, half: float) -> list[tuple[float, float]]:
    return [(x + half * dx, y + half * dy) for dx, dy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def _robot(scene: Scene, body: Robot, colour: Colour, cube: int | None) -> None:
    at = (body.x, body.y)
    if body.lamp:
        scene.disc(at, RADIUS_M + 0.13, fill="good")
    scene.disc(at, RADIUS_M, fill=colour, line="bad" if body.contact else "raised", width=3 if body.contact else 1)
    nose = [(body.x + far * math.cos(body.theta), body.y + far * math.sin(body.theta)) for far in (0.28, 0.46)]
    scene.line(nose, colour, width=3)
    if cube is not None:
        scene.area(_square(*at, 0.16), fill="raised")
        scene.text(str(cube), at, 0.28)


def _operator(scene: Scene, station: Station, seconds: float) -> None:
    """Draw a person next to the station, and how long that person still needs."""
    aside = station.facing + math.pi / 2
    x, y = station.x + 0.75 * math.cos(aside), station.y + 0.75 * math.sin(aside)
    scene.disc((x, y + 0.16), 0.11, fill="ink")
    scene.area([(x - 0.2, y - 0.28), (x + 0.2, y - 0.28), (x + 0.14, y + 0.02), (x - 0.14, y + 0.02)], fill="ink")
    scene.text(f"{max(seconds, 0):.0f} s", (x, y - 0.55), 0.34, "ink")


def _bullseye(scene: Scene, one: Sighting) -> None:
    u, v, size = _place(one, signs.BULLSEYE_HEIGHT_M, signs.BULLSEYE_M * signs.RINGS_SHARE)
    scene.disc((u, v), size / 2 + 5, line="one", width=2)
    scene.text(f"{one.distance:.1f} m", (u, v + size / 2 + 30), 30, "one")


def _digit(scene: Scene, one: Sighting) -> None:
    u, v, size = _place(one, signs.DIGIT_HEIGHT_M, signs.DIGIT_M * signs.FRAME_SHARE)
    half = size / 2 + 5
    scene.area(_square(u, v, half), line="two", width=2)
    scene.text(f"{one.label}: {one.distance:.1f} m", (u, v - half - 18), 30, "two")


def _place(one: Sighting, height: float, size: float) -> tuple[float, float, float]:
    """Return where a sign is in the picture, and how large: back the way that perception has come."""
    far = max(one.x - AHEAD, 0.05)
    return MIDDLE[0] - FOCAL * one.y / far, MIDDLE[1] + FOCAL * (HEIGHT - height) / far, FOCAL * size / far
