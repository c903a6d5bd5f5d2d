"""Does the robot follow the right person? What it believes, held against the truth of the world."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import hfg
from examples.follow_person.world import Simulation

_RIGHT_M: Final = 1.0  # so near to the person the followed track is the person
_AFTER_S: Final = 3.0  # so long after a crossing it is looked whom the robot follows


@dataclass(frozen=True)
class Verdict:
    """Whom the robot has followed.

    Attributes:
      chosen_s: when a person was chosen; None if none was.
      lost: how often the person was lost.
      longest_lost_s: how long it took to find the person again, at most.
      wrong_s: how long another person was followed.
      crossings: others who came between robot and person.
      kept: number of crossings after which the robot still followed the person.
      slow_share: of the time in which the robot followed, by follow_slow.
    """

    chosen_s: float | None
    lost: int
    longest_lost_s: float
    wrong_s: float
    crossings: int
    kept: int
    slow_share: float

    def __str__(self) -> str:
        """Say it in a line."""
        if self.chosen_s is None:
            return "no person was chosen"
        return (
            f"person chosen after {self.chosen_s:.1f} s, lost {self.lost} times, for {self.longest_lost_s:.1f} s at "
            f"most; somebody else followed for {self.wrong_s:.1f} s; kept in {self.kept} of {self.crossings} "
            f"crossings; {100 * self.slow_share:.1f} % of the way slowly"
        )


class Judge:
    """Looks at both.

    Attributes:
      way: x, y of robot, of person, and of where the robot believes to be; then the time.
      lost_at: when the person was lost, and for how long.
    """

    def __init__(self, graph: hfg.Graph) -> None:
        self._graph = graph
        self._tracking: Any = graph["robot/object_tracking"]
        self._detection: Any = graph["robot/person_detection"]
        self._slow: Any = graph["robot/follow_slow/follow"]
        self._fast: Any = graph["robot/follow_fast/follow"]
        self._chosen_s: float | None = None
        self._lost_since: float | None = None
        self.lost_at: list[tuple[float, float]] = []
        self._wrong_s, self._slow_s, self._followed_s, self._kept, self._judged = 0.0, 0.0, 0.0, 0, 0
        self._last_s = 0.0

    @property
    def _simulation(self) -> Simulation:
        world: Any = self._graph["world"]
        simulation: Simulation = world.simulation
        return simulation

    def look(self) -> None:
        """Look once."""
        simulation = self._simulation
        now, followed = simulation.now_s, self._tracking.followed
        dt, self._last_s = now - self._last_s, now
        if followed is None:
            return
        if self._chosen_s is None:
            self._chosen_s = now
        self._slow_s += dt * self._slow.active
        self._followed_s += dt * (self._slow.active or self._fast.active)
        is_lost = self._detection.active
        if is_lost and self._lost_since is None:
            self._lost_since = now - (now - followed.stamp)
        elif self._lost_since is not None and now - followed.stamp < 0.3:
            self.lost_at.append((self._lost_since, now - self._lost_since))
            self._lost_since = None
        is_right = self._is_right(simulation)
        self._wrong_s += dt * (not is_right and not is_lost and now - followed.stamp < 0.3)
        crossings = simulation.score.crossings
        while self._judged < len(crossings):
            one = crossings[self._judged]
            if one.ended_s is None or now < one.ended_s + _AFTER_S:
                break
            self._judged += 1
            self._kept += is_right and self._lost_since is None

    def _is_right(self, simulation: Simulation) -> bool:
        """Say whether the person is followed; as seen from the robot, so that drift does not count."""
        followed, scene = self._tracking.followed, self._tracking.newest
        if followed is None or scene is None:
            return False
        ahead, left = scene.seen_from_robot(*followed.at(scene.stamp))
        robot, person = simulation.robot, simulation.people.person
        cos, sin = math.cos(robot.theta), math.sin(robot.theta)
        x, y = robot.x + cos * ahead - sin * left, robot.y + sin * ahead + cos * left
        return math.dist((x, y), (person.x, person.y)) < _RIGHT_M

    def verdict(self) -> Verdict:
        """Return what was seen."""
        lost = list(self.lost_at)
        if self._lost_since is not None:
            lost.append((self._lost_since, self._last_s - self._lost_since))
        return Verdict(
            self._chosen_s,
            len(lost),
            max((seconds for _, seconds in lost), default=0.0),
            self._wrong_s,
            self._judged,
            self._kept,
            self._slow_s / max(self._followed_s, 1e-9),
        )
