"""Hold a mission to what must be true of it: its monitors, and what only the arena knows."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import hfg
from examples.fetch_delivery.mission import Robot, build
from examples.fetch_delivery.mission.conditions import conditions
from examples.fetch_delivery.world import Simulation
from examples.fetch_delivery.world.robots import Robot as Body
from hfg import monitors as m
from hfg.trace import (
    ActivityChanged,
    CallEnded,
    CallStarted,
    EventTriggered,
    FiringEnded,
    FiringStarted,
    RunEnded,
    TraceEvent,
)

STUCK_S = 60.0  # a robot that has neither moved nor changed its step for so long

_NOT_WATCHED = "the run was not watched to its end; the log says why"


class Watch:
    """Looks at a run through its trace.

    Attributes:
      found: what was wrong, in sentences.
      steps: each step that became active, with the time.
      waits: at which station the lamp was shown, with the time.
    """

    def __init__(self, graph: hfg.Graph) -> None:
        self.found: list[str] = [_NOT_WATCHED]
        self.steps: list[tuple[float, str]] = []
        self.waits: list[tuple[float, str, int]] = []
        self._graph = graph
        self._world: Any = graph["world"]
        self._chosen: dict[int, float] = {}
        self._now = 0.0
        self._handed_on: dict[str, str | None] = {}  # by whose firing or call, and by which event, if it has
        self._stirred: dict[str, tuple[float, float, float]] = {}

    @property
    def simulation(self) -> Simulation:
        simulation: Simulation = self._world.simulation
        return simulation

    @property
    def pictures(self) -> int:
        """Say how many pictures were taken."""
        return int(self._world.pictures)

    def localiser(self, robot: int) -> Any:
        """Give what a robot believes of itself."""
        node: Any = self._graph[f"robot_{robot}/perception/localise"]
        return node.localiser

    def _turn(self, robot: int) -> float:
        """Give by how much the robot's map is turned against the arena, as it itself believes."""
        return self.simulation.robots[robot].theta - float(self.localiser(robot).pose[2])

    def is_where_it_thinks(self, robot: int = 0) -> bool:
        """Say whether a robot knows where it is, up to the turn of the map that it has chosen in the beginning."""
        body, localiser = self.simulation.robots[robot], self.localiser(robot)
        x, y, _ = localiser.pose
        turn = math.atan2(body.y, body.x) - math.atan2(y, x)
        exact = math.pi / 4 * round(turn / (math.pi / 4))  # the arena looks the same from eight sides
        off = math.remainder(self._turn(robot) - exact, 2 * math.pi)
        aside = math.hypot(body.x, body.y) * math.remainder(turn - exact, 2 * math.pi)
        ahead = math.hypot(x, y) - math.hypot(body.x, body.y)
        same = abs(math.remainder(exact - self._chosen[robot], 2 * math.pi)) < math.pi / 8
        return localiser.sure and same and abs(off) < 0.03 and math.hypot(aside, ahead) < 0.1

    def __call__(self, event: TraceEvent) -> None:
        if event.time > self._now:
            self._time_passes()
            self._now = event.time
        if isinstance(event, EventTriggered) and event.event.endswith("localise.found"):
            number = int(event.event[len("robot_")])
            self._chosen.setdefault(number, self._turn(number))
        if isinstance(event, RunEnded):
            self._is_over()
        self._look(event)
        self._follow_activity(event)

    def _follow_activity(self, event: TraceEvent) -> None:
        """One firing or call hands its activity on once: by A3 a second signal would make two of it."""
        if isinstance(event, FiringStarted | CallStarted):
            self._handed_on[event.node] = None
        elif isinstance(event, FiringEnded | CallEnded):
            self._handed_on.pop(event.node, None)
        elif isinstance(event, EventTriggered) and event.token.activity == 1:
            node, _, name = event.event.partition(".")
            before = self._handed_on.get(node)
            if before is not None:
                self.found.append(f"at {event.time} s {node} hands its activity on by {before} and by {name}")
            if node in self._handed_on:
                self._handed_on[node] = name

    def _look(self, event: TraceEvent) -> None:
        """See which steps become active."""
        if isinstance(event, ActivityChanged) and event.active:
            robot, _, step = event.node.partition("/")
            self.enters(robot, step)

    def enters(self, robot: str, step: str) -> None:
        """A robot is in a step from now on."""
        self.steps.append((self._now, f"{robot}/{step}"))
        self._stirs(robot)
        if step.endswith("visit/wait"):
            body = self._body(robot)
            station = self.simulation.arena.nearest(body.x, body.y)
            self.waits.append((self._now, station.kind, station.number))

    def _body(self, robot: str) -> Body:
        return self.simulation.robots[int(robot.removeprefix("robot_"))]

    def _stirs(self, robot: str) -> None:
        body = self._body(robot)
        self._stirred[robot] = (self._now, body.x, body.y)

    def _is_over(self) -> None:
        self.found.remove(_NOT_WATCHED)
        for robot, (since, _, _) in self._stirred.items():
            if self._now - since > STUCK_S:
                self.found.append(f"{robot} has neither moved nor changed its step since {since} s")
        for number, score in enumerate(self.simulation.scores):
            for when, cube in score.unaccounted():
                self.found.append(f"robot_{number} has given cube {cube} back at {when} s and not said why")
            for when, said in score.mistaken():
                self.found.append(f"robot_{number} has reported cube {said} at {when} s, and delivered it")
            left = [cube for _, cube in score.delivered + score.wrong + score.returned]
            held = self.simulation.cube(number)
            if held is not None:
                left.append(held)
            if sorted(left) != sorted(cube for _, cube in score.fetched):
                self.found.append(f"robot_{number} has fetched {score.fetched}, and {left} is what has become of them")

    def _time_passes(self) -> None:
        for robot, (_, x, y) in self._stirred.items():
            body = self._body(robot)
            if math.hypot(body.x - x, body.y - y) > 0.1:
                self._stirs(robot)

    def carry_out(self, minutes: float, conditions: Callable[[hfg.Subgraph], dict[str, m.Property]]) -> None:
        """Run the mission, in which these must hold of each robot; `found` says what does not."""
        judged: list[m.Monitors] = []

        def begin(run: hfg.Run) -> None:
            robots = [node for node in self._graph.nodes.values() if isinstance(node, Robot)]
            judged.extend(m.watch(run, on_violation="note", **conditions(robot)) for robot in robots)

        hfg.run(self._graph, clock="virtual", until_s=60 * minutes, trace=self, begin=begin)
        self.found += [str(violation) for monitors in judged for violation in monitors.violations]


def watched(seed: int = 1, robots: int = 1, *, minutes: float = 1.0, **options: Any) -> Watch:
    """Run a mission under its monitors, and say what it did and what was wrong."""
    watch = Watch(build(seed, robots, **options))
    watch.carry_out(minutes, conditions)
    return watch
