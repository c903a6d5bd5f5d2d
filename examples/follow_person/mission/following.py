"""FollowPerson (figures 22 and 23): plan a path to the person, and follow it for a while.

person ══ plan ══ follow ══ done
           ║└── delay ──┘
           ╚══ no_path
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from annotated_types import Interval
from scipy.ndimage import distance_transform_edt

import hfg
from examples.follow_person.messages import Array, Twist
from examples.follow_person.mission.lattice import along_trail, is_free, search
from examples.follow_person.perception.records import Person, Scene
from hfg.geometry import Grid
from hfg.nodes import flow

_AHEAD_S = 0.8  # so far ahead, in time, is the point that is driven to
_NEAR_M = 1.2  # so far before a person a path ends
_SOON_M = 1.5  # people who walk farther away have gone when the robot is there; else it brakes
_FREE_M = 0.5  # around the person no obstacle counts: it is the person


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A way to the person.

    Attributes:
      points: x, y in the frame of the poses.
      directions: of each point: 1 ahead, -1 back.
      pace: how fast the end of the path moves away.
      spare: so far before the end of the path the robot stops if the person does.
    """

    points: Array
    directions: Array
    pace: float
    spare: float = 0.0


class PlanPath(hfg.Node):
    """Plan a path to the person, once, with motions that the robot can make.

    Where the person has walked is tried first, because there is a way; then a search.

    It looks at its activity, as in the paper: persons come all the time, and a path is planned only for the one with
    whom the activity comes.

    Attributes:
      backward: it may lead backwards, too.
      keeps: how far before the person the robot stops.
      margin: how far it keeps from obstacles.
      grid: of obstacles, around the robot.
      scene: where the robot is.
      person: where activity arrives.
      path: to the person.
      none: there is no path.
    """

    backward = hfg.Parameter(False)
    keeps = hfg.Parameter(3.2, Interval(ge=0, le=20), unit="m")
    margin = hfg.Parameter(0.12, Interval(ge=0, le=2), unit="m")
    grid = hfg.Input(Grid)
    scene = hfg.Input(Scene)
    path = hfg.Event(Path)
    none = hfg.Event(Person)

    around: hfg.State[tuple[Grid, Scene] | None] = hfg.State(None)

    def process(self, grid: Grid, scene: Scene) -> None:
        """Keep what is around."""
        self.around = grid, scene

    @hfg.slot(while_active=True)
    def person(self, person: Person) -> None:
        """Plan."""
        path = None if self.around is None else self._planned(*self.around, person)
        if path is None:
            self.none.trigger(person)
        else:
            self.path.trigger(path)

    def _planned(self, grid: Grid, scene: Scene, person: Person) -> Path | None:
        place = scene.seen_from_robot(*person.at(scene.stamp))
        far = math.hypot(*place)
        near = _NEAR_M if person.is_seen else 0.5
        spare = max(0.0, self.keeps - near) if person.is_seen else 0.0
        left = far - near
        away = (person.vx, person.vy) if person.is_seen else (0.0, 0.0)
        towards = np.array(place) @ np.array(_turned(away, -float(scene.pose[2]))) / max(far, 1e-6)
        pace = max(0.0, float(towards))
        if left < 0.25:
            return self._in_frame(scene, np.zeros((1, 2)), np.ones(1), 0.0, 0.0)
        half = grid.values.shape[0] * grid.cell / 2 - 0.6
        left = min(left, (half - 0.5) / max(max(abs(place[0]), abs(place[1])) / far, 1e-6))
        goal = place[0] * left / far, place[1] * left / far
        walking = [scene.seen_from_robot(one.x, one.y) for one in scene.tracks if one.moves and one.missed == 0]
        clear = _clear(grid, [place, *(one for one in walking if math.hypot(*one) > _SOON_M)])
        trail = along_trail([scene.seen_from_robot(*one) for one in person.trail], near)
        if trail is not None and is_free(clear, grid.cell, trail, self.margin):
            return self._in_frame(scene, trail, np.ones(len(trail)), pace, spare)
        found = search(clear, grid.cell, goal, backward=self.backward, margin=self.margin)
        if found is None:
            return None
        return self._in_frame(scene, found[:, :2], found[:, 2], pace, spare)

    def _in_frame(self, scene: Scene, points: Any, directions: Any, pace: float, spare: float) -> Path:
        cos, sin = math.cos(scene.pose[2]), math.sin(scene.pose[2])
        return Path(points @ np.array([[cos, sin], [-sin, cos]]) + scene.pose[:2], directions, pace, spare)


def _turned(vector: tuple[float, float], angle: float) -> tuple[float, float]:
    cos, sin = math.cos(angle), math.sin(angle)
    return cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]


def _clear(grid: Grid, people: list[tuple[float, float]]) -> Any:
    """Return how far each cell is from the nearest obstacle; people are not obstacles."""
    blocked = grid.values > 0
    side = len(blocked)
    reach = round(_FREE_M / grid.cell)
    for person in people:
        middle = (np.array(person) / grid.cell + side / 2).astype(int)
        rows, columns = (slice(max(0, one - reach), max(0, one + reach + 1)) for one in middle)
        blocked[rows, columns] = False
    if not blocked.any():
        return np.full(blocked.shape, np.inf)
    return distance_transform_edt(~blocked) * grid.cell


class PathFollower(hfg.Node):
    """Steer along a path by pure pursuit, until its end or until it is preempted.

    After R. Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, CMU-RI-TR-92-01 (1992).

    Attributes:
      speed: at most.
      look_ahead: distance to the point of the path that is driven to.
      sideways: greatest acceleration sideways; it drives more slowly in curves.
      scene: where the robot is.
      command: the velocity.
      path: where activity arrives.
      preempt: the path that has been followed for long enough; another one is not affected.
      done: it is at the end of the path, or preempted.
    """

    speed = hfg.Parameter(2.5, Interval(gt=0, le=10), unit="m/s")
    look_ahead = hfg.Parameter(1.0, Interval(gt=0, le=10), unit="m")
    sideways = hfg.Parameter(2.0, Interval(gt=0, le=20), unit="m/s^2")
    scene = hfg.Input(Scene)
    command = hfg.Output(Twist)
    done = hfg.Event()

    way: hfg.State[Path | None] = hfg.State(None)

    def process(self, scene: Scene) -> Twist | None:
        """Steer."""
        if self.way is None:
            return None
        twist, left = steer(self.way, scene, self.speed, self.look_ahead, self.sideways)
        if left < 0.2:
            self.done.trigger()
        return twist

    @hfg.slot
    def path(self, path: Path) -> None:
        """Follow this one."""
        self.way = path

    @hfg.slot(while_active=True)
    def preempt(self, path: Path) -> None:
        """Stop."""
        if path is self.way:
            self.done.trigger()


def steer(path: Path, scene: Scene, speed: float, look_ahead: float, sideways: float) -> tuple[Twist, float]:
    """Return the velocity for the next moment, and how much of the path is left.

    Args:
      path: to follow.
      scene: where the robot is.
      speed: at most.
      look_ahead: distance to the point that is driven to.
      sideways: greatest acceleration sideways.
    """
    points, place = path.points, scene.pose[:2]
    off = np.hypot(points[:, 0] - place[0], points[:, 1] - place[1])
    nearest = int(off.argmin())
    following = min(nearest + 1, len(points) - 1)
    direction = float(path.directions[following])
    # The path may turn back; until there is driven in one direction.
    turns = np.flatnonzero(path.directions[following:] != direction)
    end = following + int(turns[0]) - 1 if len(turns) else len(points) - 1
    reach = max(look_ahead, _AHEAD_S * abs(scene.speed))
    far = np.flatnonzero(off[following : end + 1] > reach)
    target = points[following + int(far[0])] if len(far) else _beyond(points, end, reach - float(off[end]))
    left = float(np.hypot(*np.diff(np.vstack([place, points[following:]]), axis=0).T).sum())
    to_end = float(np.hypot(*np.diff(np.vstack([place, points[following : end + 1]]), axis=0).T).sum())
    ahead, aside = scene.seen_from_robot(float(target[0]), float(target[1]))
    curvature = 2 * aside / max(ahead * ahead + aside * aside, 0.04)
    last = end == len(points) - 1
    passed = last and direction * scene.seen_from_robot(float(points[-1, 0]), float(points[-1, 1]))[0] < 0.1
    left, to_end = (0.0, 0.0) if passed else (left, to_end - (path.spare if last else 0.0))
    fast = max(0.0, min(speed, (path.pace if last else 0.3) + 1.1 * to_end))
    fast = min(fast, math.sqrt(sideways / max(abs(curvature), 1e-6)))
    if left < 0.2 and path.pace < 0.3:
        return Twist(0.0, 0.0, 0.0), left
    return Twist(direction * fast, 0.0, direction * fast * curvature), left


def _beyond(points: Array, end: int, far: float) -> Array:
    """Return a point that lies farther along the direction in which a path ends, so that its end is passed straight."""
    along = points[end] - points[end - 1] if end else np.zeros(2)
    place: Array = points[end] + along * far / max(float(np.hypot(*along)), 1e-6)
    return place


class FollowPerson(hfg.Subgraph):
    """Try to reach a person with one strategy of navigation (figure 23).

    Attributes:
      grid: of obstacles, around the robot.
      scene: where the robot is.
      person: where activity arrives.
      command: the velocity.
      done: the path was followed to its end, or for long enough.
      no_path: there is none.
      backward: the path may lead backwards, too.
      margin: how far it keeps from obstacles.
      speed: at most.
      look_ahead: distance to the point of the path that is driven to.
      preempt_after: how long a path is followed.
    """

    grid, scene = hfg.Input(Grid), hfg.Input(Scene)
    person = hfg.slot(type=Person)
    command = hfg.Output(Twist)
    done, no_path = hfg.Event(), hfg.Event(Person)
    backward, margin = hfg.Parameter(False), hfg.Parameter(0.12)
    speed, look_ahead = hfg.Parameter(2.5), hfg.Parameter(1.0)
    preempt_after = hfg.Parameter(1.0)

    def build(self, graph: hfg.Graph) -> None:
        """Figure 23."""
        plan, follow = graph.add(PlanPath(), name="plan"), graph.add(PathFollower(), name="follow")
        delay = graph.add(flow.Delay(), name="delay")
        self.person.inner.activates(plan.ports.slots["person"])
        plan.path.activates(follow.ports.slots["path"])
        plan.none.activates(self.no_path.inner)
        follow.done.activates(self.done.inner)
        graph.connect(plan.path, delay.forward, overflow="latest")
        graph.connect(delay.forwarded, follow.preempt)
        graph.connect(self.grid.inner, plan.grid)
        for node in (plan, follow):
            graph.connect(self.scene.inner, node.scene)
        graph.connect(follow.command, self.command.inner)
        graph.gate(follow, by=follow)
        graph.promote(self.backward, plan.ports.parameters["backward"])
        graph.promote(self.margin, plan.ports.parameters["margin"])
        graph.promote(self.speed, follow.ports.parameters["speed"])
        graph.promote(self.look_ahead, follow.ports.parameters["look_ahead"])
        graph.promote(self.preempt_after, delay.ports.parameters["seconds"])
