"""One robot: perception as data flow, the mission as activity (figure 19), and the arena around both.

    start ══ wait_for_start ══ advance ══ fetch ══ bring ══ read_cube ══ lookup ══ deliver ══ bring ══ fetch ...
                                            ║        ║          ║          ║                    ║
                                            ║        ║          ╚════ explore                   ╚══ read_cube
                                            ╚════════╩══ (no cube after all, or one to give back)

There is no state machine: what is active is the state. `deliver` and `fetch` are built of the same `Visit`. `bring`
counts how often a cube was brought in vain: an unwanted cube is reported and exchanged for another one.
"""

from __future__ import annotations

import math
from dataclasses import asdict

import hfg
from examples.fetch_delivery.messages import Odometry, Scan, Twist
from examples.fetch_delivery.mission.bundles import Hands, Orders, Senses, connect_errand, connect_step
from examples.fetch_delivery.mission.driving import MoveRobot
from examples.fetch_delivery.mission.errands import DeliverCube, Explore, FetchCube, MapLookup
from examples.fetch_delivery.mission.looking import Shutter
from examples.fetch_delivery.mission.world import RATE_HZ, World
from examples.fetch_delivery.perception.cube import CubeWatch
from examples.fetch_delivery.perception.following import GiveWay
from examples.fetch_delivery.perception.laser import FollowRobots, other_robots
from examples.fetch_delivery.perception.localising import Localise
from examples.fetch_delivery.perception.records import Localised, Sighting, Sign, Station
from examples.fetch_delivery.perception.sighting import find_targets, read_digits
from examples.fetch_delivery.perception.signs import SignMap
from examples.fetch_delivery.perception.stations import StationMap
from examples.fetch_delivery.world import USUAL, Cameras, Fault, Surroundings
from hfg.images import Gray
from hfg.nodes import activity, flow
from hfg.nodes.robotics import Disk
from hfg.panels import Look, Scene, view


class Perception(hfg.Subgraph):
    """What the robot knows: where it is, who else is there, where signs and stations are, what lies in its basket.

    Attributes:
      odometry: what the wheels say.
      scan: of the laser.
      front: pictures of what is ahead.
      basket: pictures of the basket.
      ask: check again what is in the basket.
      forget: the number of a sign that is not where it should be.
      localised: where the robot is.
      others: other robots, in the map frame.
      around: the same, in the robot's own frame.
      targets: bull's-eyes that are seen.
      signs: the digits that are known.
      filling: the filling stations that are known.
      number: a cube with this number lies in the basket.
      none: no cube lies there.
      unreadable: a cube lies there whose code cannot be read.
    """

    odometry, scan = hfg.Input(Odometry), hfg.Input(Scan)
    front, basket = hfg.Input(Gray), hfg.Input(Gray)
    ask, forget = hfg.slot(type=object), hfg.slot(type=int)
    localised = hfg.Output(Localised)
    others, around = hfg.Output(list[Disk]), hfg.Output(list[Disk])
    targets, signs = hfg.Output(list[Sighting]), hfg.Output(dict[int, Sign])
    filling = hfg.Output(list[Station])
    number, none, unreadable = hfg.Event(int), hfg.Event(), hfg.Event()

    def build(self, graph: hfg.Graph) -> None:
        """Connect what measures with what learns."""
        # In step also where a cut lies before it: who measures goes on when this has been understood.
        localise = graph.add(Localise(), name="localise", release="sequential")
        robots = graph.add(other_robots(), name="robots", release="sequential")
        others = graph.add(FollowRobots(), name="others", release="sequential")
        targets, digits = graph.add(find_targets(), name="targets"), graph.add(read_digits(), name="digits")
        signs, stations = graph.add(SignMap(), name="signs"), graph.add(StationMap(), name="stations")
        cube = graph.add(CubeWatch(), name="cube")

        graph.connect(self.scan.inner, localise.scan)
        graph.connect(self.odometry.inner, localise.odometry)
        for laser in (robots, others):
            graph.connect(self.scan.inner, laser.scan)
            graph.connect(localise.localised, laser.localised)
        graph.connect(robots.out, others.seen)
        graph.connect(localise.localised, self.localised.inner)
        graph.connect(others.others, self.others.inner)
        graph.connect(others.around, self.around.inner)

        # Pictures come when somebody has asked, poses ten times a second: each picture meets the pose of its moment.
        for eyes, learner, seen in ((targets, stations, stations.targets), (digits, signs, signs.sightings)):
            then = graph.add(flow.SampleAndHold(), name=f"then_{eyes.place.name}")
            graph.connect(self.front.inner, eyes.image)
            graph.connect(localise.localised, then.value)
            graph.connect(eyes.out, then.tick)
            graph.connect(eyes.out, seen)
            graph.connect(then.held, learner.localised)
        graph.connect(targets.out, self.targets.inner)
        graph.connect(digits.out, localise.sightings)
        graph.connect(signs.signs, localise.signs)
        graph.connect(signs.signs, self.signs.inner)
        graph.connect(stations.filling, self.filling.inner)
        graph.connect(self.forget.inner, signs.forget)

        graph.connect(self.basket.inner, cube.image)
        graph.connect(self.ask.inner, cube.ask)
        graph.connect(cube.number, self.number.inner)
        graph.connect(cube.none, self.none.inner)
        graph.connect(cube.unreadable, self.unreadable.inner)


class NumberWhen(flow.SampleAndHold):
    """Keep the newest number, and give it at each tick.

    Attributes:
      held: the number.
    """

    held = hfg.Output(int)


class Robot(hfg.Subgraph):
    """A robot with its mission.

    Attributes:
      odometry: what the wheels say.
      scan: of the laser.
      message: what the referee says.
      front: pictures of what is ahead.
      basket: pictures of the basket.
      command: the velocity that it wants.
      lamp: whether its lamp should be on.
      look_ahead: asks for a picture of what is ahead.
      look_into_basket: asks for one of the basket.
      begin: where activity arrives.
      report: the cube in the basket cannot be delivered, because its sign was not found or its station did not serve;
        its number, or None if its code cannot be read.
    """

    odometry, scan, message = hfg.Input(Odometry), hfg.Input(Scan), hfg.Input(str)
    front, basket = hfg.Input(Gray), hfg.Input(Gray)
    command, lamp = hfg.Event(Twist), hfg.Output(bool)
    look_ahead, look_into_basket = hfg.Output(bool), hfg.Output(bool)
    begin = hfg.slot(type=object)
    report = hfg.Event(int | None)

    @view("What the robot sees")
    def seen(self, look: Look) -> Scene:
        """The last pictures of both cameras, with what was found in them, and the active step."""
        from examples.fetch_delivery.showing.live import eyes  # only for pages

        return eyes(
            look.latest("front"),
            look.latest("perception/targets.out") or [],
            look.latest("perception/digits.out") or [],
            look.latest("basket"),
            max(look.active(), key=len, default="nothing is active").replace("/", ", "),
        )

    def build(self, graph: hfg.Graph) -> None:
        """Figure 19."""
        perception = graph.add(Perception(), name="perception")
        wait_for_start = graph.add(activity.WaitForText(wanted="start"), name="wait_for_start")
        advance = graph.add(MoveRobot(x=1.0, y=1.0, turn=math.pi / 2), name="advance", active_for_s=10.1)
        fetch, deliver = graph.add(FetchCube(), name="fetch"), graph.add(DeliverCube(), name="deliver")
        read_cube = graph.add(activity.WaitForMessage(), name="read_cube", active_for_s=10.1)
        newest, lookup = graph.add(flow.SampleAndHold(), name="newest"), graph.add(MapLookup(), name="lookup")
        explore, bring = graph.add(Explore(), name="explore"), graph.add(activity.Retry(attempts=2), name="bring")

        self.begin.inner.activates(wait_for_start.begin)
        wait_for_start.received.activates(advance.begin)
        advance.done.activates(fetch.begin)
        advance.timeout.activates(fetch.begin)
        fetch.done.activates(bring.begin)
        bring.attempt.activates(read_cube.begin)
        read_cube.received.activates(lookup.key)
        read_cube.timeout.activates(fetch.begin)
        lookup.sign.activates(deliver.begin)
        lookup.unknown.activates(explore.begin)
        explore.done.activates(read_cube.begin)
        explore.gave_up.activates(fetch.begin)
        deliver.done.activates(bring.done)
        deliver.gave_up.activates(bring.gave_up)
        bring.finished.activates(fetch.begin)
        bring.exhausted.activates(fetch.begin)

        graph.connect(self.message.inner, wait_for_start.message)
        graph.connect(read_cube.received, newest.tick)
        graph.connect(perception.signs, newest.value)
        graph.connect(newest.held, lookup.map)
        graph.connect(perception.number, read_cube.message)
        graph.connect(read_cube.activated, perception.ask, overflow="latest")
        graph.connect(lookup.sign, explore.found)
        graph.connect(perception.unreadable, self.report.inner)
        # A sign that could not be served is not where the map has it, and a cube that is given back is not taken again.
        in_vain, refused = (graph.add(NumberWhen(), name=name) for name in ("in_vain", "refused"))
        for number, when in ((in_vain, deliver.gave_up), (refused, bring.exhausted)):
            graph.connect(read_cube.received, number.value, overflow="latest")
            graph.connect(when, number.tick)
        graph.connect(in_vain.held, perception.forget)
        for given_back in (explore.gave_up, refused.held.sent):
            graph.connect(given_back, self.report.inner)
            graph.connect(given_back, fetch.unwanted)
        for step in (wait_for_start, advance, read_cube):
            graph.gate(step, by=step)
        self._feed(graph, perception, advance, fetch, deliver, explore)

    def _feed(
        self,
        graph: hfg.Graph,
        perception: Perception,
        advance: MoveRobot,
        fetch: FetchCube,
        deliver: DeliverCube,
        explore: Explore,
    ) -> None:
        """Lead data to the mission, and commands from it."""
        graph.connect(self.odometry.inner, perception.odometry)
        graph.connect(self.scan.inner, perception.scan)
        graph.connect(self.front.inner, perception.front)
        graph.connect(self.basket.inner, perception.basket)
        # It turns to the middle and looks at it: so it knows which sides of the octagon are filling stations.
        shutter = graph.add(Shutter(n=4), name="look_first")
        graph.connect(self.scan.inner, shutter.tick)
        graph.connect(shutter.look, self.look_ahead.inner)
        graph.gate(shutter, by=advance)
        basket = graph.add(Shutter(n=2), name="look_again")
        graph.connect(self.scan.inner, basket.tick)
        graph.connect(basket.look, self.look_into_basket.inner)
        graph.gate(basket, by=graph["read_cube"])
        graph.connect(self.odometry.inner, advance.odometry)
        # Of all that drive only the active one sends commands; whichever it is, others come first.
        give_way = graph.add(GiveWay(), name="give_way")
        graph.connect(perception.around, give_way.around)
        graph.connect(give_way.held, self.command.inner)
        graph.connect(advance.command, give_way.command)
        senses = Senses(perception.localised, self.odometry.inner, self.scan.inner, perception.others)
        orders = Orders(give_way.ports.slots["command"], self.look_ahead.inner)
        hands = Hands(
            perception.targets, perception.number, perception.none, self.lamp.inner, self.look_into_basket.inner
        )
        for errand in (fetch, deliver):
            connect_errand(graph, errand, senses, orders, hands)
            graph.connect(errand.ask, perception.ask, overflow="latest")
        graph.connect(perception.filling, fetch.stations)
        connect_step(graph, explore, senses, orders)


def build(
    seed: int = 1,
    robots: int = 1,
    *,
    speed: float = 0.6,
    faults: tuple[Fault, ...] = (),
    gated: bool = True,
    cut: bool = False,
    kind: type[Robot] = Robot,
    cameras: Cameras = "light",
    surroundings: Surroundings = USUAL,
) -> hfg.Graph:
    """Build the arena with robots in it, each with a mission of its own.

    Args:
      seed: decides what looks like chance.
      robots: how many, one to four.
      speed: of their motors, in m/s.
      faults: what should go wrong.
      gated: pictures are taken when a step asks for them; else all the time, to see what that saves.
      cut: perception and control of the robots run in a process each, beside that of the arena; in virtual time, which
        processes do not share, they are cut as well, but run on one loop.
      kind: what sort of robot; all have the same ports.
      cameras: what draws the pictures: the light renderer, or MuJoCo, which needs a package and OpenGL.
      surroundings: how large the arena is, and how badly is measured in it.
    """
    graph = hfg.Graph("fetch-delivery")
    if cut:
        for group in ("perception", "control"):
            graph.group(group, process=True)
    world = graph.add(
        World(seed=seed, speed=speed, faults=faults, cameras=cameras, odometry=robots, **asdict(surroundings)),
        name="world",
        max_rate_hz=RATE_HZ,
    )
    for number in range(robots):
        robot = graph.add(kind(), name=f"robot_{number}", group="control" if cut else None)
        if cut:
            graph.move(f"robot_{number}/perception", group="perception")
        graph.start.activates(robot.begin)
        graph.connect(world.odometry[number], robot.odometry)
        graph.connect(world.scan[number], robot.scan)
        graph.connect(world.message, robot.message)
        graph.connect(world.front[number], robot.front)
        graph.connect(world.basket[number], robot.basket, overflow="latest")  # only the newest picture matters
        graph.connect(robot.command, world.command[number])
        graph.connect(robot.lamp, world.lamp[number])
        graph.connect(robot.report, world.report[number])
        if gated:
            graph.connect(robot.look_ahead, world.look_ahead[number])
            graph.connect(robot.look_into_basket, world.look_into_basket[number])
            continue
        for camera, n in ((world.look_ahead, 2), (world.look_into_basket, 4)):
            shutter = graph.add(Shutter(n=n))
            graph.connect(world.scan[number], shutter.tick)
            graph.connect(shutter.look, camera[number])
    return graph
