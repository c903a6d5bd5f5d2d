"""Many targets over time: which measurement belongs to which, where each is, and how it moves."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from annotated_types import Interval

from hfg.geometry import PointCloud
from hfg.nodes._extras import require
from hfg.nodes.estimation._kalman import correct, predict
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

    def __init__(self, number: int, place: Any, stamp: float, noise: float, fastest: float) -> None:
        self.number, self.seen, self.missed, self.last = number, 1, 0, stamp
        self.state = np.array([*place, 0.0, 0.0])
        self.covariance = np.diag([noise**2, noise**2, (fastest / 2) ** 2, (fastest / 2) ** 2])

    def move(self, dt: float, acceleration: float) -> None:
        """Let it move on; its acceleration is white noise."""
        step = np.eye(4)
        step[0, 2] = step[1, 3] = dt
        push = np.array([[dt * dt / 2, 0], [0, dt * dt / 2], [dt, 0], [0, dt]]) * acceleration
        self.state, self.covariance = predict(self.state, self.covariance, step, push @ push.T)

    def is_seen(self, point: Any, noise: float, stamp: float) -> None:
        """Take in where it is seen."""
        self.state, self.covariance = correct(self.state, self.covariance, point, _PLACE, noise**2 * np.eye(2))
        self.seen, self.missed, self.last = self.seen + 1, 0, stamp

    def is_missed(self) -> None:
        """It is not seen this time."""
        self.missed += 1

    def distances(self, points: Any, noise: float) -> Any:
        """Return the squared Mahalanobis distance of each point."""
        spread = self.covariance[:2, :2] + noise**2 * np.eye(2)
        off = points - self.state[:2]
        return (off * np.linalg.solve(spread, off.T).T).sum(1)


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
        noise: float = 0.1,
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
          noise: of a point.
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
        dt = stamp - self._stamp if self._targets else 0.0
        self._stamp = stamp
        for one in self._targets:
            one.move(dt, acceleration)
        free = np.ones(len(points), bool)
        pairs = self._assigned(points, noise, gate)
        for target in self._targets:
            at = pairs.get(target.number)
            if at is None:
                target.is_missed()
            else:
                free[at] = False
                target.is_seen(points[at], noise, stamp)
        # a target that was not sent yet must not be missed
        kept = [
            one for one in self._targets if stamp - one.last <= forget_s and (one.seen >= confirm or not one.missed)
        ]
        for place in points[free]:
            kept.append(_Target(self._next, place, stamp, noise, fastest))
            self._next += 1
        self._targets = kept
        return [_told(one, still) for one in kept if one.seen >= confirm]

    def _assigned(self, points: Any, noise: float, gate: float) -> dict[int, int]:
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
      noise: standard deviation of a detection in each direction.
      acceleration: standard deviation of a target's acceleration.
      gate: how far off a detection may be, in standard deviations.
      fastest: of a target that is seen for the first time.
      confirm: how often a target is seen, without a miss, before it is sent.
      forget_s: how long a target is kept without being seen.
      still: a target that is slower does not move.
      detections: centres of what was detected, in a frame that does not move; heights do not count.
      tracks: by number, including targets that were just missed.

    Raises:
      ValueError: coordinates are not finite, or a stamp lies before the last one.
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
                noise=self.noise,
                acceleration=self.acceleration,
                gate=self.gate,
                fastest=self.fastest,
                confirm=self.confirm,
                forget_s=self.forget_s,
                still=self.still,
            )
