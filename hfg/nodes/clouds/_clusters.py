"""Euclidean clusters: points that belong together because a chain of near neighbours connects them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval, Unit

from hfg.geometry import PointCloud, Vector3
from hfg.nodes._extras import require
from hfg.nodes.clouds._shaping import cubes
from hfg.nodetypes.functions import node

_MOST_PAIRS = 10_000_000


class Cluster(NamedTuple):
    """Points that belong together.

    Attributes:
      centre: mean of its points, in metres; in the plane at height 0.
      low: least x, y and z.
      high: greatest x, y and z.
      points: how many there are.
    """

    centre: Vector3
    low: Vector3
    high: Vector3
    points: int


@node(outputs={"clusters": list[Cluster], "labelled": PointCloud})
def cluster_points(
    cloud: PointCloud,
    *,
    gap: Annotated[float, Interval(ge=1e-3, le=100), Unit("m")] = 0.3,
    least: Annotated[int, Interval(ge=1)] = 5,
    most: Annotated[int, Interval(ge=1)] = 100_000,
) -> tuple[list[Cluster], PointCloud]:
    """Find Euclidean clusters: groups of points in which each is near to another one of its group.

    Fires once per cloud. Remove the ground first, because it connects everything.

    Args:
      cloud: of the plane or of space.
      gap: points no farther apart than this belong together.
      least: smallest number of points of a cluster.
      most: greatest number of points of a cluster.

    Returns:
      clusters: by number of points, largest first.
      labelled: the cloud with the field "cluster": the number of the cluster in the list, from 0; -1 for none.

    Raises:
      ValueError: coordinates are not finite, or the points are so dense that they must be thinned before.
    """
    cloud.need_finite()
    labels = _labels(cloud.points, gap) if len(cloud) else np.zeros(0, np.int64)
    counts = np.bincount(labels)
    kept = np.flatnonzero((counts >= least) & (counts <= most))
    kept = kept[np.argsort(-counts[kept], kind="stable")]
    numbers = np.full(len(counts), -1, np.int32)
    numbers[kept] = np.arange(len(kept), dtype=np.int32)
    number = numbers[labels] if len(labels) else np.zeros(0, np.int32)
    space = np.zeros((len(cloud), 3))
    space[:, : cloud.points.shape[1]] = cloud.points
    order = np.argsort(number, kind="stable")
    groups = np.split(order, np.searchsorted(number[order], np.arange(len(kept))))[1:]
    with np.errstate(over="ignore"):
        clusters = [
            Cluster(space[group].mean(0), space[group].min(0), space[group].max(0), len(group)) for group in groups
        ]
    return clusters, replace(cloud, fields={**cloud.fields, "cluster": number})


def _labels(points: Any, gap: float) -> Any:
    """Return the number of each point's cluster, numbered by their first points.

    All points of a cube that is much smaller than the gap belong together. So pairs are searched among one point of
    each cube. Where these leave open whether two clusters are one, all points decide, so the result is exact.
    """
    across = gap / 4
    first, cube = cubes(points, across / math.sqrt(points.shape[1]))
    some = points[first]
    pairs = _pairs(some, gap + 2 * across, gap)
    off = some[pairs[:, 0]] - some[pairs[:, 1]]
    near = (off * off).sum(1) <= gap * gap
    label = _components(pairs[near], len(some))
    far = pairs[~near]
    open_cubes = np.zeros(len(some), bool)
    open_cubes[far[label[far[:, 0]] != label[far[:, 1]]]] = True
    left = np.flatnonzero(open_cubes[cube])
    if len(left):
        joined = label[cube[left][_pairs(points[left], gap, gap)]]
        label = _components(joined, int(label.max()) + 1)[label]
    _, begin, number = np.unique(label[cube], return_index=True, return_inverse=True)
    return np.argsort(np.argsort(begin))[number.reshape(-1)]


def _pairs(points: Any, reach: float, gap: float) -> Any:
    """Return all pairs of points that are not farther apart than a distance."""
    crowds = np.bincount(cubes(points, reach)[1]).astype(float)
    if 2 * (crowds * crowds).sum() > _MOST_PAIRS:  # about as many as there would be
        raise ValueError(
            f"the points are too dense for clusters with a gap of {gap:g} m; thin them first, with "
            f"clouds.voxel_grid(side={gap / 2:g})"
        )
    return require("scipy.spatial", "robotics").cKDTree(points).query_pairs(reach, output_type="ndarray")


def _components(joined: Any, count: int) -> Any:
    """Return the number of the component of each of some things of which pairs are joined."""
    sparse, graphs = require("scipy.sparse", "robotics"), require("scipy.sparse.csgraph", "robotics")
    matrix = sparse.coo_matrix((np.ones(len(joined), np.int8), joined.T), shape=(count, count))
    return graphs.connected_components(matrix, directed=False)[1]
