"""The robot: perception as data flow, the mission as activity (figure 24), and the world around both.

    start ══ person_detection ══ object_tracking ══ follow_fast ══ object_tracking ...
                  ║   ║                 ║               ║
                  ║   ╚══ (lost) ═══════╝               ╚══ (no path) follow_slow ══ object_tracking
                  ╚══ (not found: where the person was last) follow_fast

There is no state machine: what is active is the state.
"""

from __future__ import annotations

import hfg
from examples.follow_person.messages import Imu, Photo, RingScan, Twist
from examples.follow_person.mission.finding import ObjectTracking, PersonDetection
from examples.follow_person.mission.following import FollowPerson
from examples.follow_person.mission.perceiving import Perception, SeePeople
from examples.follow_person.mission.world import RATE_HZ, World
from examples.follow_person.world import Conditions
from hfg import monitors as m
from hfg.nodes import driving, flow

STEPS = ("person_detection", "object_tracking", "follow_fast", "follow_slow")
"""The states of the mission (figure 24): it is in exactly one of them."""


class Robot(hfg.Subgraph):
    """A robot with its mission.

    Attributes:
      scan: of the laser.
      odometry: velocity by the wheels.
      imu: of the inertial unit.
      photo: pictures of the camera.
      command: the velocity that it wants.
      look: asks for a picture.
      begin: where activity arrives.
    """

    scan, odometry, imu = hfg.Input(RingScan), hfg.Input(Twist), hfg.Input(Imu)
    photo = hfg.Input(Photo)
    command, look = hfg.Output(Twist), hfg.Output(RingScan)
    begin = hfg.slot(type=object)

    def build(self, graph: hfg.Graph) -> None:
        """Figure 24."""
        perception = graph.add(Perception(), name="perception")
        person_detection = graph.add(PersonDetection(), name="person_detection")
        object_tracking = graph.add(ObjectTracking(), name="object_tracking")
        follow_fast = graph.add(FollowPerson(), name="follow_fast")
        follow_slow = graph.add(FollowPerson(backward=True, margin=0.03, speed=0.8, look_ahead=0.5), name="follow_slow")
        self.begin.inner.activates(person_detection.begin)
        person_detection.person.activates(object_tracking.found)
        object_tracking.person.activates(follow_fast.person)
        follow_fast.done.activates(object_tracking.begin)
        follow_fast.no_path.activates(follow_slow.person)
        follow_slow.done.activates(object_tracking.begin)
        # These are not in the figure: what happens if there is no way at all, and if the person is lost.
        follow_slow.no_path.activates(object_tracking.begin)
        object_tracking.lost.activates(person_detection.find)
        person_detection.gone.activates(follow_fast.person)
        for name in ("scan", "odometry", "imu", "photo"):
            graph.connect(self.ports.inputs[name].inner, perception.ports.inputs[name])
        graph.connect(object_tracking.person, perception.person, overflow="latest")
        for node in (person_detection, object_tracking):
            graph.connect(perception.scene, node.scene)
            graph.connect(perception.looks, node.looks)
        people = graph.add(SeePeople(), name="people")
        graph.connect(perception.seen, people.seen, overflow="latest")
        graph.connect(people.people, person_detection.people)
        graph.gate(people, by=person_detection)
        graph.gate(person_detection, by=person_detection)
        self._drive(graph)

    def _drive(self, graph: hfg.Graph) -> None:
        """Let the active follower drive, as long as nothing is in its way."""
        perception = graph["perception"].ports.outputs
        rejoin = graph.add(flow.Rejoin(values=2), name="either")
        brake = graph.add(driving.slow_for_obstacles(radius=0.34, margin=0.2, deceleration=2.0), name="brake")
        shutter = graph.add(flow.EveryNth(n=5), name="shutter")
        for number, name in enumerate(("follow_fast", "follow_slow")):
            follow = graph[name].ports
            graph.connect(perception["grid"], follow.inputs["grid"])
            graph.connect(perception["scene"], follow.inputs["scene"])
            graph.connect(follow.outputs["command"], rejoin.values[number])
        graph.connect(rejoin.out, brake.twist)
        graph.connect(perception["obstacles"], brake.obstacles)
        graph.connect(brake.out, self.command.inner)
        graph.connect(self.scan.inner, shutter.value)
        graph.connect(shutter.out, self.look.inner)


def build(seed: int = 1, *, metres: float = 1700.0, conditions: Conditions | None = None) -> hfg.Graph:
    """Build the world with a robot in it.

    Args:
      seed: decides what looks like chance.
      metres: how far the person walks.
      conditions: what the world is like.
    """
    graph = hfg.Graph("follow-person")
    world = graph.add(
        World(seed=seed, metres=metres, conditions=conditions or Conditions()), name="world", max_rate_hz=RATE_HZ
    )
    robot = graph.add(Robot(), name="robot")
    graph.start.activates(robot.begin)
    graph.connect(world.scan, robot.scan)
    graph.connect(world.odometry, robot.odometry)
    graph.connect(world.imu, robot.imu)
    graph.connect(world.photo, robot.photo, overflow="latest")
    graph.connect(robot.command, world.command)
    graph.connect(robot.look, world.look)
    _demand(graph)
    return graph


def _demand(graph: hfg.Graph) -> None:
    """State what must hold of each run, which fails otherwise."""
    steps = [m.active(f"robot/{step}") for step in STEPS]
    somewhere, two = steps[0] | steps[1], steps[0] & steps[1]
    for step in steps[2:]:
        somewhere, two = somewhere | step, two | (somewhere & step)
    drives = m.sent("robot.command", "value.vx > 0.01 | value.vx < -0.01")
    graph.monitor("one_step", m.never(two), on_violation="fail")
    graph.monitor("never_lost", m.leads_to(~somewhere, somewhere, within_s=0), on_violation="fail")
    graph.monitor("chosen", m.precedes(m.sent("robot/person_detection.person"), drives), on_violation="fail")
