"""Scans of lasers: made, filtered, turned into clouds and back. A beam that is taken out has an infinite range."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval, MinLen, Unit

from hfg.base.clock import now
from hfg.geometry import LaserScan, PointCloud, RingScan
from hfg.nodes.robotics import Ranges
from hfg.nodetypes.functions import node

Metres = Annotated[float, Interval(ge=0), Unit("m")]
Angle = Annotated[float, Interval(ge=-2 * math.pi, le=2 * math.pi), Unit("rad")]


@node
def make_scan(
    ranges: Ranges,
    *,
    frame_id: Annotated[str, MinLen(1)] = "laser",
    start_angle: Angle = -math.pi,
    step: Annotated[float, Interval(ge=-1, le=1), Unit("rad")] = math.pi / 360,
    min_range: Metres = 0.0,
    max_range: Annotated[float, Interval(gt=0), Unit("m")] = 30.0,
) -> LaserScan:
    """Make a scan of the ranges that a laser driver gives, measured now.

    Fires once per set of ranges.

    Args:
      ranges: how far each beam went, in metres.
      frame_id: the frame of the laser.
      start_angle: of the first beam, from straight ahead, counter-clockwise.
      step: from beam to beam; negative if the laser turns clockwise.
      min_range: what is nearer is not measured.
      max_range: what is not nearer is not measured.
    """
    return LaserScan(frame_id, now(), ranges, start_angle, step, min_range, max_range)


@node(outputs={"ranges": Ranges, "angles": Ranges})
def ranges_and_angles(scan: LaserScan) -> tuple[Any, Any]:
    """Take a scan apart, for nodes that work on ranges and angles.

    Fires once per scan.

    Args:
      scan: of a laser.

    Returns:
      ranges: how far each beam went, in metres; infinite if it hit nothing.
      angles: angles of the beams, in radians, counter-clockwise from straight ahead.
    """
    return np.where(scan.hits, scan.ranges, math.inf), scan.angles


@node
def scan_to_cloud(scan: LaserScan) -> PointCloud:
    """Turn a laser scan into a point cloud of the plane.

    Fires once per scan.

    Args:
      scan: of a laser.

    Returns:
      out: in the frame of the laser, in the order of the beams; without those that hit nothing.
    """
    hit = scan.hits
    far, at = scan.ranges[hit], scan.angles[hit]
    return PointCloud(scan.frame_id, scan.stamp, np.stack([far * np.cos(at), far * np.sin(at)], 1))


@node
def rings_to_cloud(scan: RingScan) -> PointCloud:
    """Turn a scan of a laser with several rings, such as a VLP-16 or another 3-D lidar, into a point cloud.

    Fires once per scan.

    Args:
      scan: a row of ranges for each ring.

    Returns:
      out: in the frame of the laser, ring by ring, with the field "ring"; without beams that hit nothing.
    """
    ring, column = np.nonzero(_hits(scan))
    far = scan.ranges[ring, column]
    angles = scan.start_angle + scan.step * np.arange(scan.ranges.shape[1])
    level = np.cos(scan.elevations)[ring] * far
    points = np.empty((len(far), 3))
    points[:, 0] = level * np.cos(angles)[column]
    points[:, 1] = level * np.sin(angles)[column]
    points[:, 2] = np.sin(scan.elevations)[ring] * far
    return PointCloud(scan.frame_id, scan.stamp, points, {"ring": ring.astype(np.uint16)})


def _hits(scan: RingScan) -> Any:
    with np.errstate(invalid="ignore"):
        return (scan.ranges > 0) & (scan.ranges >= scan.min_range) & (scan.ranges < scan.max_range)


@node
def cloud_to_scan(
    cloud: PointCloud,
    *,
    beams: Annotated[int, Interval(ge=1, le=100_000)] = 720,
    start_angle: Angle = -math.pi,
    width: Annotated[float, Interval(gt=0, le=2 * math.pi), Unit("rad")] = 2 * math.pi,
    lowest: Annotated[float, Unit("m")] = -math.inf,
    highest: Annotated[float, Unit("m")] = math.inf,
    min_range: Metres = 0.0,
    max_range: Annotated[float, Interval(gt=0), Unit("m")] = 30.0,
) -> LaserScan:
    """Turn a point cloud into a laser scan: the nearest point in the direction of each beam.

    Fires once per cloud.

    Args:
      cloud: of the plane or of space; what is not a number is left out.
      beams: number of beams.
      start_angle: of the first beam.
      width: of the whole scan, counter-clockwise; each beam is as wide as one part of it, with its angle in the middle.
      lowest: what is lower is left out.
      highest: what is higher is left out.
      min_range: what is nearer is left out.
      max_range: what is not nearer is left out.

    Returns:
      out: infinite where nothing is.
    """
    points = cloud.points[np.isfinite(cloud.points).all(1)]
    if points.shape[1] == 3:
        points = points[(points[:, 2] >= lowest) & (points[:, 2] <= highest)]
    far = np.hypot(points[:, 0], points[:, 1])
    step = width / beams
    turned = np.remainder(np.arctan2(points[:, 1], points[:, 0]) - start_angle + step / 2, 2 * math.pi)
    beam = np.floor(turned / step).astype(np.int64)
    kept = (beam < beams) & (far >= min_range) & (far < max_range) & (far > 0)
    ranges = np.full(beams, np.inf)
    np.minimum.at(ranges, beam[kept], far[kept])
    return LaserScan(cloud.frame_id, cloud.stamp, ranges, start_angle, step, min_range, max_range)


def _without(scan: LaserScan, wrong: Any) -> LaserScan:
    return replace(scan, ranges=np.where(wrong, np.inf, scan.ranges))


@node
def filter_scan_ranges(scan: LaserScan, *, low: Metres = 0.1, high: Metres = 10.0) -> LaserScan:
    """Keep only beams of a scan whose range lies between two limits.

    Fires once per scan.

    Args:
      scan: of a laser.
      low: shortest range.
      high: longest range.

    Returns:
      out: the other beams have hit nothing.
    """
    with np.errstate(invalid="ignore"):
        return _without(scan, ~((scan.ranges >= low) & (scan.ranges <= high)))


@node
def filter_scan_angles(scan: LaserScan, *, first: Angle = -math.pi / 2, last: Angle = math.pi / 2) -> LaserScan:
    """Keep only beams of a scan whose direction lies in a sector, such as those that the robot itself does not block.

    Fires once per scan.

    Args:
      scan: of a laser.
      first: where the sector begins, from straight ahead, counter-clockwise.
      last: where it ends; if it is a whole turn after the start, or more, all beams are kept.

    Returns:
      out: the other beams have hit nothing.
    """
    if last - first >= 2 * math.pi:
        return scan
    width = np.remainder(last - first, 2 * math.pi)
    off = np.remainder(scan.angles - first, 2 * math.pi)
    return _without(scan, (off > width + 1e-9) & (off < 2 * math.pi - 1e-9))


@node
def filter_scan_shadows(
    scan: LaserScan,
    *,
    angle: Annotated[float, Interval(ge=0, le=math.pi / 2), Unit("rad")] = math.radians(10),
    window: Annotated[int, Interval(ge=1, le=100)] = 1,
) -> LaserScan:
    """Take out shadows of a scan: points in the air between an edge and what is farther away.

    Fires once per scan. If the line from a point to a neighbour hardly differs from the beam, the farther of the two is
    taken out. This is the criterion of the ScanShadowsFilter in ROS's laser_filters.

    Args:
      scan: of a laser.
      angle: between beam and line; below it, there is a shadow.
      window: how many beams on each side are neighbours.

    Returns:
      out: beams that were taken out have hit nothing.
    """
    far, hit = scan.ranges, scan.hits
    wrong = np.zeros(len(far), bool)
    for apart in range(1, min(window, len(far) - 1) + 1):
        turn = abs(scan.step) * apart
        both = hit[:-apart] & hit[apart:]
        here, there = np.where(both, far[:-apart], 1.0), np.where(both, far[apart:], 1.0)
        across = np.arctan2(there * math.sin(turn), here - there * math.cos(turn))
        shadow = both & ((across < angle) | (across > math.pi - angle))
        wrong[:-apart] |= shadow & (here > there)
        wrong[apart:] |= shadow & (there > here)
    return _without(scan, wrong)


@node
def filter_scan_median(scan: LaserScan, *, window: Annotated[int, Interval(ge=1, le=101)] = 5) -> LaserScan:
    """Smooth a scan: each range becomes the median of its neighbours, which removes single outliers.

    Fires once per scan. Beams that hit nothing do not count and stay as they are.

    Args:
      scan: of a laser.
      window: how many beams count, with the one in the middle; an even number is taken as the next odd one.
    """
    if not len(scan.ranges):
        return scan
    half, hit = window // 2, scan.hits
    padded = np.pad(np.where(hit, scan.ranges, np.nan), half, constant_values=np.nan)
    around = np.sort(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), axis=1)  # NaN come last
    count = np.maximum(np.isfinite(around).sum(1), 1)
    rows = np.arange(len(around))
    median = (around[rows, (count - 1) // 2] + around[rows, count // 2]) / 2
    return replace(scan, ranges=np.where(hit, median, scan.ranges))
