"""Figures 17 to 19 of the paper: a robot's mission, and parts of it, without a state machine (§6.1).

Every function builds the graph of one figure; `docs/model/robot.md` walks through them.
Look at one with `hfg draw examples/figures/robot.py:figure_18`, run it with
`hfg run examples/figures/robot.py:figure_18 --clock virtual`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from typing import Any, TypeAlias

import hfg

Pose: TypeAlias = tuple[float, float]


class State(hfg.Node):
    """Whatever the robot does next; tells when it begins."""

    begun_at = hfg.State(factory=list[float])

    @hfg.slot
    def begin(self) -> None:
        """Take the activity."""

    def on_activated(self) -> None:
        self.begun_at.append(hfg.now())
        print(f"{self.place.name} begins at {hfg.now():g} s")


# --- figure 17 a: wait for the start signal


@hfg.node
def import_topic(*, messages: tuple[str, ...] = ("hello", "start", "bye", "start")) -> Iterator[str]:
    yield from messages


class Streq(hfg.Node):
    """Tells of every message that is the one it knows."""

    a = hfg.Input(str)
    b = hfg.Parameter("start")
    equal = hfg.Event()

    def process(self, a: str) -> None:
        if a == self.b:
            self.equal.trigger()


def figure_17a() -> hfg.Graph:
    """Wait for the start signal: no state, only data whose comparison carries the activity on."""
    graph = hfg.Graph("figure 17 a")
    topic, streq = graph.add(import_topic(), max_rate_hz=1), graph.add(Streq())
    following = graph.add(State(), name="next")
    graph.connect(topic.out, streq.a)
    graph.start.activates(streq.activate)
    graph.connect(streq.equal, following.begin, active=True)
    return graph


# --- figure 17 b: the lamp


@hfg.node
def on() -> Iterator[bool]:
    yield from [True] * 6


class ActivityGate(hfg.Node):
    """Forwards messages while it is active; it is one of the few nodes that look at their activity."""

    message = hfg.Input(bool)
    forwarded = hfg.Output(bool)

    def process(self, message: bool) -> bool | None:
        return message if self.active else None


class Export(hfg.Node):
    """Sends commands to the lamp."""

    message = hfg.Input(bool)
    exported = hfg.Event()
    sent = hfg.State(factory=list[bool])

    def process(self, message: bool) -> None:
        self.sent.append(message)
        print(f"lamp {'on' if message else 'off'} at {hfg.now():g} s")
        self.exported.trigger()


class Before(hfg.Node):
    """The previous behaviour of the robot; ends after a while, by its time limit."""


def figure_17b() -> hfg.Graph:
    """Set the lamp: the gate forwards one message, for that one takes its activity along."""
    graph = hfg.Graph("figure 17 b")
    source, before = graph.add(on(), max_rate_hz=2), graph.add(Before(), active_for_s=0.7)
    gate, export = graph.add(ActivityGate(), name="gate"), graph.add(Export())
    following = graph.add(State(), name="next")
    graph.connect(source.out, gate.message)
    graph.start.activates(before.activate)
    graph.connect(before.timeout, gate.activate, active=True)
    graph.connect(gate.forwarded, export.message, active=True)
    graph.connect(export.exported, following.begin, active=True)
    return graph


# --- figure 18: look up a station in a map that grows


@hfg.node
def sign_map(*, signs: tuple[tuple[int, Pose], ...] = ((7, (1.0, 2.0)), (3, (4.0, 0.5)))) -> Iterator[dict[int, Pose]]:
    """Know one more sign with each second."""
    known: dict[int, Pose] = {}
    yield dict(known)
    for number, pose in signs:
        known[number] = pose
        yield dict(known)


class CubeDetection(hfg.Node):
    """Once it is asked for, looks at the cube in the basket and tells its number."""

    number = hfg.Parameter(3)
    detected = hfg.Event(int)

    @hfg.slot
    def look(self) -> None:
        self.detected.trigger(self.number)


class MapLookup(hfg.Node):
    """Looks a key up in the newest map: gives its pose, or tells that it is not known."""

    newest = hfg.State(factory=dict[int, Pose])
    pose = hfg.Event(Pose)
    unknown = hfg.Event(int)

    @hfg.slot
    def map(self, known: dict[int, Pose]) -> None:
        self.newest = known

    @hfg.slot
    def key(self, number: int) -> None:
        if number in self.newest:
            self.pose.trigger(self.newest[number])
        else:
            self.unknown.trigger(number)


class Navigate(hfg.Node):
    """Drives to a pose."""

    goals = hfg.State(factory=list[Pose])

    @hfg.slot
    def goal(self, pose: Pose) -> None:
        self.goals.append(pose)
        print(f"drive to {pose} at {hfg.now():g} s")


class Explore(hfg.Node):
    """Looks around for a second, and then at the cube again."""

    searched = hfg.State(factory=list[int])

    @hfg.slot
    def search(self, number: int) -> None:
        self.searched.append(number)
        print(f"sign {number} is unknown: explore")


def figure_18(number: int = 3) -> hfg.Graph:
    """The activity takes one of two ways, depending on whether the station is known."""
    graph = hfg.Graph("figure 18")
    signs, detect = graph.add(sign_map(), max_rate_hz=1), graph.add(CubeDetection(number=number))
    lookup, drive = graph.add(MapLookup()), graph.add(Navigate())
    explore = graph.add(Explore(), active_for_s=0.8)
    graph.connect(signs.out, lookup.map)
    graph.start.activates(detect.look)
    graph.connect(detect.detected, lookup.key, active=True)
    graph.connect(lookup.pose, drive.goal, active=True)
    graph.connect(lookup.unknown, explore.search, active=True)
    graph.connect(explore.timeout, detect.look, active=True)
    return graph


# --- figure 19: the whole mission


NO_CUBE = 0
"""The paper's ⊥, as far as cubes are concerned; no target is silence."""


@hfg.node
def target_detection() -> Iterator[Pose]:
    """See a target sign in front of the robot, wherever it has driven to."""
    yield from [(0.8, 0.0)] * 30


@hfg.node
def cube_detection(*, seen: tuple[int, ...] = (0,) * 4 + (3,) * 8 + (0,) * 4) -> Iterator[int]:
    """Read the number on the cube in the basket, once per second."""
    yield from seen


@hfg.node
def sign_detection() -> Iterator[tuple[int, Pose]]:
    """See one sign after the other."""
    yield from ((7, (1.0, 2.0)), (3, (4.0, 0.5)), (5, (0.0, 3.0)))


class SignMapping(hfg.Node):
    """Keeps where each sign was seen last."""

    sign = hfg.Input(tuple[int, Pose])
    map = hfg.Output(dict[int, Pose])
    known = hfg.State(factory=dict[int, Pose])

    def process(self, sign: tuple[int, Pose]) -> dict[int, Pose]:
        number, pose = sign
        self.known[number] = pose
        return dict(self.known)


class Wait(hfg.Node):
    """Something that takes a while, and then passes on what it was asked for; it hears no signal without activity."""

    seconds = hfg.Parameter(1.0)
    done = hfg.Event(Any)

    @hfg.slot(while_active=True)
    async def begin(self, what: Any) -> None:
        print(f"{hfg.now():4.1f} s  {self.place.path}")
        await asyncio.sleep(self.seconds)
        self.done.trigger(what)


class PositionToTarget(hfg.Node):
    """Drives up to the target sign that is in front, and tells when it is there."""

    target = hfg.Input(Pose)
    there = hfg.Event()

    @hfg.slot
    def begin(self) -> None:
        """Take the activity."""

    def process(self, target: Pose) -> None:
        self.there.trigger()


class CheckCube(hfg.Node):
    """Waits, while it is active, for a cube in the basket, or for none."""

    cube = hfg.Input(int)
    wants_one = hfg.Parameter(True)
    changed = hfg.Event(int)

    @hfg.slot
    def begin(self) -> None:
        """Take the activity."""

    def process(self, cube: int) -> None:
        if (cube != NO_CUBE) == self.wants_one:
            self.changed.trigger(cube)


class Visit(hfg.Subgraph):
    """Fetch Cube and Deliver Cube: drive to a station, position to its target, wait for the operator."""

    begin = hfg.slot(type=object)
    target = hfg.Input(Pose)
    cube = hfg.Input(int)
    wants_one = hfg.Parameter(True)
    done = hfg.Event(int)

    def build(self, graph: hfg.Graph) -> None:
        go_to, position = graph.add(Wait(seconds=2.0), name="go_to"), graph.add(PositionToTarget())
        check = graph.add(CheckCube())
        graph.connect(self.target.inner, position.target)
        graph.connect(self.cube.inner, check.cube)
        graph.connect(self.begin.inner, go_to.begin, active=True)
        graph.connect(go_to.done, position.begin, active=True)
        graph.connect(position.there, check.begin, active=True)
        graph.connect(check.changed, self.done.inner, active=True)
        graph.gate(position, by=position)
        graph.gate(check, by=check)
        graph.promote(self.wants_one, check.ports.parameters["wants_one"])


class WaitForStart(hfg.Subgraph):
    """Figure 17 a as a part."""

    begin = hfg.slot(type=object)
    started = hfg.Event()

    def build(self, graph: hfg.Graph) -> None:
        topic, streq = graph.add(import_topic(), max_rate_hz=1), graph.add(Streq())
        graph.connect(topic.out, streq.a)
        graph.connect(self.begin.inner, streq.activate, active=True)
        graph.connect(streq.equal, self.started.inner, active=True)


def figure_19() -> hfg.Graph:
    """The mission: wait, explore the centre, fetch a cube, look up or find its station, deliver, and again."""
    graph = hfg.Graph("figure 19")
    targets = graph.add(target_detection(), max_rate_hz=1)
    cubes = graph.add(cube_detection(), max_rate_hz=1)
    signs = graph.add(sign_detection(), max_rate_hz=0.1)
    mapping, lookup = graph.add(SignMapping()), graph.add(MapLookup())
    wait, explore = graph.add(WaitForStart(), name="wait_for_start"), graph.add(Wait(), name="explore")
    fetch, deliver = graph.add(Visit(), name="fetch_cube"), graph.add(Visit(wants_one=False), name="deliver_cube")
    find = graph.add(Wait(), name="find_delivery")
    signs >> mapping
    graph.connect(mapping.map, lookup.map)
    for visit in (fetch, deliver):
        graph.connect(targets.out, visit.target)
        graph.connect(cubes.out, visit.cube)
    graph.start.activates(wait.begin)
    graph.connect(wait.started, explore.begin, active=True)
    graph.connect(explore.done, fetch.begin, active=True)
    graph.connect(fetch.done, lookup.key, active=True)
    graph.connect(lookup.pose, deliver.begin, active=True)
    graph.connect(lookup.unknown, find.begin, active=True)
    graph.connect(find.done, lookup.key, active=True)
    graph.connect(deliver.done, fetch.begin, active=True)
    return graph
