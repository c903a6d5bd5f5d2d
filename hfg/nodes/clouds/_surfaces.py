"""Planes in a cloud, and the ground under it."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval, Unit

from hfg.geometry import PointCloud, Vector3
from hfg.nodetypes.functions import node

_SCORED = 2000  # points by which RANSAC compares planes; all count when the best is fitted


class Plane(NamedTuple):
    """A plane: all points p with normal · p = offset.

    Attributes:
      normal: of length 1; it looks up, or along the first axis along which it is not level.
      offset: from the origin of the frame along the normal, in metres.
      points: how many points lie on it.
      share: how many of all points these are, 0 to 1.
    """

    normal: Vector3
    offset: float
    points: int
    share: float


@node
def fit_plane(
    cloud: PointCloud,
    *,
    tolerance: Annotated[float, Interval(gt=0), Unit("m")] = 0.05,
    tries: Annotated[int, Interval(ge=1, le=5000)] = 100,
    least: Annotated[float, Interval(ge=0, le=1), Unit("1")] = 0.1,
    seed: Annotated[int, Interval(ge=0)] = 0,
) -> Plane | None:
    """Find the plane with most points of a cloud on it, by RANSAC, then fit it to these by least squares.

    Fires once per cloud. The same cloud and seed always give the same plane. After M. Fischler and R. Bolles, Random
    Sample Consensus, Communications of the ACM 24 (1981).

    Args:
      cloud: of space.
      tolerance: how far a point may be off.
      tries: number of planes that are tried; 100 find one that has half of the points, in all but 2 of a million cases.
      least: minimum share of the points; a plane with fewer is not found.
      seed: of the random choice.

    Returns:
      out: silence if there is no such plane, or there are fewer than three points.

    Raises:
      ValueError: the cloud is of the plane, or coordinates are not finite.
    """
    need_space(cloud, "fit_plane")
    points = cloud.points
    if len(points) < 3:
        return None
    random = np.random.default_rng(seed)
    some = points if len(points) <= _SCORED else points[random.choice(len(points), _SCORED, replace=False)]
    with np.errstate(all="ignore"):
        normals, offsets = _through(points[random.integers(0, len(points), (tries, 3))])
        on = np.abs(some @ normals.T - offsets) <= tolerance
        best = int(on.sum(0).argmax())
        normal, offset = normals[best], float(offsets[best])
        for _ in range(3):
            near = np.abs(points @ normal - offset) <= tolerance
            if near.sum() < 3:
                return None
            middle = points[near].mean(0)
            normal = np.linalg.svd(points[near] - middle, full_matrices=False)[2][2]
            offset = float(normal @ middle)
        count = int((np.abs(points @ normal - offset) <= tolerance).sum())
    if count < max(3, least * len(points)):
        return None
    sign = next((math.copysign(1, one) for one in normal[::-1] if abs(one) > 1e-9), 1.0)
    return Plane(sign * normal, sign * offset, count, count / len(points))


def _through(triples: Any) -> tuple[Any, Any]:
    """Return planes through three points each; of points on one line one on which no point lies."""
    normals = np.cross(triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0])
    length = np.linalg.norm(normals, axis=1)
    normals = np.where((length > 1e-9) & np.isfinite(length), normals.T / length, np.nan).T
    return normals, (normals * triples[:, 0]).sum(1)


def need_space(cloud: PointCloud, who: str) -> None:
    """Refuse a cloud of the plane, and one with coordinates that are not finite."""
    if cloud.points.shape[1] != 3:
        raise ValueError(f'{who} needs points of space, got a cloud of the plane in frame "{cloud.frame_id}"')
    cloud.need_finite()


@node(outputs={"on": PointCloud, "off": PointCloud})
def split_plane(
    cloud: PointCloud, plane: Plane, *, tolerance: Annotated[float, Interval(gt=0), Unit("m")] = 0.05
) -> tuple[PointCloud, PointCloud]:
    """Split a cloud into points that lie on a plane and points that do not.

    Fires once per cloud and plane.

    Args:
      cloud: of space.
      plane: in the same frame.
      tolerance: how far a point may be off.

    Returns:
      on: points on the plane.
      off: all others.

    Raises:
      ValueError: the cloud is of the plane, or coordinates are not finite.
    """
    need_space(cloud, "split_plane")
    with np.errstate(all="ignore"):
        on = np.abs(cloud.points @ plane.normal - plane.offset) <= tolerance
    return cloud.select(on), cloud.select(~on)


@node(outputs={"obstacles": PointCloud, "ground": PointCloud})
def split_ground(
    cloud: PointCloud,
    *,
    height: Annotated[float, Interval(ge=-100, le=100), Unit("m")] = 0.0,
    slope: Annotated[float, Interval(ge=0, le=10), Unit("1")] = 0.3,
    clearance: Annotated[float, Interval(gt=0, le=10), Unit("m")] = 0.15,
    bin_size: Annotated[float, Interval(ge=0.05, le=10), Unit("m")] = 0.5,
    reach: Annotated[float, Interval(gt=0, le=500), Unit("m")] = 50.0,
    sectors: Annotated[int, Interval(ge=1, le=3600)] = 72,
) -> tuple[PointCloud, PointCloud]:
    """Remove the ground from a cloud, even if it is not level.

    Fires once per cloud. In each sector around the origin the ground is followed outwards, bin by bin: the lowest point
    of a bin is on the ground if the way there from the last one is not too steep. After M. Himmelsbach et al., Fast
    Segmentation of 3D Point Clouds for Ground Vehicles, IEEE IV (2010), with a step for each bin instead of lines.

    Args:
      cloud: of space, with z up.
      height: of the ground at the origin; for a laser 0.6 m above it, -0.6.
      slope: steepest ground, height for each metre of way.
      clearance: what is less than this above the ground belongs to it.
      bin_size: length of a bin.
      reach: points farther away belong to the last bin.
      sectors: number of sectors.

    Returns:
      obstacles: what is above the ground.
      ground: the rest, and what lies lower.

    Raises:
      ValueError: the cloud is of the plane, or coordinates are not finite.
    """
    need_space(cloud, "split_ground")
    x, y, z = cloud.points.T
    bins = math.ceil(reach / bin_size)
    sector = np.floor((np.arctan2(y, x) + math.pi) / (2 * math.pi) * sectors).astype(np.int64) % sectors
    with np.errstate(over="ignore"):
        place = np.minimum(np.hypot(x, y) / bin_size, bins - 1).astype(np.int64)
    lowest = np.full((bins, sectors), np.inf)
    np.minimum.at(lowest, (place, sector), z)
    ground = np.empty((bins, sectors))
    level, gap = np.full(sectors, height), np.ones(sectors)
    for number, low in enumerate(lowest):
        reached = np.abs(low - level) <= slope * bin_size * gap + clearance
        level, gap = np.where(reached, low, level), np.where(reached, 1, gap + 1)
        ground[number] = level
    # Inside a bin the ground may rise to where it is in the bins around it.
    highest = np.maximum(ground, np.maximum(np.roll(ground, 1, 1), np.roll(ground, -1, 1)))
    highest[1:] = np.maximum(highest[1:], highest[:-1])
    highest[:-1] = np.maximum(highest[:-1], highest[1:])
    above = z > highest[place, sector] + clearance
    return cloud.select(above), cloud.select(~above)
