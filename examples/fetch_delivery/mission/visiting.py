"""To be at a station until a cube has changed hands: what fetching and delivering share.

begin ══ approach ══ go_to ══ position ══ dock ══ settle ══ lamp_on ══ wait ══ lamp_off ══ leave ══ done
║          ║         ║                            ║
║          ╚═════════╩══ retreat ══ gave_up        ╚═ dark ══ retreat
╚══ gave_up
"""

from __future__ import annotations

from annotated_types import Gt

import hfg
from examples.fetch_delivery.messages import Scan, Vector
from examples.fetch_delivery.mission.bundles import AtStation
from examples.fetch_delivery.mission.driving import GoTo, MoveRobot, MoveToObstacle, PositionToTarget
from examples.fetch_delivery.mission.looking import Shutter
from examples.fetch_delivery.perception.laser import smooth_scan, wall_ahead
from examples.fetch_delivery.perception.records import Station
from hfg.nodes import activity


@hfg.node
def always(tick: Scan, *, value: bool = False) -> bool:
    """Return a value again and again."""
    return value


@hfg.node
def as_lamp(command: bool) -> bool:
    """Return a command of no declared type as one for the lamp."""
    return command


class SetLamp(hfg.Subgraph):
    """Set the signal lamp, then hand the activity on (figure 17 b).

    Attributes:
      on: whether it should be on.
      tick: anything that comes again and again.
      lamp: the command, once.
      begin: where activity arrives.
      done: it was sent.
    """

    on = hfg.Parameter(False)
    tick = hfg.Input(Scan)
    lamp = hfg.Output(bool)
    begin = hfg.slot(type=object)
    done = hfg.Event()

    def build(self, graph: hfg.Graph) -> None:
        """Put a constant before the gate that lets one value pass."""
        value, once = graph.add(always(), name="value"), graph.add(activity.OneShotCommand(), name="once")
        graph.connect(self.tick.inner, value.tick)
        graph.connect(value.out, once.value)
        graph.add(as_lamp(), name="as_lamp")
        graph.connect(once.out, graph["as_lamp"].ports.inputs["command"])
        graph.connect(graph["as_lamp"].ports.outputs["out"], self.lamp.inner)
        self.begin.inner.activates(once.begin)
        once.done.activates(self.done.inner)
        graph.promote(self.on, value.ports.parameters["value"])
        graph.gate(value, by=once)


class Approach(hfg.Node):
    """Say from where a station is approached.

    Attributes:
      distance: how far before it that is.
      goal: the pose.
      station: the station, for nodes that look for its sign.
      begin: the station; where activity arrives.
    """

    distance = hfg.Parameter(1.25, Gt(0), unit="m")
    goal = hfg.Event(Vector)
    station = hfg.Event(Station)

    @hfg.slot
    def begin(self, station: Station) -> None:
        """Say it."""
        self.station.trigger(station)
        self.goal.trigger(station.before(self.distance))


class WaitForCube(hfg.Node):
    """Wait until somebody has put a cube into the basket, or has taken it out.

    Attributes:
      loading: whether a cube should come, or go.
      ask: asks the cube detection to look again.
      done: it has happened; with the number of the cube, 0 when there is none.
      begin: where activity arrives.
      unwanted: a cube with this number does not count: it is to be given back for another one.
      number: a cube with this number lies there.
      none: none lies there.
    """

    loading = hfg.Parameter(True)
    ask = hfg.Event()
    done = hfg.Event(int)
    refused = hfg.State(0)

    @hfg.slot
    def begin(self) -> None:
        """Look again."""
        self.ask.trigger()

    @hfg.slot
    def unwanted(self, number: int) -> None:
        """Wait for another one, once."""
        self.refused = number

    @hfg.slot(while_active=True)
    def number(self, number: int) -> None:
        """See a cube."""
        if self.loading and number != self.refused:
            self.refused = 0
            self.done.trigger(number)

    @hfg.slot(while_active=True)
    def none(self) -> None:
        """See none."""
        if not self.loading:
            self.done.trigger(0)


class Visit(AtStation):
    """Go to a station, stand below its ring, show the lamp until a cube has changed hands, and leave.

    Attributes:
      loading: whether a cube should come, or go.
      queueing: so long it waits for another robot to leave the station.
      unwanted: a cube with this number is to be given back.
      begin: the station; where activity arrives.
      gave_up: no cube has changed hands.
    """

    loading = hfg.Parameter(True)
    queueing = hfg.Parameter(60.0)
    unwanted, begin = hfg.slot(type=int), hfg.slot(type=Station)
    gave_up = hfg.Event(object)

    def build(self, graph: hfg.Graph) -> None:
        """Connect the steps in a row, and after each the reaction to its failure."""
        approach, go_to = (
            graph.add(Approach(), name="approach"),
            graph.add(GoTo(lane=0.9), name="go_to", active_for_s=60.1),
        )
        position = graph.add(PositionToTarget(), name="position", active_for_s=20.1)
        dock = graph.add(MoveToObstacle(), name="dock", active_for_s=10.1)
        settle = graph.add(activity.Wait(seconds=0.6), name="settle")
        lamp_on, wait = (
            graph.add(SetLamp(on=True), name="lamp_on"),
            graph.add(WaitForCube(), name="wait", active_for_s=20.1),
        )
        lamp_off, leave = (
            graph.add(SetLamp(), name="lamp_off"),
            graph.add(MoveRobot(x=-0.7), name="leave", active_for_s=6.1),
        )
        dark, retreat = (
            graph.add(SetLamp(), name="dark"),
            graph.add(MoveRobot(x=-0.5), name="retreat", active_for_s=6.1),
        )

        self.begin.inner.activates(approach.begin)
        approach.goal.activates(go_to.go)
        graph.connect(approach.station, position.aim)
        go_to.arrived.activates(position.begin)
        position.done.activates(dock.begin)
        dock.done.activates(settle.begin)
        settle.done.activates(lamp_on.begin)
        lamp_on.done.activates(wait.begin)
        wait.done.activates(lamp_off.begin)
        lamp_off.done.activates(leave.begin)
        leave.done.activates(self.done.inner)
        leave.timeout.activates(self.done.inner)

        go_to.blocked.activates(self.gave_up.inner)
        go_to.timeout.activates(self.gave_up.inner)
        for failure in (position.lost, position.timeout, dock.timeout):
            failure.activates(retreat.begin)
        wait.timeout.activates(dark.begin)
        dark.done.activates(retreat.begin)
        retreat.done.activates(self.gave_up.inner)
        retreat.timeout.activates(self.gave_up.inner)

        self._feed(graph)
        graph.connect(go_to.deactivated, go_to.stop)
        graph.connect(wait.ask, self.ask.inner)
        graph.connect(self.number.inner, wait.number)
        graph.connect(self.none.inner, wait.none)
        graph.connect(self.unwanted.inner, wait.unwanted)
        graph.promote(self.loading, wait.ports.parameters["loading"])
        graph.promote(self.queueing, go_to.ports.parameters["queueing"])

    def _feed(self, graph: hfg.Graph) -> None:
        """Send each step the data it needs, and let those that are not active rest."""
        wall, smooth = graph.add(wall_ahead(), name="wall"), graph.add(smooth_scan(), name="smooth")
        shutter, basket = graph.add(Shutter(n=2), name="shutter"), graph.add(Shutter(n=4), name="basket")
        go_to, position, dock = graph["go_to"], graph["position"], graph["dock"]
        for drives in ("go_to", "position", "dock", "leave", "retreat"):
            graph.connect(graph[drives].ports.outputs["command"], self.command.inner)
            graph.gate(graph[drives], by=graph[drives])
        for moves in ("leave", "retreat"):
            graph.connect(self.odometry.inner, graph[moves].ports.inputs["odometry"])
        for name in ("localised", "scan", "others"):
            graph.connect(self.ports.inputs[name].inner, go_to.ports.inputs[name])
        graph.connect(go_to.ports.outputs["look"], self.look.inner)
        graph.connect(self.scan.inner, wall.scan)
        graph.connect(self.localised.inner, position.ports.inputs["localised"])
        graph.connect(wall.out, position.ports.inputs["wall"])
        graph.connect(self.scan.inner, smooth.scan)
        graph.connect(smooth.out, dock.ports.inputs["scan"])
        graph.connect(self.targets.inner, position.ports.slots["see"])
        graph.connect(self.localised.inner, shutter.tick)
        graph.connect(shutter.look, self.look.inner)
        graph.connect(self.scan.inner, basket.tick)
        graph.connect(basket.look, self.look_into_basket.inner)
        for gated, state in ((wall, "position"), (shutter, "position"), (smooth, "dock"), (basket, "wait")):
            graph.gate(gated, by=graph[state])
        for lamp in ("lamp_on", "lamp_off", "dark"):
            graph.connect(self.scan.inner, graph[lamp].ports.inputs["tick"])
            graph.connect(graph[lamp].ports.outputs["lamp"], self.lamp.inner)
