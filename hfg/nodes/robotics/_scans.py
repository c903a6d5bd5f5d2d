"""Scans of a laser: points, what is nearest, what a known map does not explain, round things."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from annotated_types import Interval, Unit

from hfg.nodetypes.functions import node
from hfg.types import Named, Shape

Ranges: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(None), Named("Ranges")]
"""One number for each beam of a laser."""

Pose: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(3), Named("Pose")]
"""Where something is in the plane: x, y in metres, and its heading in radians, counter-clockwise from the x axis."""

Positions: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(None, 2), Named("Positions")]
"""Points of the plane, one row of x and y in metres for each."""

Segments: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(None, 2, 2), Named("Segments")]
"""Walls of a map: for each its two ends, of x and y in metres."""


class Disk(NamedTuple):
    """Something round.

    Attributes:
      x: of its middle, in metres.
      y: of its middle.
      points: on how many points that stands.
      vx: how fast it moves along x, in m/s; 0 until it has been tracked.
      vy: how fast along y.
    """

    x: float
    y: float
    points: int
    vx: float = 0.0
    vy: float = 0.0


@node
def scan_points(
    ranges: Ranges, angles: Ranges, *, max_range: Annotated[float, Interval(gt=0), Unit("m")] = 30.0
) -> Positions:
    """Return the points that a laser has hit, in the frame of the laser: x ahead, y to the left.

    Fires once per scan. A beam that has hit nothing has no point: its range is `max_range` or more, not a number, or
    not above 0.

    Args:
      ranges: how far each beam went, in metres.
      angles: angles of the beams, in radians, counter-clockwise from straight ahead.
      max_range: how far the laser sees.

    Returns:
      out: in the order of the beams.

    Raises:
      ValueError: there are more or fewer angles than ranges.
    """
    hit = _hits(ranges, angles, max_range)
    far, at = ranges[hit], angles[hit]
    return np.stack([far * np.cos(at), far * np.sin(at)], 1)


@node
def nearest_obstacle(
    ranges: Ranges,
    angles: Ranges,
    *,
    direction: Annotated[float, Interval(ge=-math.pi, le=math.pi), Unit("rad")] = 0.0,
    width: Annotated[float, Interval(gt=0, le=2 * math.pi), Unit("rad")] = 0.7,
    max_range: Annotated[float, Interval(gt=0), Unit("m")] = 30.0,
) -> float:
    """Return how far it is to what is nearest in a sector.

    Fires once per scan.

    Args:
      ranges: how far each beam went, in metres.
      angles: angles of the beams, in radians, counter-clockwise from straight ahead.
      direction: where the middle of the sector points.
      width: of the whole sector, in radians.
      max_range: how far the laser sees.

    Returns:
      out: in metres; infinite if no beam of the sector has hit anything.

    Raises:
      ValueError: there are more or fewer angles than ranges.
    """
    hit = _hits(ranges, angles, max_range)
    off = np.abs(np.remainder(angles[hit] - direction + math.pi, 2 * math.pi) - math.pi)
    inside = ranges[hit][off <= width / 2]
    return float(inside.min()) if len(inside) else math.inf


def need_pairs(ranges: Any, angles: Any) -> None:
    """Refuse a scan in which they do not belong together."""
    if len(ranges) != len(angles):
        raise ValueError(f"each range has an angle, got {len(ranges)} ranges and {len(angles)} angles")


def _hits(ranges: Any, angles: Any, max_range: float) -> Any:
    need_pairs(ranges, angles)
    with np.errstate(invalid="ignore"):
        return (ranges > 0) & (ranges < max_range) & np.isfinite(angles)


def seen_from(points: Any, pose: Any) -> Any:
    """Return where points of a robot's frame are in the frame of its pose."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return points @ np.array([[cos, sin], [-sin, cos]]) + np.asarray(pose[:2])


@node
def expected_ranges(
    pose: Pose,
    angles: Ranges,
    segments: Segments,
    *,
    max_range: Annotated[float, Interval(gt=0), Unit("m")] = 30.0,
) -> Ranges:
    """Return what a laser would measure if nothing were there but the walls of a map.

    Fires once per pose. What is measured nearer than that is something else; what is measured farther away says that
    the pose or the map is wrong.

    Args:
      pose: pose of the laser in the map.
      angles: angles of the beams, in radians, counter-clockwise from straight ahead.
      segments: the walls.
      max_range: how far the laser sees.

    Returns:
      out: one for each beam; `max_range` where no wall is.
    """
    if not len(segments) or not len(angles):
        return np.full(len(angles), max_range)
    heading = pose[2] + angles
    across, up = np.cos(heading)[:, None], np.sin(heading)[:, None]
    start = segments[:, 0] - pose[:2]
    along = segments[:, 1] - segments[:, 0]
    with np.errstate(all="ignore"):
        slope = across * along[:, 1] - up * along[:, 0]
        far = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / slope
        share = (start[:, 0] * up - start[:, 1] * across) / slope
        # A beam through the end of a wall meets it: two walls that touch there leave no gap.
        meets = (far > 0) & (share >= -1e-9) & (share <= 1 + 1e-9)
    nearest: Ranges = np.minimum(np.where(meets, far, max_range).min(1), max_range)
    return nearest


@node
def find_disks(
    points: Positions,
    seen_from: Positions | None = None,
    *,
    radius: Annotated[float, Interval(gt=0), Unit("m")] = 0.25,
    gap: Annotated[float, Interval(gt=0), Unit("m")] = 0.15,
    least: Annotated[int, Interval(ge=2)] = 3,
    tolerance: Annotated[float, Interval(gt=0), Unit("m")] = 0.04,
) -> list[Disk]:
    """Find round things of a known size among the points of a scan.

    Fires once per set of points. Points that follow each other closely belong together; a circle is fitted to each such
    group, on its far side as seen by the laser.

    Args:
      points: in the order of the beams, without those that belong to something known.
      seen_from: where the laser is, one point; without this input it is at the origin.
      radius: of what is looked for, in metres.
      gap: how far neighbouring points of one thing are apart at most, in metres.
      least: minimum number of points of one.
      tolerance: how far the points may lie off the circle, root of the mean of squares, in metres.

    Returns:
      out: in the order of the beams.

    Raises:
      ValueError: there is not exactly one point in `seen_from`.
    """
    if seen_from is not None and len(seen_from) != 1:
        raise ValueError(f"a laser is at one place, got {len(seen_from)}")
    laser = np.zeros(2) if seen_from is None else seen_from[0]
    points = points[np.isfinite(points).all(1)]
    apart = np.hypot(*np.diff(points, axis=0).T) > gap if len(points) else np.zeros(0, bool)
    found = []
    for group in np.split(points, np.flatnonzero(apart) + 1):
        if len(group) >= least:
            middle = _behind(group, laser, radius, tolerance)
            if middle is not None:
                found.append(Disk(float(middle[0]), float(middle[1]), len(group)))
    return found


def _behind(group: Any, laser: Any, radius: float, tolerance: float) -> Any:
    """Lay a circle of a known radius through points, by a few steps of Gauss and Newton; None if it does not fit."""
    towards = group.mean(0) - laser
    length = float(np.hypot(*towards))
    if length == 0:
        return None
    middle = group.mean(0) + towards / length * radius * 0.8
    for _ in range(8):
        rays = group - middle
        far = np.hypot(rays[:, 0], rays[:, 1])
        if far.min() < 1e-6:
            return None
        slopes, off = -rays / far[:, None], far - radius
        # A few points on a short arc hardly say where the circle is sideways; there the first guess counts a little.
        step = np.linalg.solve(slopes.T @ slopes + 1e-3 * np.eye(2), -slopes.T @ off)
        middle = middle + step
        if np.abs(step).max() < 1e-4:
            break
    rays = group - middle
    off = np.hypot(rays[:, 0], rays[:, 1]) - radius
    behind = (middle - laser) @ towards > length * length
    fits = float(np.sqrt(np.mean(off**2))) <= tolerance
    return middle if fits and behind else None
