"""Euclidean clusters: points that belong together because a chain of near neighbours connects them."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval, Unit

from hfg.geometry import PointCloud, Vector3
from hfg.nodes._extras import require
from hfg.nodetypes.functions import node

_MOST_CELLS = 2.0**62
_FEW = 5000  # pairs of points that are compared one by one
_TABLE = 4_000_000  # cells of which a table is faster than a search


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
      ValueError: coordinates are not finite, or there are millions of points, all of them far apart.
    """
    cloud.need_finite()
    if not len(cloud):
        return [], replace(cloud, fields={**cloud.fields, "cluster": np.zeros(0, np.int32)})
    labels = _labels(cloud.points, gap)
    counts = np.bincount(labels)
    kept = np.flatnonzero((counts >= least) & (counts <= most))
    kept = kept[np.argsort(-counts[kept], kind="stable")]
    numbers = np.full(len(counts), -1, np.int32)
    numbers[kept] = np.arange(len(kept), dtype=np.int32)
    number = numbers[labels]
    return _clusters(cloud.points, number, counts[kept]), replace(cloud, fields={**cloud.fields, "cluster": number})


def _clusters(points: Any, number: Any, counts: Any) -> list[Cluster]:
    """Measure clusters, of which each point has the number, or -1."""
    if not len(counts):
        return []
    space = np.zeros((len(points), 3))
    space[:, : points.shape[1]] = points
    some = space[np.argsort(number, kind="stable")[-counts.sum() :]]
    begin = np.cumsum(counts) - counts
    with np.errstate(over="ignore"):
        parts = [one.reduceat(some, begin) for one in (np.add, np.minimum, np.maximum)]
        parts[0] /= counts[:, None]
    return [Cluster(mean, low, high, count) for mean, low, high, count in zip(*parts, counts.tolist(), strict=True)]


def _labels(points: Any, gap: float) -> Any:
    """Return the number of each point's cluster, numbered by their first points.

    Space is cut into cells whose diagonal is the gap, so all points of a cell belong together, and only cells that are
    at most two apart can be joined. If the first points of two cells are near enough, they are; where these leave open
    whether two clusters are one, all points of the two cells decide. So the result is exact.
    """
    cells = _Cells(points, gap)
    first, label = cells.points[cells.begin], np.arange(len(cells.begin))
    for reach in (1, 2):  # most of what belongs together already does by cells that touch
        one, other = cells.neighbours(reach)
        open_ = label[one] != label[other]
        one, other = one[open_], other[open_]
        near = _squares(first[one] - first[other]) <= gap * gap
        label = _joined(label, one[near], other[near])
    left = np.stack([one[~near], other[~near]], 1)
    left = left[(label[left[:, 0]] != label[left[:, 1]]) & (cells.counts[left].max(1) > 1)]
    apart = np.maximum(cells.low[left[:, 1]] - cells.high[left[:, 0]], cells.low[left[:, 0]] - cells.high[left[:, 1]])
    left = left[_squares(np.maximum(apart, 0)) <= gap * gap]
    joined = np.array(cells.joined(left, label, gap), np.int64).reshape(-1, 2)
    label = _joined(label, joined[:, 0], joined[:, 1])
    begin = np.full(int(label.max()) + 1, len(points))
    np.minimum.at(begin, label, cells.order[cells.begin])
    numbers = np.empty(len(points), np.int64)
    numbers[cells.order] = np.repeat(np.argsort(np.argsort(begin))[label], cells.counts)
    return numbers


class _Cells:
    """Points sorted by cells."""

    def __init__(self, points: Any, gap: float) -> None:
        side = gap / math.sqrt(points.shape[1]) * (1 - 1e-9)
        with np.errstate(over="ignore"):
            index, spans = _compressed(np.floor(points / side))
        # Two empty cells on each side, so that neighbours never wrap round.
        self.strides = np.concatenate([np.cumprod((spans + 4)[::-1])[-2::-1], [1]])
        self.size = int(np.prod(spans + 4))
        keys = index @ self.strides
        self.order = np.argsort(keys, kind="stable")
        keys = keys[self.order]
        self.begin = np.flatnonzero(np.concatenate([[True], keys[1:] != keys[:-1]]))
        self.keys = keys[self.begin]
        self.counts = np.diff(self.begin, append=len(keys))
        self.table: Any = None
        if self.size <= _TABLE:
            self.table = np.zeros(self.size + 1, np.int32)
            self.table[self.keys + 1] = 1
            np.cumsum(self.table, out=self.table)
        self.points = points[self.order]
        self.low, self.high = (one.reduceat(self.points, self.begin) for one in (np.minimum, np.maximum))

    def before(self, keys: Any) -> Any:
        """Return how many cells there are before keys."""
        if self.table is None:
            return np.searchsorted(self.keys, keys)
        return self.table[np.minimum(keys, self.size)]

    def neighbours(self, reach: int) -> tuple[Any, Any]:
        """Return the pairs of cells that are at most `reach` apart along each axis, each once."""
        count = len(self.keys)
        ones, others, numbers = [], [], np.arange(count, dtype=np.int32)
        for steps in itertools.product(range(-reach, reach + 1), repeat=len(self.strides) - 1):
            row = int(np.dot(steps, self.strides[:-1]))
            if row >= 0:
                low, high = self.keys + (row - reach if row else 1), self.keys + row + reach + 1
                begin = self.before(low)
                some = self.before(high) - begin
                one = np.repeat(numbers, some)
                ones.append(one)
                others.append(np.arange(len(one), dtype=np.int32) + np.repeat(begin - np.cumsum(some) + some, some))
        return np.concatenate(ones), np.concatenate(others)

    def joined(self, pairs: Any, label: Any, gap: float) -> list[tuple[int, int]]:
        """Return the pairs that join two clusters, by all of their points, but none that others have joined."""
        above = dict.fromkeys(np.unique(label[pairs]).tolist(), -1)

        def top(one: int) -> int:
            while above[one] >= 0:
                one = above[one]
            return one

        found = []
        for one, other in pairs.tolist():
            first, second = top(int(label[one])), top(int(label[other]))
            if first != second and _nearest(self._of(one), self._of(other), gap) <= gap * gap:
                above[first] = second
                found.append((one, other))
        return found

    def _of(self, cell: int) -> Any:
        return self.points[self.begin[cell] : self.begin[cell] + self.counts[cell]]


def _nearest(one: Any, other: Any, gap: float) -> float:
    """Return the square of the least distance between two sets of points, if it is not much more than the gap."""
    if len(one) * len(other) > _FEW:
        near, at = require("scipy.spatial", "robotics").cKDTree(one).query(other, distance_upper_bound=gap * (1 + 1e-9))
        best = int(near.argmin())
        if not math.isfinite(near[best]):
            return math.inf
        one, other = one[at[best : best + 1]], other[best : best + 1]
    return float(_squares((one[:, None] - other).reshape(-1, one.shape[1])).min())


def _compressed(whole: Any) -> tuple[Any, Any]:
    """Return whole numbers counted from the least, and how many there are; if too many, wide gaps become narrow.

    Raises:
      ValueError: there are too many for one number for each cell.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        index = whole - whole.min(0)
        if not np.prod(index.max(0) + 5) < _MOST_CELLS:  # or it is NaN
            for axis, column in enumerate(whole.T):
                values, place = np.unique(column, return_inverse=True)
                index[:, axis] = np.concatenate([[0], np.cumsum(np.minimum(np.diff(values), 3))])[place.reshape(-1)]
    if np.prod(index.max(0) + 5) >= _MOST_CELLS:
        raise ValueError(
            "there are too many points, too far apart, for clusters; thin them first, with clouds.voxel_grid"
        )
    return index.astype(np.int64), index.max(0).astype(np.int64) + 1


def _squares(off: Any) -> Any:
    with np.errstate(over="ignore"):
        return (off * off).sum(1)


def _joined(label: Any, one: Any, other: Any) -> Any:
    """Return new labels of things, of which pairs are now joined."""
    sparse, graphs = require("scipy.sparse", "robotics"), require("scipy.sparse.csgraph", "robotics")
    count = int(label.max()) + 1
    matrix = sparse.coo_matrix((np.ones(len(one)), (label[one], label[other])), shape=(count, count))
    return graphs.connected_components(matrix, directed=False)[1][label]
