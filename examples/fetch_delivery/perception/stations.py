"""Where cubes are inserted and removed: sides of the octagon, and places on the wall, that bear a bull's-eye."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import hfg
from examples.fetch_delivery.messages import Scan
from examples.fetch_delivery.perception.records import Localised, Sighting, Station, wrapped
from examples.fetch_delivery.perception.shape import TURN, Shape
from examples.fetch_delivery.perception.signs import landmark
from hfg.nodes.robotics import LandmarkMixture, scan_points


@hfg.node
def octagon_sides(scan: Scan, localised: Localised) -> list[Station]:
    """Find the sides of the octagon that a scan shows, each where it was measured.

    Args:
      scan: of the laser.
      localised: where the robot was then.

    Returns:
      out: the middle of each side of which at least half was seen, and where it looks.
    """
    points = scan_points.function(scan.ranges, scan.angles, max_range=scan.max_range)
    cos, sin = math.cos(localised.pose[2]), math.sin(localised.pose[2])
    places = points @ np.array([[cos, sin], [-sin, cos]]) + localised.pose[:2]
    _, outside = localised.shape.distances(places)
    places = places[np.abs(outside) < 0.12]
    sides = np.round(np.arctan2(places[:, 1], places[:, 0]) / TURN).astype(int) % 8
    found = []
    for side in range(8):
        theta = side * TURN
        normal, along = np.array([math.cos(theta), math.sin(theta)]), np.array([-math.sin(theta), math.cos(theta)])
        on = places[sides == side]
        at = on @ along
        if len(on) < 6 or np.ptp(at) < 0.5:
            continue
        slope, offset = np.polyfit(at, on @ normal, 1)
        middle = offset * normal
        looks = float(wrapped(theta - math.atan(slope)))
        found.append(Station(float(middle[0]), float(middle[1]), looks))
    return found


class StationMap(hfg.Node):
    """Learn where the stations are, from bull's-eyes.

    Fires once for each list of sightings with the pose of its time. Filling stations are on every second side of the
    octagon: where one was seen often enough all four are known. While the pose is in doubt nothing is learned.

    Attributes:
      least: number of sightings that make a station known.
      targets: bull's-eyes in the robot's frame.
      localised: where the robot was then.
      filling: the filling stations, counter-clockwise; empty as long as none was seen.
      delivery: bull's-eyes on the wall, counter-clockwise; whose they are, the digits say.
    """

    least = hfg.Parameter(2)
    targets = hfg.Input(list[Sighting])
    localised = hfg.Input(Localised)
    filling = hfg.Output(list[Station])
    delivery = hfg.Output(list[Station])

    sides: hfg.State[Any] = hfg.State(None)
    walls: hfg.State[Any] = hfg.State(None)

    def setup(self) -> None:
        """Begin with no stations."""
        self.sides, self.walls = np.zeros(8, int), LandmarkMixture()

    def process(self, targets: list[Sighting], localised: Localised) -> None:
        """Learn, and tell what is known."""
        if localised.sure:
            for one in targets:
                self._learn(one, localised)
        self.filling.send(self._filling(localised.shape))
        self.delivery.send(self._delivery(localised.shape))

    def _learn(self, one: Sighting, localised: Localised) -> None:
        seen = landmark(one, localised)
        far, at = math.hypot(seen.x, seen.y), math.atan2(seen.y, seen.x)
        if abs(far - localised.shape.octagon) < 0.35:
            side = round(at / TURN)
            if abs(at - side * TURN) * far < 0.25:
                self.sides[side % 8] += 1
        elif abs(far - localised.shape.apothem) < 0.5:
            # They all look the same, so each is called by its part of the wall.
            self.walls.learn(seen._replace(label=f"{round(at / TURN) % 8}"))

    def _filling(self, shape: Shape) -> list[Station]:
        parity = int(self.sides[1::2].sum() > self.sides[0::2].sum())
        if self.sides[parity::2].max() < self.least:
            return []
        return [Station.side(shape, side, int(self.sides[side])) for side in range(parity, 8, 2)]

    def _delivery(self, shape: Shape) -> list[Station]:
        known = self.walls.known(float(self.least)).values()
        return [Station(*shape.on_wall(math.atan2(one.y, one.x)), int(one.sightings)) for one in known]
