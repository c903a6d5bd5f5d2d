"""What the laser sees besides the arena's shape: an obstacle, a wall ahead, other robots."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any, Final

import numpy as np
from annotated_types import Ge, Interval
from scipy.ndimage import median_filter

import hfg
from examples.fetch_delivery.messages import Scan
from examples.fetch_delivery.perception.records import Localised, Wall
from examples.fetch_delivery.perception.shape import Shape
from hfg.nodes.robotics import Disk, DiskTracks, find_disks, nearest_obstacle, scan_points

_ROBOT: Final = 0.25  # its radius
_FASTEST: Final = 0.7  # m/s
_WIDE: Final = 0.42  # metres: of a robot's round back no straight piece is that wide


@hfg.node
def smooth_scan(scan: Scan, *, beams: Annotated[int, Interval(ge=1, le=31)] = 5) -> Scan:
    """Take noise out of a scan: each beam becomes the median of its neighbours.

    Args:
      scan: of the laser.
      beams: how many neighbours count, itself included; an odd number.

    Returns:
      out: the scan without single beams that are off.
    """
    return replace(scan, ranges=median_filter(scan.ranges, beams, mode="nearest"))


@hfg.node
def obstacle_ahead(
    scan: Scan,
    *,
    direction: Annotated[float, Interval(ge=-math.pi, le=math.pi)] = 0.0,
    width: Annotated[float, Interval(gt=0, le=2 * math.pi)] = 0.7,
) -> float:
    """Return how far from the robot's centre the nearest thing in a sector is; infinite if there is none.

    Args:
      scan: of the laser.
      direction: of the middle of the sector, counter-clockwise from straight ahead.
      width: of the whole sector.

    Returns:
      out: in metres.
    """
    return nearest_obstacle.function(
        scan.ranges, scan.angles, direction=direction, width=width, max_range=scan.max_range
    )


@hfg.node
def wall_ahead(scan: Scan, *, width: Annotated[float, Interval(gt=0, le=math.pi)] = 0.7) -> Wall | None:
    """Measure the straight wall ahead, through whatever few points stand before it.

    Args:
      scan: of the laser.
      width: of the sector in which it is looked for.

    Returns:
      out: silence if there is no wall, or nothing straight; the back of another robot does not count.
    """
    points = scan_points.function(scan.ranges, scan.angles, max_range=scan.max_range)
    points = points[np.abs(np.arctan2(points[:, 1], points[:, 0])) <= width / 2]
    points = _straightest(points)
    for _ in range(2):
        if len(points) < 6:
            return None
        middle = points.mean(0)
        normal = np.linalg.svd(points - middle)[2][1]
        points = points[np.abs((points - middle) @ normal) <= 0.04]
    if len(points) < 6:
        return None
    distance = float(middle @ normal)
    if distance < 0:
        distance, normal = -distance, -normal
    angle = math.atan2(normal[1], normal[0])
    least = min(_WIDE, 1.7 * math.tan(width / 2) * distance)  # from near by even a wall is not seen wider
    wide = float(np.ptp(points @ np.array([-normal[1], normal[0]])))
    return Wall(distance, angle) if abs(angle) < 1.2 and wide > least else None


def _straightest(points: Any) -> Any:
    """Return the points on the line through two of them that has most points on it."""
    some = points[:: max(1, len(points) // 24)]
    first, second = np.triu_indices(len(some), max(1, len(some) // 4))
    along = some[second] - some[first]
    length = np.hypot(along[:, 0], along[:, 1])
    if not len(length) or length.max() < 0.05:
        return points[:0]
    keep = length >= 0.05
    along, base = along[keep] / length[keep, None], some[first][keep]
    normals = np.stack([-along[:, 1], along[:, 0]], 1)
    on = np.abs(points @ normals.T - (base * normals).sum(1)) <= 0.04
    return points[on[:, int(on.sum(0).argmax())]]


@hfg.node
def other_robots(scan: Scan, localised: Localised) -> list[Disk]:
    """Find other robots: round, and before the walls where nothing should be.

    Args:
      scan: of the laser.
      localised: where the robot was then.

    Returns:
      out: in the map frame, in the order of the beams; empty while the scan does not fit to the pose.
    """
    if not localised.fits:
        return []
    places = foreign(scan, localised)
    disks = find_disks.function(places, localised.pose[None, :2], radius=_ROBOT, tolerance=0.05)
    return [one for one in disks if _is_free(one, localised.shape)]


class FollowRobots(hfg.Node):
    """Follow other robots from scan to scan: how they move, and where they are when the laser does not see them.

    It does not look back, and one robot hides another. Fires once for each list of robots with the scan in which they
    were found.

    Attributes:
      memory: for how long one is kept that cannot be seen.
      seen: robots in the map frame.
      scan: in which they were found.
      localised: where the robot was then.
      others: all that are known, in the map frame.
      around: the same in the robot's own frame, with velocities over the ground.
    """

    memory = hfg.Parameter(4.0, Ge(0), unit="s")
    seen = hfg.Input(list[Disk])
    scan = hfg.Input(Scan)
    localised = hfg.Input(Localised)
    others = hfg.Output(list[Disk])
    around = hfg.Output(list[Disk])

    tracks: hfg.State[Any] = hfg.State(None)

    def setup(self) -> None:
        """Begin with none."""
        self.tracks = DiskTracks(memory=self.memory, fastest=_FASTEST, radius=_ROBOT)

    def process(self, seen: list[Disk], scan: Scan, localised: Localised) -> None:
        """Follow them; while the scan does not fit the pose, their places are unknown."""
        if not localised.fits:
            self.others.send([])
            self.around.send([])
            return
        x, y, theta = map(float, localised.pose)
        others = self.tracks.update(seen, localised.pose, scan.ranges, scan.angles, scan.stamp)
        cos, sin = math.cos(theta), math.sin(theta)
        self.others.send(others)
        self.around.send(
            [
                Disk(
                    cos * (one.x - x) + sin * (one.y - y),
                    cos * (one.y - y) - sin * (one.x - x),
                    one.points,
                    cos * one.vx + sin * one.vy,
                    cos * one.vy - sin * one.vx,
                )
                for one in others
            ]
        )


def foreign(scan: Scan, localised: Localised) -> Any:
    """Return the points of a scan that are not part of the arena, in the map frame, in the order of the beams."""
    points = scan_points.function(scan.ranges, scan.angles, max_range=scan.max_range)
    cos, sin = math.cos(localised.pose[2]), math.sin(localised.pose[2])
    places = points @ np.array([[cos, sin], [-sin, cos]]) + localised.pose[:2]
    inside, outside = localised.shape.distances(places)
    return places[(inside > 0.12) & (outside > 0.12)]


def _is_free(disk: Disk, shape: Shape) -> bool:
    """Say whether a robot could stand there."""
    inside, outside = shape.distances(np.array([disk.x, disk.y]))
    return bool(inside > _ROBOT - 0.1 and outside > _ROBOT - 0.1)
