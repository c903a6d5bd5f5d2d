"""Along a path: the next step of a robot that drives in every direction, at nothing faster than it can brake."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from annotated_types import Gt

import hfg
from examples.fetch_delivery.messages import Scan, Twist
from examples.fetch_delivery.perception.laser import foreign
from examples.fetch_delivery.perception.planning import RADIUS, Path
from examples.fetch_delivery.perception.records import Localised, wrapped
from hfg.nodes.robotics import Disk, scan_points

_LEAST_AHEAD: Final = 0.15  # metres on the path that the robot aims ahead at least
_REACTION: Final = 0.2  # seconds from a scan to wheels that obey
_STANDS: Final = 0.02  # m/s: a robot that is held back stands as well
_LOOK: Final = 1.0  # metres before the goal, from where on the robot turns to its heading


@dataclass(frozen=True, slots=True)
class Limits:
    """How a path is followed.

    Attributes:
      speed: in m/s.
      turning: in rad/s; slow, because it blurs pictures.
      braking: in m/s2; less than the motors can, for what is ahead may come nearer.
      wall: the gap that is kept from walls, in metres.
      robot: the gap that is kept from other robots.
      near: how near to the goal is there, in metres.
      aligned: and how near to its heading, in radians.
      foresight: how far ahead on the path the robot aims, in seconds of its way.
    """

    speed: float = 0.6
    turning: float = 1.0
    braking: float = 0.5
    wall: float = 0.04
    robot: float = 0.1
    near: float = 0.04
    aligned: float = 0.04
    foresight: float = 0.35


LIMITS: Final = Limits()


def follow(path: Path, localised: Localised, scan: Scan, speed: float = 0.0, limits: Limits = LIMITS) -> Twist | None:
    """Return the velocity for the next moment, in the robot's frame; None if the robot is there.

    Args:
      path: in the map frame.
      localised: where the robot is.
      scan: what is around it now; nothing in it is driven at faster than it could brake.
      speed: how fast the robot was; the faster, the farther ahead on the path it aims.
      limits: how fast it may be, and how near to what.
    """
    pose = localised.pose
    remaining, aim = _ahead(path.points, pose[:2], _LEAST_AHEAD + limits.foresight * speed)
    turn = float(wrapped(path.heading - pose[2]))
    if remaining < limits.near and abs(turn) < limits.aligned:
        return None
    way = aim - pose[:2]
    far = float(np.hypot(way[0], way[1]))
    if remaining > _LOOK:
        turn = float(wrapped(math.atan2(way[1], way[0]) - pose[2]))
    wanted = min(limits.speed, math.sqrt(2 * limits.braking * remaining), 2.5 * remaining)
    velocity = way / max(far, 1e-6) * wanted
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    velocity = np.array([cos * velocity[0] + sin * velocity[1], cos * velocity[1] - sin * velocity[0]])
    velocity = held_back(velocity, localised, scan, limits)
    omega = max(-limits.turning, min(limits.turning, 2.0 * turn))
    return Twist(float(velocity[0]), float(velocity[1]), omega)


def held_back(velocity: Any, localised: Localised, scan: Scan, limits: Limits = LIMITS) -> Any:
    """Take from a velocity in the robot's frame what would lead too fast at anything in the scan."""
    points = scan_points.function(scan.ranges, scan.angles, max_range=scan.max_range)
    far = np.hypot(points[:, 0], points[:, 1])
    near = far < 1.2 + RADIUS
    walls, gaps = points[near], far[near] - RADIUS - limits.wall
    others = _in_frame(foreign(scan, localised), localised.pose)
    others_far = np.hypot(others[:, 0], others[:, 1])
    close = others_far < 1.2 + RADIUS
    normals = np.concatenate([walls / far[near, None], others[close] / others_far[close, None]])
    gaps = np.concatenate([gaps, others_far[close] - RADIUS - limits.robot])
    # Nearer than it should be, a robot backs off slowly.
    most = np.where(gaps > 0, np.sqrt(2 * limits.braking * np.maximum(gaps, 0)), np.maximum(gaps, -0.1))
    for _ in range(6):
        if not len(gaps):
            break
        over = normals @ velocity - most
        worst = int(np.argmax(over))
        if over[worst] <= 1e-6:
            break
        velocity = velocity - over[worst] * normals[worst]
    return velocity


def _in_frame(places: Any, pose: Any) -> Any:
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return (places - pose[:2]) @ np.array([[cos, -sin], [sin, cos]])


def _ahead(points: Any, place: Any, foresight: float) -> tuple[float, Any]:
    """Return how long the rest of the path is, and the point on it that lies so far ahead."""
    steps = np.diff(points, axis=0)
    lengths = np.maximum(np.hypot(steps[:, 0], steps[:, 1]), 1e-9)
    share = np.clip(((place - points[:-1]) * steps).sum(1) / lengths**2, 0, 1)
    nearest = points[:-1] + share[:, None] * steps
    off = np.hypot(nearest[:, 0] - place[0], nearest[:, 1] - place[1])
    at = len(off) - 1 - int(np.argmin(off[::-1]))  # of equal ones the one nearer to the goal
    gone = np.concatenate([[0.0], np.cumsum(lengths)])
    here = float(gone[at] + share[at] * lengths[at])
    remaining = float(gone[-1]) - here + float(off[at])
    aim = min(here + foresight, float(gone[-1]))
    index = min(int(np.searchsorted(gone, aim, side="right")) - 1, len(steps) - 1)
    return remaining, points[index] + steps[index] * ((aim - gone[index]) / lengths[index])


class FollowPath(hfg.Node):
    """Follow a path.

    Fires once for each pose with the scan of its time; it is silent without a path. A new path takes the place of the
    old one without a stop. The last command is to stand.

    Attributes:
      speed: top speed.
      foresight: how far ahead on the path it aims, in seconds of its way.
      near: how near to the goal is there.
      aligned: and how near to its heading.
      patience: so long may the robot come no nearer to the goal before `blocked` tells.
      localised: where the robot is.
      scan: of the same time.
      command: the velocity.
      path: what is to be followed.
      aside: the goal is taken now; this path leads to where the robot can wait for it.
      stop: follow nothing any more, and stand.
      arrived: the robot is at the goal.
      blocked: it came no nearer for too long; how far it still is. It keeps trying.
      taken: the goal is taken; the path to where the robot can wait.
    """

    speed = hfg.Parameter(0.6, unit="m/s")
    foresight = hfg.Parameter(0.35, unit="s")
    near = hfg.Parameter(0.04, unit="m")
    aligned = hfg.Parameter(0.04, unit="rad")
    patience = hfg.Parameter(3.0, unit="s")
    localised = hfg.Input(Localised)
    scan = hfg.Input(Scan)
    command = hfg.Output(Twist)
    arrived = hfg.Event()
    blocked = hfg.Event(float)
    taken = hfg.Event(Path)

    way: hfg.State[Any] = hfg.State(None)
    last: hfg.State[Any] = hfg.State(None)
    best = hfg.State(math.inf)
    since = hfg.State(0.0)
    goal_was: hfg.State[Any] = hfg.State(None)

    def process(self, localised: Localised, scan: Scan) -> Twist | None:
        """Take one step."""
        if self.way is None:
            stopping, self.last = self.last is not None, None
            return Twist() if stopping else None
        limits = Limits(speed=self.speed, near=self.near, aligned=self.aligned, foresight=self.foresight)
        twist = follow(self.way, localised, scan, _speed(self.last), limits)
        if twist is None:
            self.way = self.last = None
            self.best = math.inf
            self.arrived.trigger()
            return Twist()
        self.last = twist
        stalled = self._stalled(localised, scan.stamp)
        if stalled is not None:
            self.blocked.trigger(stalled)
        return twist

    def _stalled(self, localised: Localised, now: float) -> float | None:
        """Return how far it still is if it has come no nearer for too long."""
        goal = self.way.points[-1]
        remaining = _ahead(self.way.points, localised.pose[:2], 0.0)[0]
        remaining += 0.3 * abs(float(wrapped(self.way.heading - localised.pose[2])))
        goal_moved = self.best == math.inf or np.hypot(*(goal - self.goal_was)) > 0.1
        if goal_moved or remaining < self.best - 0.05:
            self.best, self.since = remaining, now
            self.goal_was = goal
        elif now - self.since > self.patience:
            self.since = now
            self.best = remaining
            return remaining
        return None

    @hfg.slot
    def path(self, path: Path) -> None:
        """Follow this one."""
        self.way = path

    @hfg.slot(while_active=True)
    def aside(self, path: Path) -> None:
        """Follow nothing, and say that it has to wait."""
        self.way, self.last, self.best = None, None, math.inf
        self.taken.trigger(path)

    @hfg.slot
    def stop(self) -> None:
        """Follow nothing."""
        self.way, self.best = None, math.inf


class Queue(hfg.Node):
    """Wait for another robot that has taken the goal, where there is room for it to leave.

    Fires once for each pose with the scan of its time; it is silent without a path. At the end of the path it stands.

    Attributes:
      speed: top speed.
      patience: so long may it stand before `blocked` tells.
      localised: where the robot is.
      scan: of the same time.
      command: the velocity.
      aside: the path to where it can wait; where activity arrives.
      path: the goal is free; this path leads to it.
      stop: wait for nothing any more, and stand.
      free: the goal is free; the path to it.
      blocked: it has waited for too long; it keeps waiting.
    """

    speed = hfg.Parameter(0.6, unit="m/s")
    patience = hfg.Parameter(60.0, unit="s")
    localised = hfg.Input(Localised)
    scan = hfg.Input(Scan)
    command = hfg.Output(Twist)
    free = hfg.Event(Path)
    blocked = hfg.Event()

    way: hfg.State[Any] = hfg.State(None)
    last: hfg.State[Any] = hfg.State(None)
    since: hfg.State[float | None] = hfg.State(None)

    def process(self, localised: Localised, scan: Scan) -> Twist | None:
        """Take one step, or stand."""
        if self.way is None:
            return None
        self.last = follow(self.way, localised, scan, _speed(self.last), Limits(speed=self.speed))
        if self.since is None and _speed(self.last) < _STANDS:
            self.since = scan.stamp
        if self.since is not None and scan.stamp - self.since > self.patience:
            self.since = scan.stamp
            self.blocked.trigger()
        return self.last or Twist()

    @hfg.slot
    def aside(self, path: Path) -> None:
        """Wait there."""
        self.way = path

    @hfg.slot(while_active=True)
    def path(self, path: Path) -> None:
        """Say that it can go on."""
        self.way = self.last = self.since = None
        self.free.trigger(path)

    @hfg.slot
    def stop(self) -> None:
        """Wait for nothing."""
        self.way = self.last = self.since = None


def _speed(twist: Twist | None) -> float:
    return 0.0 if twist is None else math.hypot(twist.vx, twist.vy)


class GiveWay(hfg.Node):
    """Hold back what would lead too fast at another robot, whoever commands it.

    Steps that drive without looking, such as backing off, need not care for others: here all commands pass. Walls are
    ignored because a robot has to dock.

    Attributes:
      gap: that is kept.
      braking: in m/s2; less than the motors can.
      around: other robots in the robot's own frame, with velocities over the ground.
      command: what is wanted.
      held: what is safe.
    """

    gap = hfg.Parameter(0.06, Gt(0), unit="m")
    braking = hfg.Parameter(0.5, Gt(0), unit="m/s^2")
    held = hfg.Event(Twist)
    known: hfg.State[list[Disk]] = hfg.State(factory=list)

    @hfg.slot
    def around(self, around: list[Disk]) -> None:
        """Keep where they are."""
        self.known = around

    @hfg.slot
    def command(self, twist: Twist) -> None:
        """Take out of it what is too fast."""
        self.held.trigger(apart(twist, self.known, self.gap, self.braking))


def apart(twist: Twist, around: list[Disk], gap: float = 0.06, braking: float = 0.5) -> Twist:
    """Take from a velocity what would lead too fast at other robots, of which some come nearer by themselves."""
    vx, vy = twist.vx, twist.vy
    for _ in range(2):  # what is held back before one may lead at the next
        for one in around:
            far = math.hypot(one.x, one.y)
            if not 0 < far < 2.0:
                continue
            nx, ny = one.x / far, one.y / far
            comes = max(0.0, -(nx * one.vx + ny * one.vy))
            left = far - 2 * RADIUS - gap - _REACTION * comes
            most = max(0.0, math.sqrt(2 * braking * max(left, 0.0)) - comes)
            over = nx * vx + ny * vy - most
            if over > 0:
                vx, vy = vx - over * nx, vy - over * ny
    return Twist(vx, vy, twist.omega)
