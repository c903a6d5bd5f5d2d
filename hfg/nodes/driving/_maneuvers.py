"""Plans for robots that cannot turn on the spot: forwards and backwards, around obstacles."""

from __future__ import annotations

import heapq
import itertools
import math
from typing import Annotated, Any, TypeAlias

import numpy as np
import numpy.typing as npt
from annotated_types import Interval, Unit

from hfg.geometry import Grid
from hfg.nodes._extras import require
from hfg.nodes.driving._curves import driven, dubins, moved
from hfg.nodes.driving._grids import Obstacles, Poses, need_poses
from hfg.nodes.robotics import Pose
from hfg.nodetypes.functions import node
from hfg.types import Named, Shape

Gears: TypeAlias = Annotated[npt.NDArray[np.int32], Shape(None), Named("Gears")]
"""For each pose of a path how the robot comes there: 1 forwards, -1 backwards."""

Metres = Annotated[float, Interval(gt=0, le=100), Unit("m")]

_HEADINGS = 72  # that differ
_GREED = 1.4  # how much more what is left counts than what is done
_BETTER = 300  # further steps in which a better way may be found than the first one
_DIAGONAL = 1.0824  # how much longer than a line a way over the eight neighbours of cells can be


@node(outputs={"path": Poses, "gears": Gears})
def plan_maneuver(
    grid: Grid,
    start: Pose,
    goal: Pose,
    *,
    radius: Metres = 0.8,
    front: Metres = 0.5,
    rear: Metres = 0.2,
    width: Metres = 0.5,
    margin: Annotated[float, Interval(ge=0, le=10), Unit("m")] = 0.05,
    backwards: Annotated[float, Interval(ge=1, le=1000), Unit("1")] = 2.0,
    change: Annotated[float, Interval(ge=0, le=1000), Unit("m")] = 1.0,
    occupied: Annotated[int, Interval(ge=-127, le=127)] = 50,
    most: Annotated[int, Interval(ge=1, le=1_000_000)] = 20_000,
) -> tuple[Any, Any] | None:
    """Plan a way for a car from pose to pose, forwards and backwards, around the obstacles of a grid (hybrid A*).

    Fires once per grid with start and goal. It is silent if there is no way, or none was found in time, or if start or
    goal is not free. The search goes by arcs of the narrowest turn and by lines, and ends by a Dubins curve. After
    D. Dolgov et al., Practical Search Techniques in Path Planning for Autonomous Driving, AAAI STAIR (2008), where the
    curve is one of Reeds and Shepp.

    Args:
      grid: obstacles; outside of it the robot cannot be.
      start: pose of the robot in the frame of the grid: of the middle of its rear axle.
      goal: pose to reach.
      radius: of its narrowest turn, at the rear axle.
      front: how far it reaches ahead of the rear axle.
      rear: how far it reaches to the rear of the axle.
      width: of the robot.
      margin: how far it keeps away from obstacles, each of which is at the middle of its cell.
      backwards: what a metre backwards costs, by a metre forwards.
      change: what it costs to stop and drive into the other direction.
      occupied: least value of an obstacle.
      most: number of steps of the search.

    Returns:
      path: poses from start to goal, less than two cells apart; headings between -pi and pi.
      gears: as many; that of the start is the first one.

    Raises:
      ValueError: the grid has no cells, or a pose is not finite.
    """
    need_poses(start, goal)
    obstacles = Obstacles(grid, occupied)
    body = _Body(obstacles, front, rear, width, margin)
    search = _Search(body, radius, backwards, change)
    found = search.run(obstacles.inside(start), obstacles.inside(goal), most)
    return None if found is None else (obstacles.outside(found[0]), found[1])


class _Body:
    """A rectangle, covered by disks, among obstacles."""

    def __init__(self, obstacles: Obstacles, front: float, rear: float, width: float, margin: float) -> None:
        self.far, self.cell = obstacles.distances(), obstacles.cell
        count = max(1, math.ceil((front + rear) / width))
        half = (front + rear) / count / 2
        self.places = np.linspace(-rear + half, front - half, count)
        # A disk is looked up at the middle of the cell that its own middle is in.
        self.need = math.hypot(half, width / 2) + margin + self.cell * math.sqrt(0.5)
        self.narrow = min(width / 2, front, rear)

    def free(self, poses: Any) -> Any:
        """Say of each pose whether no obstacle is near."""
        ahead = np.stack([np.cos(poses[..., 2]), np.sin(poses[..., 2])], -1)
        disks = poses[..., None, :2] + self.places[:, None] * ahead[..., None, :]
        return (self.look(disks) > self.need).all(-1)

    def look(self, points: Any) -> Any:
        """Return how far obstacles are from points; 0 outside of the grid."""
        index = np.floor(points / self.cell) + 1
        inside = ((index >= 0) & (index < self.far.shape)).all(-1)
        index = np.where(inside[..., None], index, 0).astype(np.int64)
        return self.far[index[..., 0], index[..., 1]]


class _Search:
    """A* over poses; two poses are the same if cell and heading are about the same."""

    def __init__(self, body: _Body, radius: float, backwards: float, change: float) -> None:
        self.body, self.radius, self.backwards, self.change = body, radius, backwards, change
        self.step = max(1.5 * body.cell, radius * 2 * math.pi / _HEADINGS * 1.2)
        ways = np.linspace(0, self.step, max(2, math.ceil(self.step / body.cell) + 1))[1:]
        self.moves = list(itertools.product((1, -1), (0, 1, -1)))
        origin = np.zeros(3)
        self.arcs = np.stack([moved(origin, bend / radius, gear * ways) for gear, bend in self.moves])

    def run(self, start: Any, goal: Any, most: int) -> tuple[Any, Any] | None:
        """Return poses and gears; None if there are none."""
        if not self.body.free(np.stack([start, goal])).all():
            return None
        if np.allclose(start, goal):
            return start[None], np.ones(1, np.int32)
        guess = self._guesses(goal)
        first = tuple(start.tolist())
        if guess(first) == math.inf:
            return None
        # where a pose comes from: its cost, the pose before, the gear, the poses on the way
        known: dict[Any, tuple[float, Any, int, Any]] = {self._key(first): (0.0, None, 0, None)}
        queue = [(guess(first), 0, 0.0, first, self._key(first))]
        closed: set[Any] = set()
        found = False
        tickets = itertools.count(1)
        while queue and most:
            _, _, cost, pose, key = heapq.heappop(queue)
            if key in closed or cost > known[key][0]:
                continue  # a better way to about the same pose was found in between
            if key == "goal":
                break
            most -= 1
            if "goal" in known and not found:
                most, found = min(most, _BETTER), True
            closed.add(key)
            # Far from the goal a curve to it is rarely free, so it is tried at some of the poses only.
            shoots = most % (1 + int(guess(pose) / self.radius)) == 0
            best = known["goal"][0] - cost if "goal" in known else math.inf
            for further, place, way, gear, name in self._steps(pose, known[key][2], goal if shoots else None, best):
                total = cost + further
                if name not in closed and (name not in known or total < known[name][0]):
                    ahead = 0.0 if name == "goal" else guess(place)
                    if ahead < math.inf:
                        known[name] = (total, key, gear, way)
                        heapq.heappush(queue, (total + _GREED * ahead, next(tickets), total, place, name))
        return self._told(known, start) if "goal" in known else None

    def _steps(self, pose: Any, gear: int, goal: Any, best: float) -> Any:
        """Yield what can be done at a pose: its cost, where it leads, the poses on the way, the gear, the key.

        Args:
          pose: x, y and heading.
          gear: by which the robot came there.
          goal: to which curves are tried, if it is not None.
          best: what a way to the goal may cost.
        """
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        arcs = np.empty_like(self.arcs)
        arcs[..., :2] = self.arcs[..., :2] @ np.array([[cos, sin], [-sin, cos]]) + pose[:2]
        arcs[..., 2] = self.arcs[..., 2] + pose[2]
        for number in np.flatnonzero(self.body.free(arcs).all(1)).tolist():
            way, (after, bend) = arcs[number], self.moves[number]
            place = tuple(way[-1].tolist())
            yield self._cost(gear, after, self.step * (1.02 if bend else 1.0)), place, way, after, self._key(place)
        for after in (1, -1) if goal is not None else ():
            # Backwards is forwards for a robot that looks the other way.
            turn = np.array([0.0, 0.0, 0.0 if after > 0 else math.pi])
            curve = dubins(np.array(pose) + turn, goal + turn, self.radius)
            further = self._cost(gear, after, curve.length)
            if further >= best:
                continue
            way = driven(np.array(pose) + turn, curve.bends, curve.lengths, self.radius, self.body.cell)[1:] - turn
            if len(way) and self.body.free(way).all():
                yield further, tuple(goal.tolist()), way, after, "goal"

    def _cost(self, before: int, gear: int, length: float) -> float:
        switched = self.change if before and before != gear else 0.0
        return switched + length * (1.0 if gear > 0 else self.backwards)

    def _key(self, pose: Any) -> Any:
        heading = round(pose[2] / (2 * math.pi) * _HEADINGS) % _HEADINGS
        return math.floor(pose[0] / self.body.cell), math.floor(pose[1] / self.body.cell), heading

    def _guesses(self, goal: Any) -> Any:
        """Return a function that says how long the way is at least: that of a small disk, or only the turn."""
        body = self.body
        passable = body.far > body.narrow - body.cell * math.sqrt(0.5)
        costs = np.where(passable & (body.far > 0), 1.0, -1.0)
        cell = tuple((np.floor(goal[:2] / body.cell) + 1).astype(int).tolist())
        costs[cell] = 1.0
        lengths, _ = require("skimage.graph", "robotics").MCP_Geometric(costs).find_costs([cell])
        lengths = np.maximum(0, lengths - 2) * body.cell / _DIAGONAL

        def guess(pose: Any) -> float:
            length = float(lengths[math.floor(pose[0] / body.cell) + 1, math.floor(pose[1] / body.cell) + 1])
            turn = abs(math.remainder(goal[2] - pose[2], 2 * math.pi)) * self.radius
            return max(length, turn, math.hypot(goal[0] - pose[0], goal[1] - pose[1]))

        return guess

    def _told(self, known: Any, start: Any) -> tuple[Any, Any]:
        """Return the way to the goal, from its end to its beginning and turned round."""
        ways, gears, key = [], [], "goal"
        while known[key][1] is not None:
            _, key, gear, way = known[key]
            ways.append(way)
            gears.append(np.full(len(way), gear, np.int32))
        ways.append(start[None])
        gears.append(gears[-1][:1])
        return np.concatenate(ways[::-1]), np.concatenate(gears[::-1])
