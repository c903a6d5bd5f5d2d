"""The robot whose mission a state machine controls: perception as data flow, and one node that decides.

    sensors ── perception ── control ── commands, lamp, pictures

The node looks at what perception knows ten times a second. What it does is in `Mission`.
"""

from __future__ import annotations

from typing import Any

import hfg
from examples.fetch_delivery.machine.mission import Mission, Senses
from examples.fetch_delivery.messages import Odometry, Scan, Twist
from examples.fetch_delivery.mission import robot
from examples.fetch_delivery.perception.following import GiveWay
from examples.fetch_delivery.perception.records import Localised, Sighting, Sign, Station
from hfg.nodes.robotics import Disk


class Control(hfg.Node):
    """Step the state machine.

    Attributes:
      message: what the referee says.
      odometry: what the wheels say.
      scan: of the laser.
      localised: where the robot is.
      others: other robots.
      command: velocities.
      lamp: whether the lamp should be on.
      look_ahead: asks for a picture of what is ahead.
      look_into_basket: asks for one of the basket.
      ask: asks the cube detection to look again.
      forget: the number of a sign that is not where it should be.
      report: the number of a cube that cannot be delivered.
      entered: the state that was entered.
      begin: begin the mission.
      targets: bull's-eyes that are seen.
      signs: the digits that are known.
      filling: the filling stations that are known.
      number: a cube with this number lies in the basket.
      none: no cube lies there.
    """

    message = hfg.Input(str)
    odometry, scan = hfg.Input(Odometry), hfg.Input(Scan)
    localised, others = hfg.Input(Localised, optional=True), hfg.Input(list[Disk], optional=True)
    command, lamp = hfg.Output(Twist), hfg.Output(bool)
    look_ahead, look_into_basket = hfg.Output(bool), hfg.Output(bool)
    ask, forget, report = hfg.Event(), hfg.Event(int), hfg.Event(int)
    entered = hfg.Event(str)

    mission: hfg.State[Any] = hfg.State(None)
    newest: hfg.State[dict[str, Any]] = hfg.State(factory=dict)

    @hfg.slot
    def begin(self) -> None:
        """Begin."""
        self.mission = Mission(self.entered.trigger)
        self.entered.trigger(self.mission.state)

    @hfg.slot
    def targets(self, targets: list[Sighting]) -> None:
        """Keep them for the next tick."""
        self.newest["targets"] = targets

    @hfg.slot
    def signs(self, signs: dict[int, Sign]) -> None:
        """Keep them."""
        self.newest["signs"] = signs

    @hfg.slot
    def filling(self, filling: list[Station]) -> None:
        """Keep them."""
        self.newest["filling"] = filling

    @hfg.slot
    def number(self, number: int) -> None:
        """Keep it."""
        self.newest["basket"] = number

    @hfg.slot
    def none(self) -> None:
        """Keep that."""
        self.newest["basket"] = 0

    def process(
        self,
        message: str,
        odometry: Odometry,
        scan: Scan,
        localised: Localised | None = None,
        others: list[Disk] | None = None,
    ) -> None:
        """Decide."""
        if self.mission is None:
            return
        orders = self.mission.step(Senses(message, odometry, scan, localised, others or [], **self.newest))
        self.newest.pop("targets", None)
        self.command.send(orders.command)
        if orders.lamp is not None:
            self.lamp.send(orders.lamp)
        if orders.look_ahead:
            self.look_ahead.send(True)
        if orders.look_into_basket:
            self.look_into_basket.send(True)
        if orders.ask:
            self.newest.pop("basket", None)
            self.ask.trigger()
        if orders.forget is not None:
            self.forget.trigger(orders.forget)
        if orders.report is not None:
            self.report.trigger(orders.report)


class Robot(robot.Robot):
    """The same robot with another mind."""

    def build(self, graph: hfg.Graph) -> None:
        """Connect control to perception."""
        perception, control = graph.add(robot.Perception(), name="perception"), graph.add(Control(), name="control")
        self.begin.inner.activates(control.begin)
        for name in ("odometry", "scan", "front", "basket"):
            graph.connect(self.ports.inputs[name].inner, perception.ports.inputs[name])
        for name in ("message", "odometry", "scan"):
            graph.connect(self.ports.inputs[name].inner, control.ports.inputs[name])
        for name in ("localised", "others"):
            graph.connect(perception.ports.outputs[name], control.ports.inputs[name])
        for name in ("targets", "signs", "filling"):
            graph.connect(perception.ports.outputs[name], control.ports.slots[name])
        for name in ("number", "none"):
            graph.connect(perception.ports.events[name], control.ports.slots[name])
        graph.connect(control.ask, perception.ask)
        graph.connect(control.forget, perception.forget)
        give_way = graph.add(GiveWay(), name="give_way")
        graph.connect(perception.ports.outputs["around"], give_way.around)
        graph.connect(control.ports.outputs["command"], give_way.command)
        graph.connect(give_way.held, self.command.inner)
        for name in ("lamp", "look_ahead", "look_into_basket"):
            graph.connect(control.ports.outputs[name], self.ports.outputs[name].inner)
        graph.connect(control.report, self.report.inner)
        graph.connect(perception.unreadable, self.report.inner)
