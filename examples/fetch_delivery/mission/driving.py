"""Steps that drive: a way, to a pose, before a sign, up to a wall.

Each sends commands while it is active and tells when it is done. Begun by a slot, it is its own gate: `graph.gate(step,
by=step)`, so no code here asks whether it is active, and of all that drive only the active one sends commands.
"""

from __future__ import annotations

import math
from typing import Any

from annotated_types import Gt, Interval

import hfg
from examples.fetch_delivery import laws
from examples.fetch_delivery.messages import Odometry, Scan, Twist, Vector
from examples.fetch_delivery.mission.looking import Shutter
from examples.fetch_delivery.perception.following import FollowPath, Queue
from examples.fetch_delivery.perception.planning import PlanPath
from examples.fetch_delivery.perception.records import Localised, Sighting, Station, Wall
from hfg.nodes.robotics import Disk


class MoveRobot(hfg.Node):
    """Move a given distance in a given direction, by odometry only (paper, 6.1.3); or turn on the spot.

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
        if self.goal is None:
            self.goal = laws.destination(odometry, self.x, self.y, self.turn)
        twist = laws.move(odometry, self.goal, turns=bool(self.turn), speed=self.speed)
        if twist is None:
            self.done.trigger()
        return twist or Twist()

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
        twist = laws.stand_before(localised, self.target, wall, self.station, self.distance)
        self.steady = self.steady + 1 if twist is None else 0
        if self.steady >= 2:
            self.done.trigger()
        return twist or Twist()

    def _follow(self, localised: Localised) -> None:
        """Take in what was seen."""
        target = laws.sighted(localised, self.seen, self.station, self.target)
        self.seen = ()
        if target is not None:
            self.target, self.since = target, localised.stamp

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

    distance = hfg.Parameter(0.32, Gt(0), unit="m")
    speed = hfg.Parameter(0.36, Gt(0), unit="m/s")
    scan = hfg.Input(Scan)
    command = hfg.Output(Twist)
    done = hfg.Event()

    def process(self, scan: Scan) -> Twist:
        """Look ahead."""
        twist = laws.approach(scan, self.distance, self.speed)
        if twist is None:
            self.done.trigger()
        return twist or Twist()

    @hfg.slot
    def begin(self) -> None:
        """Take the activity."""


class GoTo(hfg.Subgraph):
    """Go to a pose of the map: plan a path around what stands about, and follow it.

    The activity comes with the goal to the planner, goes with the first path to the follower, and leaves when that has
    arrived or has come no nearer for long, or when there is no path for long. While another robot has taken the goal,
    the activity is with the queue. While it drives it looks about.

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
        """Connect the planner to the follower and to the queue."""
        plan = graph.add(PlanPath(), name="plan", active_for_s=8.1)
        follow = graph.add(FollowPath(patience=6.0), name="follow")
        queue, shutter = graph.add(Queue(), name="queue"), graph.add(Shutter(n=3), name="shutter")
        self.go.inner.activates(plan.goal)
        for free, taken in ((plan.path, plan.aside), (queue.free, follow.taken)):
            free.activates(follow.ports.slots["path"])
            taken.activates(queue.ports.slots["aside"])
        graph.connect(plan.path, queue.ports.slots["path"])
        graph.connect(plan.aside, follow.ports.slots["aside"], overflow="latest")
        follow.arrived.activates(self.arrived.inner)
        for end in (follow.blocked, queue.blocked, plan.timeout):
            end.activates(self.blocked.inner)
        for node in (plan, follow, queue):
            graph.connect(self.stop.inner, node.stop)
            graph.connect(self.localised.inner, node.localised)
        graph.connect(self.others.inner, plan.others)
        for drives in (follow, queue):
            graph.connect(self.scan.inner, drives.scan)
            graph.connect(drives.command, self.command.inner)
            graph.gate(drives, by=drives)
        graph.connect(self.localised.inner, shutter.tick)
        graph.connect(shutter.look, self.look.inner)
        graph.promote(self.near, follow.ports.parameters["near"])
        graph.promote(self.aligned, follow.ports.parameters["aligned"])
        graph.promote(self.lane, plan.ports.parameters["lane"])
        graph.promote(self.queueing, queue.ports.parameters["patience"])


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
        """Add a shutter to the turn."""
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
