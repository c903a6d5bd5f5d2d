"""How the robot drives in a state, as plain classes: made when the state is entered, asked for a command at each tick.

A step returns the command and how it ended: nothing while it continues. Laws, plans, paths and walls are the functions
that the nodes of `mission.driving` call too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias

from examples.fetch_delivery import laws
from examples.fetch_delivery.messages import Odometry, Scan, Twist
from examples.fetch_delivery.perception.following import Limits, follow
from examples.fetch_delivery.perception.laser import smooth_scan, wall_ahead
from examples.fetch_delivery.perception.planning import Path, length_of, plan, queue
from examples.fetch_delivery.perception.records import Localised, Sighting, Station, wrapped
from hfg.nodes.robotics import Disk

End: TypeAlias = Literal["done", "lost", "blocked"]
Step: TypeAlias = tuple[Twist, End | None]


@dataclass
class Move:
    """Move a given distance by odometry only, or turn on the spot.

    Attributes:
      x: how far ahead; negative is back.
      y: how far to the left.
      turn: how far to turn, counter-clockwise.
      speed: at most.
    """

    x: float = 0.0
    y: float = 0.0
    turn: float = 0.0
    speed: float = 0.4
    goal: tuple[float, float, float] | None = None

    def step(self, odometry: Odometry) -> Step:
        """Steer to where it leads from the pose of the first step."""
        if self.goal is None:
            self.goal = laws.destination(odometry, self.x, self.y, self.turn)
        return _ended(laws.move(odometry, self.goal, turns=bool(self.turn), speed=self.speed))


@dataclass
class GoTo:
    """Go to a pose of the map; replan while the robot and others move.

    Attributes:
      goal: the pose.
      near: how near to it is there.
      aligned: and how near to its heading.
      lane: how far beyond the goal it has to be free; the robot waits for that at a distance.
      queueing: and not longer than this number of seconds.
      every: plan with each so many-th pose.
      without_path: so many seconds without any path are too long.
      patience: so many seconds may the robot come no nearer.
    """

    goal: Any
    near: float = 0.06
    aligned: float = 0.06
    lane: float = 0.0
    queueing: float = 60.0
    every: int = 5
    without_path: float = 8.0
    patience: float = 6.0
    path: Path | None = None
    waits: bool = False
    poses: int = 0
    since: float | None = None
    queues_since: float | None = None
    least: float = math.inf
    last: Twist = field(default_factory=Twist)

    def step(self, localised: Localised | None, scan: Scan, others: Sequence[Disk]) -> Step:
        """Plan if it is time to, and take one step along the path."""
        if self.since is None:
            self.since = scan.stamp
        if localised is None:
            return Twist(), None
        if localised.fits:
            if self.poses % self.every == 0:
                self._plan(localised, others)
            self.poses += 1
        waited = scan.stamp - self.since
        if self.path is None:
            return Twist(), "blocked" if waited >= self.without_path else None
        limits = Limits(near=self.near, aligned=self.aligned)
        twist = follow(self.path, localised, scan, math.hypot(self.last.vx, self.last.vy), limits)
        if twist is None and self.waits:
            return self._queue(scan.stamp)
        if twist is None:
            return Twist(), "done"
        self.last = twist
        if not self.waits:
            self.queues_since = None
        return twist, "blocked" if waited > self.patience else None

    def _plan(self, localised: Localised, others: Sequence[Disk]) -> None:
        waiting = queue(localised.shape, localised.pose, self.goal, others, self.lane) if self.lane else None
        if waiting is not None:
            path = Path(*waiting)
        else:
            points = plan(localised.shape, localised.pose, self.goal, others, beside=not self.lane)
            if points is None:
                return
            path = Path(points, float(self.goal[2]))
        elsewhere = self.path is None or math.dist(self.path.points[-1], path.points[-1]) > 0.1
        left = length_of(path.points) + 0.3 * abs(float(wrapped(path.heading - localised.pose[2])))
        if elsewhere or left < self.least - 0.05:
            self.least, self.since = left, localised.stamp
        self.path, self.waits = path, waiting is not None

    def _queue(self, now: float) -> Step:
        self.last, self.since = Twist(), now
        if self.queues_since is None:
            self.queues_since = now
        return Twist(), "blocked" if now - self.queues_since > self.queueing else None


@dataclass
class Position:
    """Stand before a bull's-eye, looking straight at the wall that bears it.

    Attributes:
      station: where it should be.
      distance: from the wall.
      patience: how many seconds it may be out of sight.
    """

    station: Station
    distance: float = 0.8
    patience: float = 3.0
    target: tuple[float, float] | None = None
    since: float | None = None
    steady: int = 0

    def step(self, localised: Localised | None, scan: Scan, seen: Sequence[Sighting]) -> Step:
        """Take one step towards it; `seen` are the bull's-eyes that were seen since the last one."""
        if self.since is None:
            self.since = scan.stamp
        if localised is None:
            return Twist(), None
        self._follow(localised, seen)
        if self.target is None or localised.stamp - self.since > self.patience:
            return Twist(), "lost" if localised.stamp - self.since > self.patience else None
        twist = laws.stand_before(localised, self.target, wall_ahead.function(scan), self.station, self.distance)
        self.steady = self.steady + 1 if twist is None else 0
        return twist or Twist(), "done" if self.steady >= 2 else None

    def _follow(self, localised: Localised, seen: Sequence[Sighting]) -> None:
        target = laws.sighted(localised, seen, self.station, self.target)
        if target is not None:
            self.target, self.since = target, localised.stamp


@dataclass
class Dock:
    """Drive straight ahead until something is near.

    Attributes:
      distance: how near, from the middle of the robot.
      speed: at most.
    """

    distance: float = 0.32
    speed: float = 0.36

    def step(self, scan: Scan) -> Step:
        """Look ahead."""
        return _ended(laws.approach(smooth_scan.function(scan), self.distance, self.speed))


def _ended(twist: Twist | None) -> Step:
    """Return the step of a law that ends by itself."""
    return (Twist(), "done") if twist is None else (twist, None)
