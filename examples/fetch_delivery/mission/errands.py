"""Where to go: a filling station that is free, the delivery station of a cube, or on along the wall to find it.

Fetching and delivering are a choice of station and a `Visit`; they differ in what chooses, and in what is waited for.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from annotated_types import Ge, Gt

import hfg
from examples.fetch_delivery.messages import Vector
from examples.fetch_delivery.mission.bundles import AtStation, Driving, connect_errand
from examples.fetch_delivery.mission.driving import GoTo, LookAround
from examples.fetch_delivery.mission.looking import Shutter
from examples.fetch_delivery.mission.visiting import Visit
from examples.fetch_delivery.perception.records import Localised, Sign, Station, wrapped
from examples.fetch_delivery.perception.signs import delivery_station
from hfg.nodes import activity
from hfg.nodes.robotics import Disk


class SelectFilling(hfg.Node):
    """Choose a filling station: near, free, and not one where it has just failed.

    As long as no filling station is known, each side of the octagon may be one.

    Attributes:
      grudge: for how long a failure counts.
      localised: where the robot is.
      others: other robots, in step.
      stations: the filling stations that are known.
      begin: where activity arrives.
      again: it failed at the chosen one; where activity arrives too.
      station: the chosen one.
    """

    grudge = hfg.Parameter(40.0, Ge(0), unit="s")
    localised = hfg.Input(Localised)
    others = hfg.Input(list[Disk])
    station = hfg.Event(Station)
    known: hfg.State[list[Station]] = hfg.State(factory=list)
    chosen: hfg.State[Any] = hfg.State(None)
    failures: hfg.State[dict[tuple[int, int], float]] = hfg.State(factory=dict)

    def process(self, localised: Localised, others: list[Disk]) -> None:
        """Choose, once the robot knows where it is."""
        if not localised.sure:
            return
        stations = self.known or [Station.side(localised.shape, number) for number in range(8)]
        self.chosen = min(stations, key=lambda station: self._cost(station, localised, others))
        self.station.trigger(self.chosen)

    def _cost(self, station: Station, localised: Localised, others: list[Disk]) -> float:
        """Say how dear it is, in metres of way."""
        x, y, _ = localised.pose
        turn = abs(math.remainder(math.atan2(y, x) - station.theta, 2 * math.pi))
        taken = any(math.dist((one.x, one.y), station.before(0.6)[:2]) < 0.9 for one in others)
        failed = localised.stamp - self.failures.get(_key(station), -math.inf) < self.grudge
        return 2.5 * turn + 6.0 * taken + 12.0 * failed

    @hfg.slot
    def stations(self, stations: list[Station]) -> None:
        """Keep them."""
        self.known = stations

    @hfg.slot
    def begin(self) -> None:
        """Take the activity."""

    @hfg.slot
    def again(self) -> None:
        """Remember where it failed."""
        self.failures[_key(self.chosen)] = hfg.now()


def _key(station: Station) -> tuple[int, int]:
    return round(10 * station.x), round(10 * station.y)


class FetchCube(AtStation):
    """Fetch a cube from one of the filling stations; where it fails, try another one.

    Attributes:
      stations: the filling stations that are known.
      unwanted: a cube with this number is to be exchanged for another one.
      begin: where activity arrives.
    """

    stations, unwanted = hfg.slot(type=list[Station]), hfg.slot(type=int)
    begin = hfg.slot(type=object)

    def build(self, graph: hfg.Graph) -> None:
        """Put the choice before the visit."""
        select = graph.add(SelectFilling(), name="select", active_for_s=5.1)
        look_around, visit = graph.add(LookAround(), name="look_around"), graph.add(Visit(queueing=8.0), name="visit")
        self.begin.inner.activates(select.begin)
        select.station.activates(visit.begin)
        visit.gave_up.activates(select.again)
        select.timeout.activates(look_around.begin)
        look_around.done.activates(select.begin)
        graph.connect(self.odometry.inner, look_around.odometry)
        graph.connect(look_around.command, self.command.inner)
        graph.connect(look_around.look, self.look.inner)
        visit.done.activates(self.done.inner)
        graph.gate(select, by=select)
        graph.connect(self.localised.inner, select.localised)
        graph.connect(self.others.inner, select.others)
        graph.connect(self.stations.inner, select.stations)
        graph.connect(self.unwanted.inner, visit.unwanted)
        relay(graph, self, visit)


class Destination(hfg.Node):
    """Say which station belongs to a sign.

    Attributes:
      begin: the sign; where activity arrives.
      station: the station.
    """

    station = hfg.Event(Station)

    @hfg.slot
    def begin(self, sign: Sign) -> None:
        """Say it."""
        self.station.trigger(delivery_station(sign))


class DeliverCube(AtStation):
    """Bring the cube to the station whose sign is where the map has it; try that more than once.

    When it gives up it looks into the basket first: perhaps the cube was taken at the last moment.

    Attributes:
      begin: where the sign is; where activity arrives.
      gave_up: the cube could not be delivered, and lies in the basket still.
    """

    begin = hfg.slot(type=Sign)
    gave_up = hfg.Event(object)

    def build(self, graph: hfg.Graph) -> None:
        """Put the sign before the visit, and tries around that."""
        destination, tries = (
            graph.add(Destination(), name="destination"),
            graph.add(activity.Retry(attempts=3), name="tries"),
        )
        visit = graph.add(Visit(loading=False), name="visit")
        self.begin.inner.activates(destination.begin)
        destination.station.activates(tries.begin)
        tries.attempt.activates(visit.begin)
        visit.done.activates(tries.done)
        visit.gave_up.activates(tries.gave_up)
        tries.finished.activates(self.done.inner)
        relay(graph, self, visit)

        confirm = graph.add(activity.WaitForMessage(), name="confirm", active_for_s=4.1)
        shutter = graph.add(Shutter(n=2), name="shutter")
        tries.exhausted.activates(confirm.begin)
        confirm.received.activates(self.gave_up.inner)
        confirm.timeout.activates(self.done.inner)
        graph.connect(confirm.activated, self.ask.inner)
        graph.connect(self.number.inner, confirm.message)
        graph.connect(self.scan.inner, shutter.tick)
        graph.connect(shutter.look, self.look_into_basket.inner)
        for looks in (confirm, shutter):
            graph.gate(looks, by=confirm)


def relay(graph: hfg.Graph, outer: AtStation, visit: Visit) -> None:
    """Lead data in and out of an errand's visit."""
    connect_errand(graph, visit, outer.inner_senses(), outer.inner_orders(), outer.inner_hands())
    graph.connect(visit.ask, outer.ask.inner)


class MapLookup(hfg.Node):
    """Find the sign of a cube in the newest map (figure 18).

    Attributes:
      key: the number on the cube.
      map: the signs that are known.
      sign: where it is.
      unknown: it is not in the map; the number.
    """

    key = hfg.Input(int)
    map = hfg.Input(dict[int, Sign], optional=True)
    sign = hfg.Output(Sign)
    unknown = hfg.Event(int)

    def process(self, key: int, map: dict[int, Sign] | None = None) -> Sign | None:  # noqa: A002
        """Look it up."""
        if not map or key not in map:
            self.unknown.trigger(key)
            return None
        return map[key]


class NextView(hfg.Node):
    """Say from where to look next: on along the wall, counter-clockwise, looking ahead and outwards.

    Attributes:
      radius: from the middle of the arena.
      step: how far to go on, as an angle.
      most: this number of views in a row is more than once around; then it gives up.
      localised: where the robot is.
      goal: the pose.
      gave_up: nothing was found.
      begin: the number that is looked for; where activity arrives.
      found: something was found, so counting starts over.
    """

    radius = hfg.Parameter(4.0, Gt(0), unit="m")
    step = hfg.Parameter(0.5, Gt(0), unit="rad")
    most = hfg.Parameter(16, Gt(0))
    localised = hfg.Input(Localised)
    goal = hfg.Event(Vector)
    gave_up = hfg.Event(int)
    wanted = hfg.State(0)
    views = hfg.State(0)

    def process(self, localised: Localised) -> None:
        """Say it, once the robot knows where it is."""
        if not localised.sure:
            return
        self.views += 1
        if self.views > self.most:
            self.views = 0
            self.gave_up.trigger(self.wanted)
            return
        at = math.atan2(localised.pose[1], localised.pose[0]) + self.step
        x, y = self.radius * math.cos(at), self.radius * math.sin(at)
        self.goal.trigger(np.array([x, y, float(wrapped(at + 0.6))]))

    @hfg.slot
    def begin(self, number: int) -> None:
        """Take the activity."""
        if number != self.wanted:
            self.wanted, self.views = number, 0

    @hfg.slot
    def found(self) -> None:
        """Start over the next time."""
        self.views = 0


class Explore(Driving):
    """Drive on to the next view (paper, 6.1.2); what is seen on the way goes into the map of signs.

    Attributes:
      begin: the number that is looked for; where activity arrives.
      found: something was found.
      done: it has driven on; look again into the map.
      gave_up: all was looked at.
    """

    begin, found = hfg.slot(type=int), hfg.slot(type=object)
    done, gave_up = hfg.Event(object), hfg.Event(int)

    def build(self, graph: hfg.Graph) -> None:
        """Put the choice of the view before the way there."""
        view = graph.add(NextView(), name="view", active_for_s=5.1)
        look_around = graph.add(LookAround(), name="look_around")
        go_to = graph.add(GoTo(near=0.3, aligned=0.2), name="go_to", active_for_s=15.1)
        self.begin.inner.activates(view.begin)
        view.goal.activates(go_to.go)
        view.gave_up.activates(self.gave_up.inner)
        for end in (go_to.arrived, go_to.blocked, go_to.timeout):
            end.activates(self.done.inner)
        view.timeout.activates(look_around.begin)
        look_around.done.activates(self.done.inner)
        graph.connect(self.odometry.inner, look_around.odometry)
        graph.connect(look_around.command, self.command.inner)
        graph.connect(look_around.look, self.look.inner)
        graph.connect(self.found.inner, view.found)
        graph.connect(go_to.deactivated, go_to.stop)
        graph.connect(self.localised.inner, view.localised)
        graph.connect(self.localised.inner, go_to.localised)
        graph.connect(self.scan.inner, go_to.scan)
        graph.connect(self.others.inner, go_to.others)
        graph.connect(go_to.command, self.command.inner)
        graph.connect(go_to.look, self.look.inner)
        for step in (view, go_to):
            graph.gate(step, by=step)
