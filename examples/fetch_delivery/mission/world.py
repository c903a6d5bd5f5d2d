"""The arena as a node: it moves on ten times a second of the run, and lends the robots wheels and senses."""

from __future__ import annotations

from typing import Annotated, Any, Literal, NamedTuple, TypeAlias, get_args

from annotated_types import Ge, Interval

import hfg
from examples.fetch_delivery.messages import Odometry, Scan, Twist
from examples.fetch_delivery.world import LIMITS, USUAL, Cameras, Fault, Simulation, Surroundings
from examples.fetch_delivery.world.robots import Limits
from hfg.images import Gray
from hfg.panels import Call, Change, Look, Scene, view

RATE_HZ = 10.0

Blocked: TypeAlias = Literal[
    "none",
    "filling 0",
    "filling 1",
    "filling 2",
    "filling 3",
    "delivery 1",
    "delivery 2",
    "delivery 3",
    "delivery 4",
]
"""No station, or one of them: its kind and number."""


class Push(NamedTuple):
    """A push, as seen from the robot: ahead, to its left, and counter-clockwise."""

    robot: Annotated[int, Interval(ge=0, le=3)] = 0
    ahead: Annotated[float, Interval(ge=-1, le=1), hfg.Parameter(unit="m")] = -0.3
    left: Annotated[float, Interval(ge=-1, le=1), hfg.Parameter(unit="m")] = 0.3
    turn: Annotated[float, Interval(ge=-3.2, le=3.2), hfg.Parameter(unit="rad")] = 0.4


def _within(name: str) -> Interval:
    """Return the bounds of a measure of the arena."""
    least, most = LIMITS[name]
    return Interval(ge=least, le=most)


class World(hfg.Node):
    """The simulated arena with its robots.

    Wheels and lasers measure at every step. A camera takes a picture when it is asked to, so what nobody needs is not
    even rendered. Add it with `max_rate_hz=RATE_HZ`.

    Attributes:
      seed: decides what looks like chance.
      speed: of the motors, at most.
      light: how bright it is, 1 as usual.
      radius: of the outer wall, to its corners.
      octagon: from its middle to each side.
      drift: of the wheels, in times of the usual one.
      noise: of the laser, as standard deviation.
      offset: by how much the laser measures too far.
      blur: how long the cameras expose, in times of the usual time.
      reach: how far from a sign people reach a basket.
      blocked: the station before which a crate stands.
      faults: what should go wrong.
      cameras: what draws the pictures.
      odometry: of each robot; their number is that of the robots.
      scan: of each robot.
      message: what the referee says.
      command: the velocity that a robot shall have; it holds for half a second.
      lamp: whether the green lamp of a robot shall be on.
      report: a robot says that it cannot deliver the cube in its basket; its number, or None if that cannot be read.
      look_ahead: asks for a picture of the front camera.
      look_into_basket: asks for a picture of the basket camera.
      front: the picture.
      basket: the picture.
      delivered: a cube was delivered at its station; its number.
    """

    seed = hfg.Parameter(1, Ge(0))
    speed = hfg.Parameter(0.6, Interval(gt=0, le=3), unit="m/s")
    light = hfg.Parameter(USUAL.light, _within("light"))
    radius = hfg.Parameter(USUAL.radius, _within("radius"), unit="m")
    octagon = hfg.Parameter(USUAL.octagon, _within("octagon"), unit="m")
    drift = hfg.Parameter(USUAL.drift, _within("drift"))
    noise = hfg.Parameter(USUAL.noise, _within("noise"), unit="m")
    offset = hfg.Parameter(USUAL.offset, _within("offset"), unit="m")
    blur = hfg.Parameter(USUAL.blur, _within("blur"))
    reach = hfg.Parameter(USUAL.reach, _within("reach"), unit="m")
    blocked = hfg.Parameter[Blocked]("none", choices=get_args(Blocked))
    faults = hfg.Parameter[tuple[Fault, ...]](())
    cameras = hfg.Parameter[Cameras]("light")
    odometry = hfg.Outputs(Odometry)
    scan = hfg.Outputs(Scan, "odometry")
    message = hfg.Output(str)
    front = hfg.Events(Gray, "odometry")
    basket = hfg.Events(Gray, "odometry")
    delivered = hfg.Events(int, "odometry")

    block_station = Change("Block a station", {"blocked": "filling 1"}, "A crate stands before it.")
    dim_light = Change("Dim the light", {"light": 0.05}, "The cameras see hardly anything.")
    push_robot = Call("Push a robot", "push", "Its wheels do not notice, so it has to find out where it is.")

    simulation: hfg.State[Any] = hfg.State(None)
    pictures = hfg.State(0)

    def setup(self) -> None:
        """Build the arena anew."""
        limits = Limits(speed=self.speed)
        self.simulation = Simulation(
            self.seed,
            robots=len(self.odometry),
            limits=limits,
            faults=self.faults,
            cameras=self.cameras,
            surroundings=Surroundings(**{name: getattr(self, name) for name in LIMITS}),
        )

    def process(self) -> None:
        """Let a tenth of a second pass, and measure."""
        self._set_up()
        before = [len(score.delivered) for score in self.simulation.scores]
        self.simulation.step(1 / RATE_HZ)
        for robot, score in enumerate(self.simulation.scores):
            self.odometry[robot].send(self.simulation.odometry(robot))
            self.scan[robot].send(self.simulation.scan(robot))
            for _, cube in score.delivered[before[robot] :]:
                self.delivered[robot].trigger(cube)
        self.message.send(self.simulation.message())

    def _set_up(self) -> None:
        """Let the world be as the parameters are now."""
        simulation = self.simulation
        simulation.light = self.light
        kind, _, number = self.blocked.partition(" ")
        simulation.blocked = simulation.arena.station(kind, int(number)) if number else None
        simulation.limit(self.speed)

    @view("The arena from above")
    def seen_from_above(self, look: Look) -> Scene:
        """Robots with their laser rays, the stations, the people who serve them, and what stands in the way."""
        from examples.fetch_delivery.showing.live import arena  # only for pages

        scans = [look.latest(f"scan[{number}]") for number in range(len(self.simulation.robots))]
        return arena(self.simulation, scans)

    @hfg.slot
    def push(self, push: Push) -> None:
        """Push a robot."""
        if push.robot >= len(self.simulation.robots):
            self.log.warning("there is no robot %d that could be pushed", push.robot)
            return
        self.simulation.push(push.robot, push.ahead, push.left, push.turn)

    @hfg.Slots(Twist, "odometry")
    def command(self, robot: int, twist: Twist) -> None:
        """Drive so."""
        self.simulation.command(robot, twist)

    @hfg.Slots(bool, "odometry")
    def lamp(self, robot: int, on: bool) -> None:
        """Switch the lamp."""
        self.simulation.set_lamp(robot, on)

    @hfg.Slots(int | None, "odometry")
    def report(self, robot: int, number: int | None) -> None:
        """Note it down."""
        self.simulation.report(robot, number)

    @hfg.Slots(bool, "odometry")
    def look_ahead(self, robot: int) -> None:
        """Take a picture."""
        self.pictures += 1
        self.front[robot].trigger(self.simulation.front_picture(robot))

    @hfg.Slots(bool, "odometry")
    def look_into_basket(self, robot: int) -> None:
        """Take a picture."""
        self.pictures += 1
        self.basket[robot].trigger(self.simulation.basket_picture(robot))
