"""Steps that drive: a way, to a pose, before a sign, up to a wall.

Each sends commands while it is active and tells when it is done. Begun by a slot, it is its own gate: `graph.gate(step,
by=step)`, so no code here asks whether it is active, and of all that drive only the active one sends commands.
"""

from __future__ import annotations

import math
from typing import Any

from annotated_types import Gt, Interval

import hfg
from examples.fetch_delivery.messages import Odometry, Scan, Twist, Vector
from examples.fetch_delivery.mission.looking import Shutter
from examples.fetch_delivery.perception.following import FollowPath
from examples.fetch_delivery.perception.laser import obstacle_ahead
from examples.fetch_delivery.perception.planning import PlanPath
from examples.fetch_delivery.perception.records import Localised, Sighting, Station, Wall, wrapped
from hfg.nodes.robotics import Disk


class MoveRobot(hfg.Node):
    """Move a given distance in a given direction, by the wheels alone (paper, 6.1.3); or turn on the spot.

    Attributes:
      x: how far ahead; negative is back.
      y: how far to the left.
      turn: how far to turn, counter-clockwise.
      speed: at most.
      odometry: what the wheels say.
      command: the velocity.
      begin: where activity arrives.
      done: it has moved so far.
    """

    x = hfg.Parameter(0.0, Interval(ge=-5, le=5), unit="m")
    y = hfg.Parameter(0.0, Interval(ge=-5, le=5), unit="m")
    turn = hfg.Parameter(0.0, Interval(ge=-7, le=7), unit="rad")
    speed = hfg.Parameter(0.4, Gt(0), unit="m/s")
    odometry = hfg.Input(Odometry)
    command = hfg.Output(Twist)
    done = hfg.Event()
    goal: hfg.State[Any] = hfg.State(None)

    def process(self, odometry: Odometry) -> Twist:
        """Steer to where it leads from the pose of the first firing."""
        x, y, theta = odometry.pose
        cos, sin = math.cos(theta), math.sin(theta)
        if self.goal is None:
            self.goal = (x + cos * self.x - sin * self.y, y + sin * self.x + cos * self.y, theta + self.turn)
        dx, dy, turn = self.goal[0] - x, self.goal[1] - y, self.goal[2] - theta
        left = math.hypot(dx, dy)
        if left < 0.05 and (not self.turn or abs(turn) < 0.2):
            self.done.trigger()
            return Twist()
        pace = min(self.speed, 0.05 + 1.2 * left) / max(left, 0.05)
        omega = max(-0.8, min(0.8, turn)) if self.turn else 0.0  # without a turn the heading may drift
        return Twist(pace * (cos * dx + sin * dy), pace * (cos * dy - sin * dx), omega)

    @hfg.slot
    def begin(self) -> None:
        """Forget where it led the last time."""
        self.goal = None


class PositionToTarget(hfg.Node):
    """Stand before a bull's-eye, looking straight at the wall that bears it (paper, 6.1.3).

    Keeps where the bull's-eye is in the map, so pictures may come more rarely than poses. How far the robot is turned
    it sees by the wall, which the laser measures better than a camera.

    Attributes:
      distance: from the wall.
      patience: how long it may be out of sight.
      localised: where the robot is.
      wall: the wall ahead, in step; without one the heading comes from where the station should be.
      command: the velocity.
      aim: the station before which the robot is.
      see: bull's-eyes that were seen now.
      begin: where activity arrives.
      done: it stands there.
      lost: the bull's-eye was out of sight for too long.
    """

    distance = hfg.Parameter(0.8, Gt(0), unit="m")
    patience = hfg.Parameter(3.0, Gt(0), unit="s")
    localised = hfg.Input(Localised)
    wall = hfg.Input(Wall, optional=True)
    command = hfg.Output(Twist)
    done = hfg.Event()
    lost = hfg.Event()
    station: hfg.State[Any] = hfg.State(None)
    target: hfg.State[Any] = hfg.State(None)
    seen: hfg.State[Any] = hfg.State(())
    since: hfg.State[float | None] = hfg.State(None)
    steady = hfg.State(0)

    def process(self, localised: Localised, wall: Wall | None = None) -> Twist | None:
        """Take one step towards it."""
        self._follow(localised)
        if self.target is None or localised.stamp - (self.since or 0.0) > self.patience:
            if self.since is None:
                self.since = localised.stamp
            if localised.stamp - self.since > self.patience:
                self.lost.trigger()
            return Twist()
        x, y, theta = localised.pose
        dx, dy = self.target[0] - x, self.target[1] - y
        ahead, left = math.cos(theta) * dx + math.sin(theta) * dy, math.cos(theta) * dy - math.sin(theta) * dx
        turn = wall.angle if wall is not None else float(wrapped(self.station.theta + math.pi - theta))
        far = wall.distance if wall is not None else ahead
        aside = math.cos(turn) * left - math.sin(turn) * ahead  # along the wall
        if abs(aside) < 0.025 and abs(turn) < 0.05 and far < self.distance + 0.1:
            self.steady += 1
            if self.steady >= 2:
                self.done.trigger()
            return Twist()
        self.steady = 0
        on = max(-0.2, min(0.3, 0.8 * (far - self.distance)))
        across = max(-0.25, min(0.25, 1.2 * aside))
        cos, sin = math.cos(turn), math.sin(turn)
        return Twist(cos * on - sin * across, sin * on + cos * across, max(-0.6, min(0.6, 1.2 * turn)))

    def _follow(self, localised: Localised) -> None:
        """Take in what was seen: of several bull's-eyes that which is nearest to where it should be."""
        expected = self.target if self.target is not None else (self.station.x, self.station.y)
        places = [localised.place(one.x, one.y) for one in self.seen]
        self.seen = ()
        near = [place for place in places if math.dist(place, expected) < 0.7]
        if near:
            best = min(near, key=lambda place: math.dist(place, expected))
            gain = 1.0 if self.target is None else 0.5
            old = best if self.target is None else self.target
            self.target = (old[0] + gain * (best[0] - old[0]), old[1] + gain * (best[1] - old[1]))
            self.since = localised.stamp

    @hfg.slot
    def aim(self, station: Station) -> None:
        """Be told where it should be."""
        self.station = station

    @hfg.slot(while_active=True)
    def see(self, sightings: list[Sighting]) -> None:
        """Look at it with the next pose."""
        self.seen = sightings

    @hfg.slot
    def begin(self) -> None:
        """Forget the last one."""
        self.target, self.since, self.seen, self.steady = None, None, (), 0


class MoveToObstacle(hfg.Node):
    """Drive straight ahead until something is near (paper, 6.1.3).

    Attributes:
      distance: how near, from the middle of the robot.
      speed: at most.
      scan: of the laser.
      command: the velocity.
      begin: where activity arrives.
      done: it is there, and stops.
    """

    distance = hfg.Parameter(0.36, Gt(0), unit="m")
    speed = hfg.Parameter(0.3, Gt(0), unit="m/s")
    scan = hfg.Input(Scan)
    command = hfg.Output(Twist)
    done = hfg.Event()

    def process(self, scan: Scan) -> Twist:
        """Look ahead."""
        left = obstacle_ahead.function(scan, width=0.3) - self.distance
        if left < 0.015:
            self.done.trigger()
            return Twist()
        return Twist(min(self.speed, 0.03 + math.sqrt(2 * 0.25 * left)))

    @hfg.slot
    def begin(self) -> None:
        """Take the activity."""


class GoTo(hfg.Subgraph):
    """Go to a pose of the map: plan a path around what stands about, and follow it.

    The activity comes with the goal to the planner, goes with the first path to the follower, and leaves when that has
    arrived or has come no nearer for long, or when there is no path for long. While it drives it looks about.

    Attributes:
      localised: where the robot is.
      scan: of the same time.
      others: other robots.
      command: the velocity.
      look: asks for a picture.
      go: the pose.
      stop: forget it.
      arrived: it is there.
      blocked: it came no nearer.
      near: how near to the goal is there.
      aligned: and how near to its heading.
      lane: how far beyond the goal it has to be free; the robot waits for that at a distance.
      queueing: and not longer than so long.
    """

    localised, scan, others = hfg.Input(Localised), hfg.Input(Scan), hfg.Input(list[Disk])
    command, look = hfg.Output(Twist), hfg.Output(bool)
    go = hfg.slot(type=Vector)
    stop = hfg.slot(type=object)
    arrived, blocked = hfg.Event(), hfg.Event(object)
    near = hfg.Parameter(0.06)
    aligned = hfg.Parameter(0.06)
    lane = hfg.Parameter(0.0)
    queueing = hfg.Parameter(60.0)

    def build(self, graph: hfg.Graph) -> None:
        """Put the planner before the follower."""
        plan = graph.add(PlanPath(), name="plan", active_for_s=8.1)
        follow = graph.add(FollowPath(patience=6.0), name="follow")
        shutter = graph.add(Shutter(n=3), name="shutter")
        self.go.inner.activates(plan.goal)
        plan.path.activates(follow.ports.slots["path"])
        follow.arrived.activates(self.arrived.inner)
        follow.blocked.activates(self.blocked.inner)
        plan.timeout.activates(self.blocked.inner)
        for node in (plan, follow):
            graph.connect(self.stop.inner, node.stop)
            graph.connect(self.localised.inner, node.localised)
        graph.connect(self.others.inner, plan.others)
        graph.connect(self.scan.inner, follow.scan)
        graph.connect(follow.command, self.command.inner)
        graph.connect(self.localised.inner, shutter.tick)
        graph.connect(shutter.look, self.look.inner)
        graph.promote(self.near, follow.ports.parameters["near"])
        graph.promote(self.aligned, follow.ports.parameters["aligned"])
        graph.promote(self.lane, plan.ports.parameters["lane"])
        graph.promote(self.queueing, follow.ports.parameters["queueing"])


class LookAround(hfg.Subgraph):
    """Turn once and take pictures: what is seen tells a robot that is in doubt where it is.

    Attributes:
      odometry: what the wheels say.
      command: the velocity.
      look: asks for a picture of what is ahead.
      begin: where activity arrives.
      done: it has turned once.
    """

    odometry = hfg.Input(Odometry)
    command, look = hfg.Output(Twist), hfg.Output(bool)
    begin = hfg.slot(type=object)
    done = hfg.Event()

    def build(self, graph: hfg.Graph) -> None:
        """Put a shutter beside the turn."""
        turn = graph.add(MoveRobot(turn=2 * math.pi), name="turn", active_for_s=15.1)
        shutter = graph.add(Shutter(n=3), name="shutter")
        self.begin.inner.activates(turn.begin)
        turn.done.activates(self.done.inner)
        turn.timeout.activates(self.done.inner)
        graph.connect(self.odometry.inner, turn.odometry)
        graph.connect(self.odometry.inner, shutter.tick)
        graph.connect(turn.command, self.command.inner)
        graph.connect(shutter.look, self.look.inner)
        for node in (turn, shutter):
            graph.gate(node, by=turn)
