"""Ports that belong together, as records that connect as one: a type checker sees each port and its type.

connect_step(graph, explore, senses, orders)        all steps that drive
connect_errand(graph, fetch, senses, orders, hands) those that go to a station as well
"""

from __future__ import annotations

from typing import NamedTuple

import hfg
from examples.fetch_delivery.messages import Odometry, Scan, Twist
from examples.fetch_delivery.perception.records import Localised, Sighting
from hfg.nodes.robotics import Disk
from hfg.ports.base import Source, Target


class Senses(NamedTuple):
    """Where each step that drives gets its measurements from."""

    localised: Source[Localised]
    odometry: Source[Odometry]
    scan: Source[Scan]
    others: Source[list[Disk]]


class Orders(NamedTuple):
    """Where its commands go, and its requests for pictures of the view ahead."""

    command: Target[Twist]
    look: Target[bool]


class Hands(NamedTuple):
    """Where an errand learns of bull's-eyes and of the basket, and where its lamp and requests for pictures are."""

    targets: Source[list[Sighting]]
    number: Source[int]
    none: Source[object]
    lamp: Target[bool]
    look_into_basket: Target[bool]


class Driving(hfg.Subgraph):
    """The ports of every step that drives by what it senses.

    Attributes:
      localised: where the robot is.
      odometry: what the wheels say.
      scan: of the laser.
      others: other robots.
      command: velocities.
      look: asks for a picture of what is ahead.
    """

    localised, odometry, scan = hfg.Input(Localised), hfg.Input(Odometry), hfg.Input(Scan)
    others = hfg.Input(list[Disk])
    command, look = hfg.Output(Twist), hfg.Output(bool)

    def inner_senses(self) -> Senses:
        """Return its inputs, as they are seen from inside."""
        return Senses(self.localised.inner, self.odometry.inner, self.scan.inner, self.others.inner)

    def inner_orders(self) -> Orders:
        """Return its outputs, as they are seen from inside."""
        return Orders(self.command.inner, self.look.inner)


class AtStation(Driving):
    """What every errand to a station needs, and what it gives.

    Attributes:
      targets: bull's-eyes that are seen.
      number: a cube with this number lies in the basket.
      none: no cube lies there.
      lamp: whether the lamp should be on.
      look_into_basket: asks for one of the basket.
      ask: asks the cube detection to look again.
      done: a cube has changed hands.
    """

    targets = hfg.Input(list[Sighting])
    number, none = hfg.slot(type=int), hfg.slot(type=object)
    lamp, look_into_basket = hfg.Output(bool), hfg.Output(bool)
    ask, done = hfg.Event(), hfg.Event(object)

    def inner_hands(self) -> Hands:
        """Return the ports of an errand, as they are seen from inside."""
        return Hands(
            self.targets.inner, self.number.inner, self.none.inner, self.lamp.inner, self.look_into_basket.inner
        )


def connect_step(graph: hfg.Graph, step: Driving, senses: Senses, orders: Orders) -> None:
    """Connect a step that drives."""
    graph.connect(senses.odometry, step.odometry)
    graph.connect(senses.scan, step.scan)
    graph.connect(senses.localised, step.localised)
    graph.connect(senses.others, step.others)
    graph.connect(step.command, orders.command)
    graph.connect(step.look, orders.look)


def connect_errand(graph: hfg.Graph, errand: AtStation, senses: Senses, orders: Orders, hands: Hands) -> None:
    """Connect an errand to a station."""
    connect_step(graph, errand, senses, orders)
    graph.connect(hands.targets, errand.targets)
    graph.connect(hands.number, errand.number)
    graph.connect(hands.none, errand.none)
    graph.connect(errand.lamp, hands.lamp)
    graph.connect(errand.look_into_basket, hands.look_into_basket)
