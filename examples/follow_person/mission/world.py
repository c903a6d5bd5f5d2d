"""The world as a node: it moves on ten times a second of the run, and lends the robot wheels and senses."""

from __future__ import annotations

from typing import Any

from annotated_types import Ge

import hfg
from examples.follow_person.messages import Imu, Photo, RingScan, Twist
from examples.follow_person.world import Conditions, Simulation

RATE_HZ = 10.0


class World(hfg.Node):
    """The simulated outdoor world with its robot.

    Laser, wheels and inertial unit measure at every step. The camera takes a picture on request. Add it with
    `max_rate_hz=RATE_HZ`. It ends when the person has walked far enough.

    Attributes:
      seed: decides what looks like chance.
      conditions: what the world is like.
      metres: how far the person walks.
      scan: of the laser.
      odometry: velocity of the robot, by its wheels.
      imu: of the inertial unit.
      photo: a picture of the camera.
      command: the velocity that the robot should have; it holds for a third of a second.
      look: asks for a picture.
    """

    seed = hfg.Parameter(1, Ge(0))
    conditions = hfg.Parameter[Conditions](Conditions())
    metres = hfg.Parameter(1700.0, Ge(0), unit="m")
    scan = hfg.Output(RingScan)
    odometry = hfg.Output(Twist)
    imu = hfg.Output(Imu)
    photo = hfg.Event(Photo)

    simulation: hfg.State[Any] = hfg.State(None)
    pictures = hfg.State(0)
    is_over = hfg.State(False)

    def setup(self) -> None:
        """Build the world."""
        self.simulation = Simulation(self.seed, self.conditions)

    def process(self) -> None:
        """Let a tenth of a second pass, and measure."""
        if self.simulation.score.walked_m >= self.metres:
            self.is_over = True
            raise hfg.EndOfStream
        self.simulation.step(1 / RATE_HZ)
        self.scan.send(self.simulation.scan())
        self.odometry.send(self.simulation.odometry())
        self.imu.send(self.simulation.imu())

    @hfg.slot
    def command(self, command: Twist) -> None:
        """Drive so."""
        self.simulation.command(command)

    @hfg.slot
    def look(self, tick: RingScan) -> None:
        """Take a picture."""
        self.pictures += 1
        self.photo.trigger(self.simulation.photo())
