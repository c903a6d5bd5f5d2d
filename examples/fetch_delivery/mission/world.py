"""The arena as a node: it moves on ten times a second of the run, and lends the robots wheels and senses."""

from __future__ import annotations

from typing import Any

from annotated_types import Ge, Interval

import hfg
from examples.fetch_delivery.messages import Odometry, Scan, Twist
from examples.fetch_delivery.world import Cameras, Fault, Simulation
from examples.fetch_delivery.world.robots import Limits
from hfg.images import Gray

RATE_HZ = 10.0


class World(hfg.Node):
    """The simulated arena with its robots.

    Wheels and lasers measure at every step. A camera takes a picture when it is asked to, so what nobody needs is not
    even rendered. Add it with `max_rate_hz=RATE_HZ`.

    Attributes:
      seed: decides what looks like chance.
      speed: of the motors.
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
    faults = hfg.Parameter[tuple[Fault, ...]](())
    cameras = hfg.Parameter[Cameras]("light")
    odometry = hfg.Outputs(Odometry)
    scan = hfg.Outputs(Scan, "odometry")
    message = hfg.Output(str)
    front = hfg.Events(Gray, "odometry")
    basket = hfg.Events(Gray, "odometry")
    delivered = hfg.Events(int, "odometry")

    simulation: hfg.State[Any] = hfg.State(None)
    pictures = hfg.State(0)

    def setup(self) -> None:
        """Build the arena anew."""
        limits = Limits(speed=self.speed)
        self.simulation = Simulation(
            self.seed, robots=len(self.odometry), limits=limits, faults=self.faults, cameras=self.cameras
        )

    def process(self) -> None:
        """Let a tenth of a second pass, and measure."""
        before = [len(score.delivered) for score in self.simulation.scores]
        self.simulation.step(1 / RATE_HZ)
        for robot, score in enumerate(self.simulation.scores):
            self.odometry[robot].send(self.simulation.odometry(robot))
            self.scan[robot].send(self.simulation.scan(robot))
            for _, cube in score.delivered[before[robot] :]:
                self.delivered[robot].trigger(cube)
        self.message.send(self.simulation.message())

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
