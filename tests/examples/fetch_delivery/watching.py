"""Hold a mission to what must be true at every moment, while it runs."""

from __future__ import annotations

from typing import Any

import hfg
from examples.fetch_delivery.mission import build
from examples.fetch_delivery.world import Score, Simulation
from hfg.trace import ActivityChanged, EventTriggered, TraceEvent

# How long each step may hold the activity: its time-out where it has one, else the moment it takes.
LONGEST_S = {"go_to/plan": 8.2, "go_to/follow": 60.2, "position": 20.2, "dock": 10.2, "wait": 20.2, "leave": 6.2}
LONGEST_S |= {"select": 5.2, "view": 5.2, "turn": 15.2, "retreat": 6.2, "settle": 0.7, "advance": 10.2}
LONGEST_S |= {"read_cube": 10.2}
STANDING = ("settle", "lamp_on/once/gate", "lamp_on/once/export", "wait", "lamp_off/once/gate", "dark/once/gate")


class Watch:
    """Looks at a run through its trace.

    Attributes:
      found: what was wrong, in sentences.
      steps: each step that became active, with the time.
    """

    def __init__(self, graph: hfg.Graph) -> None:
        self.found: list[str] = []
        self.steps: list[tuple[float, str]] = []
        self._graph = graph
        self._world: Any = graph["world"]
        self._active: dict[str, dict[str, float]] = {}
        self._now = 0.0
        self._reported: dict[str, list[int]] = {}  # numbers whose sign was not found, by robot
        self._returned: dict[str, int] = {}

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

    def __call__(self, event: TraceEvent) -> None:
        if event.time > self._now:
            self._time_passes(event.time)
            self._now = event.time
        if isinstance(event, ActivityChanged):
            robot, _, step = event.node.partition("/")
            active = self._active.setdefault(robot, {})
            if event.active:
                active[step] = event.time
                self.steps.append((event.time, event.node))
            else:
                active.pop(step, None)
        elif isinstance(event, EventTriggered) and event.event.endswith("/explore/view.gave_up"):
            robot = event.event.partition("/")[0]
            self._reported.setdefault(robot, []).append(event.token.value)

    def _time_passes(self, now: float) -> None:
        for number, score in enumerate(self.simulation.scores):
            self._account(f"robot_{number}", score)
        for robot, active in self._active.items():
            if len(active) != 1:
                self.found.append(f"at {self._now} s {sorted(active)} of {robot} are active, not one step")
            for step, since in active.items():
                longest = next((most for name, most in LONGEST_S.items() if step.endswith(name)), None)
                if longest is not None and now - since > longest:
                    self.found.append(f"at {now} s {robot}/{step} is active since {since} s")
                body = self.simulation.robots[int(robot.removeprefix("robot_"))]
                if body.lamp and not step.endswith(STANDING):
                    self.found.append(f"at {now} s the lamp of {robot} is on in {step}")

    def _account(self, robot: str, score: Score) -> None:
        """Each cube that was fetched is delivered, or given back after it was reported that its sign was not found."""
        for at, cube in score.returned[self._returned.get(robot, 0) :]:
            if cube not in self._reported.get(robot, []):
                self.found.append(f"at {at} s {robot} gave back cube {cube}, and had not said that it does not find it")
        self._returned[robot] = len(score.returned)
        unknown = len(score.fetched) - len(score.delivered) - len(score.wrong) - len(score.returned)
        if unknown not in (0, 1):
            self.found.append(f"at {self._now} s {robot} has {unknown} cubes that it fetched and nobody knows where")


def watched(seed: int = 1, robots: int = 1, *, minutes: float = 1.0, **options: Any) -> Watch:
    """Run a mission, and say what it did and what was wrong."""
    graph = build(seed, robots, **options)
    watch = Watch(graph)
    hfg.run(graph, clock="virtual", until_s=60 * minutes, trace=watch)
    return watch
