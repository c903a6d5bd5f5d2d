"""A robot fetches cubes and brings each where its number says: figures 15 to 19 of the paper, in a simulated arena.

    start ══ wait_for_start ══ advance ══ stations ══ fetch ══ read_number ══ lookup ══ deliver ══ stations ...
                                              ║                     ║            ║
                                              ║                  explore ════ views                      (activity)
                                            home ══ go_home
    arena ── pose ── whatever drives ── command ── arena ── signs ── sign_map ── lookup                  (data)

Where a station stands is known if its sign was seen on the way; if not, the robot explores. There is no state machine:
the node that is active is the state, time-outs and retries are edges, and of all that drive only the active one sends
commands. Shown: activity through subgraphs, a subgraph used twice, streams that converge, nodes gated by themselves.
Run it with `python examples/mission.py` or `hfg run examples/mission.py --clock virtual`.
"""

from __future__ import annotations

import asyncio
from cmath import pi, rect
from collections.abc import AsyncIterator
from typing import Any

from annotated_types import Gt

import hfg

Point = complex  # in metres, 0 is the centre of the arena; velocities are points too
Map = dict[int, Point]  # where the station with that number is


def tell(text: str) -> None:
    print(f"{hfg.now():6.1f} s  {text}")


# --- The steps of a mission. None knows who comes before it or after it.


class Step(hfg.Node):
    """Tells when it becomes active."""

    @hfg.slot
    def enter(self) -> None:
        """Take over the activity; there is nothing else to do."""

    def on_activated(self) -> None:
        tell(self.place.path)


class Equals(Step):
    """Compares messages with the one it knows (figure 17a)."""

    message = hfg.Input(str)
    equal = hfg.Event()
    to = hfg.Parameter("start")

    def process(self, message: str) -> None:
        if message == self.to:
            self.equal.trigger()


class Tour(Step):
    """Sends one goal after the other."""

    goal = hfg.Event(Point)
    over = hfg.Event()
    goals = hfg.Parameter[tuple[Point, ...]](())
    given = hfg.State(0)

    @hfg.slot
    def next(self) -> None:
        self.given += 1
        if self.given <= len(self.goals):
            self.goal.trigger(self.goals[self.given - 1])
        else:
            self.over.trigger()


class Tries(Step):
    """Lets something be tried again, but not forever."""

    go = hfg.Event(Point)
    gave_up = hfg.Event()
    limit = hfg.Parameter(3, Gt(0))
    goal = hfg.State(0j)
    left = hfg.State(0)

    @hfg.slot
    def begin(self, goal: Point) -> None:
        self.goal, self.left = goal, self.limit
        self.again()

    @hfg.slot
    def again(self) -> None:
        self.left -= 1
        if self.left >= 0:
            self.go.trigger(self.goal)
        else:
            self.gave_up.trigger()


class Driver(Step):
    """Drives to where it aims."""

    pose = hfg.Input(Point)
    command = hfg.Output(Point)
    arrived = hfg.Event()
    speed = hfg.Parameter(0.5, Gt(0), unit="m/s")

    def process(self, pose: Point) -> Point | None:
        way = self.aim(pose) - pose
        if abs(way) < 0.05:
            self.arrived.trigger()
            return None
        return way * min(1, self.speed / abs(way))

    def aim(self, pose: Point) -> Point:
        raise NotImplementedError


class GoTo(Driver):
    """Drives to a goal."""

    goal = hfg.State(0j)

    @hfg.slot
    def begin(self, goal: Point) -> None:
        self.goal = goal

    def aim(self, pose: Point) -> Point:
        return self.goal


class GoClear(Driver):
    """Drives straight to the ring between the stations, where nothing stands in the way."""

    radius = hfg.Parameter(3.0, Gt(0), unit="m")

    def aim(self, pose: Point) -> Point:
        return pose / abs(pose) * self.radius


class ReadNumber(Step):
    """Reads the number on the cube in the basket; 0 if there is none."""

    basket = hfg.Input(str)
    number = hfg.Output(int)

    def process(self, basket: str) -> int:
        return int(basket.removeprefix("cube ") or 0)


class WaitForCube(Step):
    """Waits until a cube was put into the basket, or taken from it."""

    number = hfg.Input(int)
    done = hfg.Event()
    loading = hfg.Parameter(True)

    def process(self, number: int) -> None:
        if bool(number) == self.loading:
            self.done.trigger()


class SignMap(hfg.Node):
    """Remembers every sign that was seen."""

    signs = hfg.Input(Map)
    places = hfg.Output(Map)
    known = hfg.State(factory=dict[int, Point])

    def process(self, signs: Map) -> Map:
        self.known = self.known | signs
        return self.known


class MapLookup(Step):
    """Finds out where a number belongs (figure 18)."""

    key = hfg.Input(int)
    places = hfg.Input(Map)
    pose = hfg.Output(Point)
    unknown = hfg.Event(int)

    def process(self, key: int, places: Map) -> Point | None:
        if key in places:
            return places[key]
        self.unknown.trigger(key)
        return None


# --- The mission.


class Visit(hfg.Subgraph):
    """Goes to a station, waits there until a cube has changed hands, and goes clear; tries again if it must."""

    pose, basket = hfg.Input(Point), hfg.Input(str)
    command = hfg.Output(Point)
    begin = hfg.slot(type=Point)
    asks, leaves = hfg.Event(), hfg.Event()
    done, gave_up = hfg.Event(), hfg.Event()
    loading = hfg.Parameter(True)

    def build(self, graph: hfg.Graph) -> None:
        tries, go_to = graph.add(Tries()), graph.add(GoTo(), active_for_s=30)
        number, wait = graph.add(ReadNumber()), graph.add(WaitForCube(), name="wait", active_for_s=10)
        go_clear = graph.add(GoClear(), active_for_s=10)
        retreat = graph.add(GoClear(), name="retreat", active_for_s=10)

        self.begin.inner.activates(tries.begin)
        tries.go.activates(go_to.begin)
        go_to.arrived.activates(wait.enter)
        wait.done.activates(go_clear.enter)
        go_clear.arrived.activates(self.done.inner)
        go_clear.timeout.activates(self.done.inner)

        go_to.timeout.activates(retreat.enter)
        wait.timeout.activates(retreat.enter)
        retreat.arrived.activates(tries.again)
        retreat.timeout.activates(tries.again)
        tries.gave_up.activates(self.gave_up.inner)

        for driver in (go_to, go_clear, retreat):
            graph.connect(self.pose.inner, driver.pose)
            graph.connect(driver.command, self.command.inner)
            graph.gate(driver, by=driver)
        graph.connect(self.basket.inner, number.basket)
        graph.connect(number.number, wait.number)
        graph.gate(number, by=wait)
        graph.connect(wait.activated, self.asks.inner)
        graph.connect(wait.deactivated, self.leaves.inner)
        graph.promote(self.loading, wait.ports.parameters["loading"])


def build(cubes: tuple[int, ...] = (2, 4), **world: Any) -> hfg.Graph:
    """Build the mission; `world` are parameters of the arena."""
    graph = hfg.Graph("mission")
    arena, radio = graph.add(Arena(cubes=cubes, **world), max_rate_hz=2), graph.add(referee())
    wait, emergency = graph.add(Equals(), name="wait_for_start"), graph.add(Equals(to="abort"), name="emergency")
    advance = graph.add(GoClear(), name="advance", active_for_s=10)
    explore = graph.add(GoTo(), name="explore", active_for_s=30)
    go_home = graph.add(GoTo(), name="go_home", active_for_s=30)
    stations = graph.add(Tour(goals=FILLING[: len(cubes)]), name="stations")
    views, home = graph.add(Tour(goals=VIEWS), name="views"), graph.add(Tour(goals=(HOME,)), name="home")
    fetch, deliver = graph.add(Visit(), name="fetch"), graph.add(Visit(loading=False), name="deliver")
    number, signs, lookup = graph.add(ReadNumber()), graph.add(SignMap()), graph.add(MapLookup(), name="lookup")

    graph.start.activates(wait.enter)
    wait.equal.activates(advance.enter)
    advance.arrived.activates(stations.next)
    advance.timeout.activates(stations.next)
    stations.goal.activates(fetch.begin)
    fetch.done.activates(number.enter)
    number.number.activates(lookup.key)
    lookup.pose.activates(deliver.begin)
    deliver.done.activates(stations.next)
    stations.over.activates(home.next)
    home.goal.activates(go_home.begin)
    graph.connect(go_home.arrived, graph.stop)

    lookup.unknown.activates(views.next)
    views.goal.activates(explore.begin)
    explore.arrived.activates(number.enter)
    explore.timeout.activates(number.enter)
    fetch.gave_up.activates(stations.next)
    for failure in (views.over, deliver.gave_up, go_home.timeout, emergency.equal):
        graph.connect(failure, graph.abort)

    for listener in (wait, emergency):
        graph.connect(radio.out, listener.message)
    for driver in (advance, explore, go_home, fetch, deliver):
        graph.connect(arena.pose, driver.pose)
        graph.connect(driver.command, arena.drive)
    for step in (advance, explore, go_home, number):
        graph.gate(step, by=step)
    for reader in (fetch, deliver, number):
        graph.connect(arena.basket, reader.basket)
    for visit in (fetch, deliver):
        graph.connect(visit.asks, arena.green)
        graph.connect(visit.leaves, arena.red)
    graph.connect(arena.signs, signs.signs)
    graph.connect(signs.places, lookup.places)
    return graph


# --- The world: the arena, the robot in it, and the people around.

HOME = -4 - 4j
FILLING = tuple(rect(1.5, pi / 2 * quarter) for quarter in range(4))
DELIVERY = {number: rect(5, pi / 2 * number + 1) for number in range(1, 5)}
VIEWS = tuple(rect(3.5, pi / 4 * eighth) for eighth in range(8))  # counter-clockwise along the wall


@hfg.node
async def referee(*, says: tuple[tuple[float, str], ...] = ((1, "ready?"), (2.2, "start"))) -> AsyncIterator[str]:
    """Simulate the radio: a pause in seconds, and the message after it."""
    for pause_s, message in says:
        await asyncio.sleep(pause_s)
        tell(f'the referee says "{message}"')
        yield message


class Arena(hfg.Node):
    """Moves the robot as commanded, twice a second; a cube is handed over while its lamp is green."""

    pose, signs, basket = hfg.Output(Point), hfg.Output(Map), hfg.Output(str)
    delivered = hfg.Event(int)
    cubes = hfg.Parameter[tuple[int, ...]](())
    ignored = hfg.Parameter(0)  # so many green lamps nobody reacts to
    stuck_s = hfg.Parameter((0.0, 0.0))  # from when until when the wheels are blocked
    robot = hfg.State(HOME)
    velocity = hfg.State(0j)
    carried = hfg.State(0)
    given = hfg.State(0)
    lamps = hfg.State(0)
    green_since = hfg.State[float | None](None)

    @hfg.slot
    def drive(self, velocity: Point) -> None:
        self.velocity = velocity

    @hfg.slot
    def green(self) -> None:
        self.lamps += 1
        self.green_since = hfg.now()

    @hfg.slot
    def red(self) -> None:
        self.green_since = None

    def process(self) -> None:
        if not self.stuck_s[0] <= hfg.now() < self.stuck_s[1]:
            self.robot += self.velocity / 2
        self.velocity = 0j  # a command holds for one moment, so that nobody has to say "stop"
        if self.green_since is not None and hfg.now() > self.green_since + 3 and self.lamps > self.ignored:
            self.hand_over()
        self.pose.send(self.robot)
        self.signs.send({number: sign for number, sign in DELIVERY.items() if abs(sign - self.robot) < 2.5})
        self.basket.send(f"cube {self.carried}" if self.carried else "")

    def hand_over(self) -> None:
        if self.carried and abs(DELIVERY[self.carried] - self.robot) < 0.3:
            tell(f"cube {self.carried} is delivered")
            self.delivered.trigger(self.carried)
            self.carried = 0
        elif not self.carried and self.given < len(self.cubes) and min(abs(one - self.robot) for one in FILLING) < 0.3:
            self.carried, self.given = self.cubes[self.given], self.given + 1
            tell(f"cube {self.carried} is in the basket")


if __name__ == "__main__":
    hfg.run(build(), clock="virtual")
