"""What robots believe, see and do, gathered from the trace of a run: nothing is added to the graph for it.

Ports are known by the ends of their paths, so other graphs of the same robot are looked at as well, as long as they
keep the names of its parts.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from examples.fetch_delivery.messages import Picture, Vector
from examples.fetch_delivery.perception.planning import Path
from examples.fetch_delivery.perception.records import Localised, Sighting, Sign, Station
from examples.fetch_delivery.world import Simulation
from hfg.trace import ActivityChanged, EventTriggered, TokenSent, TraceEvent

_EIGHTH: Final = math.pi / 4  # the arena looks the same after every turn by that; a robot chooses one of the eight


@dataclass
class Seen:
    """One robot.

    Attributes:
      localised: where it believes to be, in its own map.
      turn: by how much its map is turned against the arena, None until it is sure of where it is.
      front: the last picture of what is ahead.
      targets: the bull's-eyes that it has found there; None until it has looked.
      digits: the digits, in the same way.
      basket: the last picture of its basket.
      cube: what it has read there: a number, 0 for nothing, None if it does not know.
      signs: the digits that it knows, in its map.
      filling: the filling stations that it knows.
      path: which way it wants to go, in its map.
      active: which of its nodes are active, since when.
      state: of its state machine, if it has one.
      way: where it really was.
      believed: where it believed to be, laid into the arena; NaN where it did not know.
    """

    localised: Localised | None = None
    turn: float | None = None
    front: Picture | None = None
    targets: list[Sighting] | None = None
    digits: list[Sighting] | None = None
    basket: Picture | None = None
    cube: int | None = None
    signs: dict[int, Sign] = field(default_factory=dict)
    filling: list[Station] = field(default_factory=list)
    path: Vector | None = None
    active: dict[str, float] = field(default_factory=dict)
    state: str = ""
    way: list[tuple[float, float]] = field(default_factory=list)
    believed: list[tuple[float, float]] = field(default_factory=list)

    @property
    def step(self) -> str:
        """Say what it does: the path of the active node, without what is the same for all."""
        return self.state or ", ".join(sorted(self.active)) or "nothing"

    def in_arena(self, points: Any) -> Vector:
        """Lay points of its map into the arena."""
        cos, sin = math.cos(self.turn or 0.0), math.sin(self.turn or 0.0)
        laid: Vector = np.asarray(points, np.float64) @ np.array([[cos, sin], [-sin, cos]])
        return laid


class Observer:
    """A consumer of the trace.

    Attributes:
      robots: what is known of each.
      looked: called with the number of a robot when it has looked at a picture of its front camera.
      read: called with the number of a robot when it has read another cube.
    """

    def __init__(self, simulation: Callable[[], Simulation], robots: int) -> None:
        """`simulation` gives the arena once the run has begun."""
        self.robots = [Seen() for _ in range(robots)]
        self.looked: Callable[[int], object] = lambda _robot: None
        self.read: Callable[[int], object] = lambda _robot: None
        self._simulation = simulation
        self._takes: dict[str, Callable[[Any], None] | None] = {}  # by edge: most are of no interest
        self._taken: set[tuple[int, str]] = set()  # of a port only one edge counts

    def __call__(self, event: TraceEvent) -> None:
        """Take one event of the run."""
        if isinstance(event, TokenSent):
            edge = event.edge
            if edge not in self._takes:
                self._takes[edge] = self._taker(edge)
            take = self._takes[edge]
            if take is not None:
                take(event.token.value)
        elif isinstance(event, ActivityChanged):
            self._activity(event)
        elif isinstance(event, EventTriggered) and event.event.endswith("/control.entered"):
            robot = event.event.partition("/")[0].removeprefix("robot_")
            self.robots[int(robot)].state = str(event.token.value)

    def note_places(self) -> None:
        """Add a point to the ways."""
        for seen, body in zip(self.robots, self._simulation().robots, strict=True):
            seen.way.append((body.x, body.y))
            place = (math.nan, math.nan)
            if seen.localised is not None and seen.turn is not None:
                x, y = seen.in_arena(seen.localised.pose[:2])
                place = (float(x), float(y))
            seen.believed.append(place)

    # --- inside ---

    def _taker(self, edge: str) -> Callable[[Any], None] | None:
        port = edge.partition(" -> ")[0]
        of_world = re.fullmatch(r"world\.(front|basket)\[(\d+)\]", port)
        of_robot = re.fullmatch(r"robot_(\d+)/(?:.*/)?(\w+\.\w+)", port)
        if of_world is not None:
            number, name = int(of_world[2]), of_world[1]
        elif of_robot is not None:
            number, name = int(of_robot[1]), of_robot[2]
        else:
            return None
        takes = {
            "front": self._front,
            "basket": self._basket,
            "localise.localised": self._localised,
            "targets.out": self._targets,
            "digits.out": self._digits,
            "signs.signs": self._signs,
            "stations.filling": self._filling,
            "plan.path": self._path,
            "plan.aside": self._path,
            "cube.number": self._number,
            "cube.none": self._none,
        }
        take = takes.get(name)
        if take is None or number >= len(self.robots) or (number, port) in self._taken:
            return None
        self._taken.add((number, port))
        return lambda value: take(number, value)

    def _activity(self, event: ActivityChanged) -> None:
        robot, _, step = event.node.partition("/")
        number = robot.removeprefix("robot_")
        if not (number.isdecimal() and int(number) < len(self.robots)):
            return
        seen = self.robots[int(number)]
        if event.active:
            seen.active[step] = event.time
            return
        seen.active.pop(step, None)
        if step.endswith(("/follow", "/queue")):
            seen.path = None

    def _front(self, robot: int, value: object) -> None:
        if isinstance(value, np.ndarray):
            seen = self.robots[robot]
            seen.front, seen.targets, seen.digits = value, None, None

    def _basket(self, robot: int, value: object) -> None:
        if isinstance(value, np.ndarray):
            self.robots[robot].basket = value

    def _localised(self, robot: int, value: object) -> None:
        if not isinstance(value, Localised):
            return
        seen = self.robots[robot]
        seen.localised = value
        if seen.turn is None and value.sure:
            body = self._simulation().robots[robot]
            seen.turn = _EIGHTH * round((body.theta - float(value.pose[2])) / _EIGHTH)

    def _targets(self, robot: int, value: object) -> None:
        if isinstance(value, list):
            self.robots[robot].targets = value
            self._has_looked(robot)

    def _digits(self, robot: int, value: object) -> None:
        if isinstance(value, list):
            self.robots[robot].digits = value
            self._has_looked(robot)

    def _has_looked(self, robot: int) -> None:
        seen = self.robots[robot]
        if seen.front is not None and seen.targets is not None and seen.digits is not None:
            self.looked(robot)

    def _signs(self, robot: int, value: object) -> None:
        if isinstance(value, dict):
            self.robots[robot].signs = value

    def _filling(self, robot: int, value: object) -> None:
        if isinstance(value, list):
            self.robots[robot].filling = value

    def _path(self, robot: int, value: object) -> None:
        if isinstance(value, Path):
            self.robots[robot].path = np.asarray(value.points)

    def _number(self, robot: int, value: object) -> None:
        seen = self.robots[robot]
        if isinstance(value, int) and value != seen.cube:
            seen.cube = value
            self.read(robot)

    def _none(self, robot: int, _value: object) -> None:
        self.robots[robot].cube = 0
