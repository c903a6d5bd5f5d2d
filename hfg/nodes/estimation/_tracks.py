"""Many targets over time: which measurement belongs to which, where each is, and how it moves."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

import numpy as np
from annotated_types import Interval, Unit

from hfg.geometry import PointCloud
from hfg.nodes._extras import require
from hfg.nodes.estimation._kalman import correct, need_positive, predict
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, State

_PLACE = np.eye(2, 4)
_FAR = 1e9


class Track(NamedTuple):
    """A target.

    Attributes:
      number: it stays the same as long as the target is tracked; from 1.
      x: where it is, in metres.
      y: where it is.
      vx: how fast it moves along x, in m/s.
      vy: how fast along y.
      sigma: how sure the place is, in metres; in the worst direction.
      seen: how often it was measured.
      missed: how many measurements ago that was; 0 for the last one.
      moves: it is faster than a still target seems to be.
    """

    number: int
    x: float
    y: float
    vx: float
    vy: float
    sigma: float
    seen: int
    missed: int
    moves: bool


class _Target:
    __slots__ = ("covariance", "last", "missed", "number", "seen", "state")

    def __init__(self, number: int, place: Any, stamp: float, noise: Any, fastest: float) -> None:
        self.number, self.seen, self.missed, self.last = number, 1, 0, stamp
        self.state = np.array([*place, 0.0, 0.0])
        self.covariance = np.diag([0.0, 0.0, (fastest / 2) ** 2, (fastest / 2) ** 2])
        self.covariance[:2, :2] = noise

    def move(self, dt: float, acceleration: float) -> None:
        """Let it move on; its acceleration is white noise."""
        step = np.eye(4)
        step[0, 2] = step[1, 3] = dt
        push = np.array([[dt * dt / 2, 0], [0, dt * dt / 2], [dt, 0], [0, dt]]) * acceleration
        self.state, self.covariance = predict(self.state, self.covariance, step, push @ push.T)

    def is_seen(self, point: Any, noise: Any, stamp: float) -> None:
        """Take in where it is seen, and how sure that place is."""
        self.state, self.covariance = correct(self.state, self.covariance, point, _PLACE, noise)
        self.seen, self.missed, self.last = self.seen + 1, 0, stamp

    def is_missed(self) -> None:
        """It is not seen this time."""
        self.missed += 1

    def distances(self, points: Any, noise: Any) -> Any:
        """Return the squared Mahalanobis distance of each point, which has a covariance of its own."""
        off = points - self.state[:2]
        return (off * np.linalg.solve(self.covariance[:2, :2] + noise, off[..., None])[..., 0]).sum(1)


class PointTracks:
    """Tracks points from measurement to measurement; the plain part of `TrackPoints`."""

    def __init__(self) -> None:
        self._targets: list[_Target] = []
        self._stamp = -math.inf
        self._next = 1

    def update(
        self,
        points: Any,
        stamp: float,
        *,
        noise: Any = 0.1,
        acceleration: float = 2.0,
        gate: float = 3.0,
        fastest: float = 3.0,
        confirm: int = 3,
        forget_s: float = 1.0,
        still: float = 0.3,
    ) -> list[Track]:
        """Take in what is measured at a stamp; the arguments are those of `TrackPoints`.

        Args:
          points: finite, n x 2.
          stamp: when.
          noise: standard deviation of a point, or a covariance for each, n x 2 x 2.
          acceleration: of a target.
          gate: how far off a point may be, in standard deviations.
          fastest: of a target.
          confirm: how often a target is seen before it is sent.
          forget_s: how long it is kept without being seen.
          still: what is slower does not move.

        Raises:
          ValueError: the stamp lies before the last one.
        """
        if stamp < self._stamp:
            raise ValueError(
                f"measurements come in the order of their stamps, got {stamp:.3f} s after {self._stamp:.3f} s"
            )
        spreads = noise if np.ndim(noise) else np.broadcast_to(noise**2 * np.eye(2), (len(points), 2, 2))
        dt = stamp - self._stamp if self._targets else 0.0
        self._stamp = stamp
        for one in self._targets:
            one.move(dt, acceleration)
        free = np.ones(len(points), bool)
        pairs = self._assigned(points, spreads, gate)
        for target in self._targets:
            at = pairs.get(target.number)
            if at is None:
                target.is_missed()
            else:
                free[at] = False
                target.is_seen(points[at], spreads[at], stamp)
        # a target that was not sent yet must not be missed
        kept = [
            one for one in self._targets if stamp - one.last <= forget_s and (one.seen >= confirm or not one.missed)
        ]
        for place, spread in zip(points[free], spreads[free], strict=True):
            kept.append(_Target(self._next, place, stamp, spread, fastest))
            self._next += 1
        self._targets = kept
        return [_told(one, still) for one in kept if one.seen >= confirm]

    def _assigned(self, points: Any, noise: Any, gate: float) -> dict[int, int]:
        """Return which point belongs to which target: together as near as can be, and none outside of the gate."""
        if not (len(points) and self._targets):
            return {}
        cost = np.array([one.distances(points, noise) for one in self._targets])
        cost = np.where(cost <= gate * gate, cost, _FAR)  # what is not a number, too
        rows, columns = require("scipy.optimize", "robotics").linear_sum_assignment(cost)
        return {
            self._targets[row].number: int(column)
            for row, column in zip(rows, columns, strict=True)
            if cost[row, column] < _FAR
        }


def _told(one: _Target, still: float) -> Track:
    x, y, vx, vy = map(float, one.state)
    sigma = math.sqrt(max(0.0, float(np.linalg.eigvalsh(one.covariance[:2, :2])[-1])))
    return Track(one.number, x, y, vx, vy, sigma, one.seen, one.missed, math.hypot(vx, vy) > still)


class TrackPoints(Node):
    """Track many targets, such as people or obstacles: each keeps its number from measurement to measurement.

    Fires once per cloud of detections. Each target is a Kalman filter of place and velocity. A detection may belong to
    a target if its Mahalanobis distance lies inside the gate; among these, detections are assigned so that all
    distances together are least (scipy.optimize.linear_sum_assignment). After Y. Bar-Shalom and T. Fortmann, Tracking
    and Data Association (1988).

    Attributes:
      noise: standard deviation of a detection in each direction, unless the detections have the fields "cov_xx",
        "cov_xy" and "cov_yy", as those of `cluster_detections` have.
      acceleration: standard deviation of a target's acceleration.
      gate: how far off a detection may be, in standard deviations.
      fastest: of a target that is seen for the first time.
      confirm: how often a target is seen, without a miss, before it is sent.
      forget_s: how long a target is kept without being seen.
      still: a target that is slower does not move.
      detections: centres of what was detected, in a frame that does not move; heights do not count.
      tracks: by number, including targets that were just missed.

    Raises:
      ValueError: coordinates are not finite, a covariance is singular, or a stamp lies before the last one.
    """

    noise = Parameter(0.1, Interval(ge=1e-3, le=100), unit="m")
    acceleration = Parameter(2.0, Interval(ge=0, le=100), unit="m/s^2")
    gate = Parameter(3.0, Interval(gt=0, le=100), unit="1")
    fastest = Parameter(3.0, Interval(ge=0, le=1000), unit="m/s")
    confirm = Parameter(3, Interval(ge=1))
    forget_s = Parameter(1.0, Interval(ge=0), unit="s")
    still = Parameter(0.3, Interval(ge=0), unit="m/s")
    detections = Input(PointCloud)
    tracks = Output(list[Track])

    known: State[PointTracks] = State(factory=PointTracks)

    def process(self, detections: PointCloud) -> list[Track]:
        """Track them."""
        detections.need_finite()
        with np.errstate(all="ignore"):
            return self.known.update(
                detections.points[:, :2],
                detections.stamp,
                noise=_spreads(detections, self.noise),
                acceleration=self.acceleration,
                gate=self.gate,
                fastest=self.fastest,
                confirm=self.confirm,
                forget_s=self.forget_s,
                still=self.still,
            )


_FIELDS = ("cov_xx", "cov_xy", "cov_yy")


def _spreads(detections: PointCloud, noise: float) -> Any:
    """Return the covariance of each detection, or the standard deviation of all."""
    if not all(name in detections.fields for name in _FIELDS):
        return noise
    xx, xy, yy = (detections.fields[name].astype(np.float64) for name in _FIELDS)
    spreads = np.stack([xx, xy, xy, yy], 1).reshape(-1, 2, 2)
    with np.errstate(all="ignore"):
        sound = np.isfinite(spreads).all((1, 2)) & (xx > 0) & (xx * yy - xy * xy > 0)
    if not sound.all():
        need_positive(spreads[~sound][0])
    return spreads


@node
def cluster_detections(
    labelled: PointCloud,
    *,
    noise: Annotated[float, Interval(ge=1e-3, le=100), Unit("m")] = 0.05,
    share: Annotated[float, Interval(ge=0, le=100), Unit("1")] = 0.25,
    height: Annotated[float, Interval(ge=0), Unit("m")] = math.inf,
    width: Annotated[float, Interval(ge=0), Unit("m")] = math.inf,
) -> PointCloud:
    """Turn clusters into detections with covariances, for `TrackPoints`: one for each cluster, at its centre.

    Fires once per cloud. The covariance of a detection is that of the laser plus a share of that of the points, because
    a laser sees one side of a thing, and its middle is less sure the larger it is. The extent counts as in M. Feldmann
    et al., Tracking of Extended Objects and Group Targets Using Random Matrices, IEEE Transactions on Signal Processing
    59 (2011).

    Args:
      labelled: as `clouds.cluster_points` sends it: with the number of each point's cluster in the field "cluster", and
        -1 for none. Use a frame that does not move.
      noise: standard deviation of a centre, however small the cluster.
      share: of the covariance of the points.
      height: clusters that are higher are left out, such as walls and trunks.
      width: clusters that are longer along x or y are left out.

    Returns:
      out: in the plane, in the order of the numbers, with the fields "cov_xx", "cov_xy", "cov_yy" in square metres,
        "cluster" and "points" (how many there are).

    Raises:
      ValueError: the cloud has no field "cluster", or coordinates are not finite.
    """
    labelled.need_finite()
    if "cluster" not in labelled.fields:
        known = ", ".join(f'"{name}"' for name in labelled.fields) or "none"
        raise ValueError(
            f'the cloud in frame "{labelled.frame_id}" has no field "cluster", but {known}; take the output "labelled" '
            "of clouds.cluster_points"
        )
    number = labelled.fields["cluster"]
    found, label = np.unique(number, return_inverse=True)
    order = np.argsort(label.reshape(-1), kind="stable")
    groups = np.split(labelled.points[order], np.cumsum(np.bincount(label.reshape(-1), minlength=len(found)))[:-1])
    rows = []
    with np.errstate(all="ignore"):
        for cluster, points in zip(found.tolist(), groups, strict=True):
            size = np.ptp(points, 0) if len(points) else np.zeros(2)
            high = size[2] if len(size) == 3 else 0.0
            if cluster >= 0 and max(size[:2]) <= width and high <= height:
                flat = points[:, :2]
                middle = flat.mean(0)
                spread = noise**2 * np.eye(2) + share * ((flat - middle).T @ (flat - middle)) / len(flat)
                rows.append((*middle, spread[0, 0], spread[0, 1], spread[1, 1], cluster, len(flat)))
    table = np.array(rows, np.float64).reshape(-1, 7)
    fields: dict[str, Any] = {name: table[:, place] for place, name in enumerate(_FIELDS, 2)}
    fields |= {"cluster": table[:, 5].astype(np.int32), "points": table[:, 6].astype(np.int32)}
    return PointCloud(labelled.frame_id, labelled.stamp, table[:, :2], fields)
