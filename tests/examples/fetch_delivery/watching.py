"""Hold a mission to what must be true at every moment, while it runs."""

from __future__ import annotations

import math
from typing import Any

import hfg
from examples.fetch_delivery.mission import build
from examples.fetch_delivery.world import Simulation
from examples.fetch_delivery.world.robots import Robot
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

# How long each step may hold the activity: its time-out where it has one, else the moment it takes.
LONGEST_S = {"go_to/plan": 8.2, "go_to/follow": 60.2, "position": 20.2, "dock": 10.2, "wait": 20.2, "leave": 6.2}
LONGEST_S |= {"select": 5.2, "view": 5.2, "turn": 15.2, "retreat": 6.2, "settle": 0.7, "advance": 10.2}
LONGEST_S |= {"read_cube": 10.2}
STUCK_S = 60.0  # a robot that has neither moved nor changed its step for so long
STANDING = ("settle", "lamp_on/once/gate", "lamp_on/once/export", "wait", "lamp_off/once/gate", "dark/once/gate")


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
        self._active: dict[str, dict[str, float]] = {}
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
            self._time_passes(event.time)
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
        """See which steps are active."""
        if isinstance(event, ActivityChanged):
            robot, _, step = event.node.partition("/")
            if event.active:
                self._enters(robot, step)
            else:
                self._active[robot].pop(step, None)

    def _enters(self, robot: str, step: str) -> None:
        self._active.setdefault(robot, {})[step] = self._now
        self.steps.append((self._now, f"{robot}/{step}"))
        self._stirs(robot)
        if step.endswith("visit/wait"):
            body = self._body(robot)
            station = self.simulation.arena.nearest(body.x, body.y)
            self.waits.append((self._now, station.kind, station.number))

    def _body(self, robot: str) -> Robot:
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
            left = [cube for _, cube in score.delivered + score.wrong + score.returned]
            held = self.simulation.cube(number)
            if held is not None:
                left.append(held)
            if sorted(left) != sorted(cube for _, cube in score.fetched):
                self.found.append(f"robot_{number} has fetched {score.fetched}, and {left} is what has become of them")

    def _time_passes(self, now: float) -> None:
        for robot, active in self._active.items():
            _, x, y = self._stirred[robot]
            body = self._body(robot)
            if math.hypot(body.x - x, body.y - y) > 0.1:
                self._stirs(robot)
            if len(active) != 1:
                self.found.append(f"at {self._now} s {sorted(active)} of {robot} are active, not one step")
            for step, since in active.items():
                longest = next((most for name, most in LONGEST_S.items() if step.endswith(name)), None)
                if longest is not None and now - since > longest:
                    self.found.append(f"at {now} s {robot}/{step} is active since {since} s")
                if body.lamp and not step.endswith(STANDING):
                    self.found.append(f"at {now} s the lamp of {robot} is on in {step}")


def watched(seed: int = 1, robots: int = 1, *, minutes: float = 1.0, **options: Any) -> Watch:
    """Run a mission, and say what it did and what was wrong."""
    graph = build(seed, robots, **options)
    watch = Watch(graph)
    hfg.run(graph, clock="virtual", until_s=60 * minutes, trace=watch)
    return watch
