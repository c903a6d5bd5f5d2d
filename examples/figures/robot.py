"""Figures 17 and 18 of the paper: parts of a robot's mission without a state machine (§6.1).

Every function builds the graph of one figure; `docs/model/robot.md` walks through them.
Look at one with `hfg draw examples/figures/robot.py:figure_18`, run it with
`hfg run examples/figures/robot.py:figure_18 --clock virtual`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

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
    """What the robot did before; ends after a while, by its time limit."""


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
