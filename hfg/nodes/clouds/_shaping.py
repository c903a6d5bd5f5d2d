"""Point clouds: cropped, thinned, flattened."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval, Unit

from hfg.geometry import PointCloud
from hfg.nodetypes.functions import node

Metres = Annotated[float, Unit("m")]


@node
def finite_points(cloud: PointCloud) -> PointCloud:
    """Take points out of a cloud whose coordinates are NaN or infinite, as drivers send them for beams without a hit.

    Fires once per cloud.

    Args:
      cloud: any.
    """
    return cloud.select(np.isfinite(cloud.points).all(1))


@node
def crop_box(
    cloud: PointCloud,
    *,
    x_min: Metres = -10.0,
    x_max: Metres = 10.0,
    y_min: Metres = -10.0,
    y_max: Metres = 10.0,
    z_min: Metres = -10.0,
    z_max: Metres = 10.0,
    outside: bool = False,
) -> PointCloud:
    """Crop a cloud to a box, or cut the box out, such as that of the robot itself.

    Fires once per cloud.

    Args:
      cloud: of the plane or of space; what is not a number is outside.
      x_min: where the box begins.
      x_max: where it ends.
      y_min: where the box begins.
      y_max: where it ends.
      z_min: where the box begins; heights do not count in the plane.
      z_max: where it ends.
      outside: keep what is outside instead.
    """
    count = cloud.points.shape[1]
    low, high = np.array([x_min, y_min, z_min])[:count], np.array([x_max, y_max, z_max])[:count]
    with np.errstate(invalid="ignore"):
        inside = ((cloud.points >= low) & (cloud.points <= high)).all(1)
    return cloud.select(~inside if outside else inside)


@node
def crop_distance(
    cloud: PointCloud,
    *,
    low: Annotated[float, Interval(ge=0), Unit("m")] = 0.3,
    high: Annotated[float, Interval(ge=0), Unit("m")] = 30.0,
) -> PointCloud:
    """Keep only points of a cloud whose distance from the origin of its frame lies between two limits.

    Fires once per cloud.

    Args:
      cloud: what is not a number is taken out.
      low: shortest distance.
      high: longest distance.
    """
    with np.errstate(all="ignore"):
        far = np.hypot(cloud.points[:, 0], cloud.points[:, 1])
        if cloud.points.shape[1] == 3:
            far = np.hypot(far, cloud.points[:, 2])
        return cloud.select((far >= low) & (far <= high))


@node
def flatten_cloud(cloud: PointCloud) -> PointCloud:
    """Drop the heights of a cloud: what was in space is in the plane.

    Fires once per cloud.

    Args:
      cloud: of space, or already of the plane.
    """
    return replace(cloud, points=np.ascontiguousarray(cloud.points[:, :2]))


@node
def voxel_grid(cloud: PointCloud, *, side: Annotated[float, Interval(ge=1e-6, le=1e6), Unit("m")] = 0.1) -> PointCloud:
    """Thin a cloud by a voxel grid: all points in one cube become one, at their mean.

    Fires once per cloud.

    Args:
      cloud: of the plane or of space.
      side: of a cube; in the plane of a square.

    Returns:
      out: one point for each cube that has some, cube by cube; its fields are those of the first point in it.

    Raises:
      ValueError: coordinates are not finite.
    """
    cloud.need_finite()
    if not len(cloud):
        return cloud
    first, cube = cubes(cloud.points, side)
    count = np.bincount(cube)
    # The mean is taken of what lies between the points and the first one of their cube, so that it is exact far away.
    base = cloud.points[first]
    off = cloud.points - base[cube]
    mean = np.stack([np.bincount(cube, weights=axis) / count for axis in off.T], 1)
    return replace(cloud.select(first), points=base + mean)


def cubes(points: Any, side: float) -> tuple[Any, Any]:
    """Return which cube of a grid each point is in: the first point in each cube, and the number of each point's cube.

    Args:
      points: finite, at least one.
      side: of a cube.
    """
    with np.errstate(over="ignore"):
        whole = np.floor(points / side)
    with np.errstate(invalid="ignore", over="ignore"):
        index = whole - whole.min(0)
        spans = index.max(0) + 1
        few = float(np.prod(spans)) < 2**52  # NaN and infinity are not
    if few:
        keys: Any = index @ np.concatenate([np.cumprod(spans[::-1])[-2::-1], [1.0]])
        _, first, cube = np.unique(keys.astype(np.int64), return_index=True, return_inverse=True)
    else:
        _, first, cube = np.unique(whole, axis=0, return_index=True, return_inverse=True)
    return first, cube.reshape(-1)
