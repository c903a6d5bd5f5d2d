"""A path of arcs that a car can drive: A* over a lattice of motions, forwards, or forwards and backwards."""

from __future__ import annotations

import heapq
import math
from typing import Any, Final

import numpy as np

_LENGTH: Final = 0.6
_PARTS: Final = 3
_CURVES: Final = (0.0, -0.25, 0.25, -0.6, 0.6, -1.2, 1.2)
_MOST: Final = 1500  # motions that are tried before there is "no path"
_TOLERANCE: Final = 0.6
_AXLE: Final = 0.18  # the robot is two disks, so far ahead of its middle and to the back of it
RADIUS: Final = 0.35
_ON_TRAIL: Final = 1.5  # so near to the trail the robot can follow it
_JOINS: Final = 1.2  # so far ahead it gets to it


def search(
    clear: Any, cell: float, goal: tuple[float, float], *, backward: bool, margin: float, most: int = _MOST
) -> Any:
    """Return the points of a path from the middle of a grid, where the robot looks along x.

    Args:
      clear: how far each cell is from the nearest obstacle, in metres.
      cell: side of a cell.
      goal: x and y.
      backward: the robot may drive back.
      margin: how far it keeps from obstacles, besides its radius.
      most: how many places are looked at.

    Returns:
      out: rows of x, y and direction (1 ahead, -1 back); None if no path was found.
    """
    free = _Free(clear, cell, RADIUS + margin)
    queue: list[tuple[float, int, float, tuple[float, float, float], int, int]] = []
    heapq.heappush(queue, (math.hypot(*goal), 0, 0.0, (0.0, 0.0, 0.0), 1, -1))
    closed: set[tuple[int, int, int, int]] = set()
    nodes: list[tuple[float, float, float, int, int]] = []
    order = 1
    while queue and len(nodes) < most:
        _, _, cost, (x, y, theta), direction, parent = heapq.heappop(queue)
        key = (round(x / 0.3), round(y / 0.3), round(theta / 0.3) % 21, direction)
        if key in closed:
            continue
        closed.add(key)
        nodes.append((x, y, theta, direction, parent))
        if math.hypot(x - goal[0], y - goal[1]) < _TOLERANCE:
            return _traced(nodes, goal)
        for way in (1, -1) if backward else (1,):
            for curve in _CURVES:
                end = free.drive(x, y, theta, way, curve)
                if end is None:
                    continue
                dear = 1 + 0.15 * abs(curve) + 0.6 * max(0.0, 1 - end[3] / 0.8)
                then = cost + _LENGTH * dear * (1 if way > 0 else 2.0) + (1.0 if way != direction else 0.0)
                total = then + math.hypot(end[0] - goal[0], end[1] - goal[1])
                heapq.heappush(queue, (total, order, then, end[:3], way, len(nodes) - 1))
                order += 1
    return None


def _traced(nodes: Any, goal: tuple[float, float]) -> Any:
    rows, index = [], len(nodes) - 1
    while index >= 0:
        x, y, _, direction, index = nodes[index]
        rows.append((x, y, direction))
    return np.array(rows[::-1])


def along_trail(trail: list[tuple[float, float]], keeps: float) -> Any:
    """Return the points of a path along the trail of a person; None if the robot is not on it.

    Args:
      trail: in the frame of the robot, in the order of walking.
      keeps: how far before its end the path ends.
    """
    points = np.array(trail, np.float64).reshape(-1, 2)
    if len(points) < 3:
        return None
    left = np.r_[np.cumsum(np.hypot(*np.diff(points[::-1], axis=0).T))[::-1], 0.0]
    points = points[left >= keeps]
    if not len(points):
        return None
    nearest = int(np.hypot(*points.T).argmin())
    after = points[nearest:]
    ahead = (np.hypot(*after.T) > _JOINS) & (after[:, 0] > 2.5 * np.abs(after[:, 1]))
    if np.hypot(*points[nearest]) > _ON_TRAIL or not ahead.any():
        return None
    rest = after[int(ahead.argmax()) :]
    steps = np.linspace(0, 1, max(2, round(float(np.hypot(*rest[0])) / 0.3)), endpoint=False)
    return np.vstack([steps[:, None] * rest[0], rest])


def is_free(clear: Any, cell: float, points: Any, margin: float) -> bool:
    """Say whether the robot can drive along points, from where it is.

    Args:
      clear: how far each cell is from the nearest obstacle, in metres.
      cell: side of a cell.
      points: rows of x and y; those that are not on the grid are taken as free.
      margin: how far it keeps from obstacles, besides its radius.
    """
    along = np.gradient(points, axis=0)
    along /= np.maximum(np.hypot(*along.T), 1e-6)[:, None]
    side = len(clear)
    room = np.inf
    for axle in (_AXLE, -_AXLE):
        places = points + axle * along
        index = np.floor(places / cell + side / 2).astype(int)
        inside = ((index >= 0) & (index < side)).all(1) & (np.hypot(*points.T) > 0.3)
        room = min(room, clear[index[inside, 0], index[inside, 1]].min(initial=np.inf))
    return bool(room > RADIUS + margin / 2)


class _Free:
    """Says which motions are free. A robot that is already too near to something may leave it."""

    def __init__(self, clear: Any, cell: float, radius: float) -> None:
        self._rows = clear
        self._cell, self._half, self._side = cell, len(clear) / 2, len(clear)
        start = min(self._at(_AXLE, 0.0), self._at(-_AXLE, 0.0))
        self._radius = radius
        self._least = min(radius, start - 0.02)

    def _at(self, x: float, y: float) -> float:
        row, column = int(x / self._cell + self._half), int(y / self._cell + self._half)
        if 0 <= row < self._side and 0 <= column < self._side:
            return float(self._rows[row, column])
        return -1.0

    def drive(self, x: float, y: float, theta: float, way: int, curve: float) -> Any:
        """Return where a motion ends, and how much room there was; None if it is blocked."""
        step, room = way * _LENGTH / _PARTS, math.inf
        away = math.hypot(x, y)
        for _ in range(_PARTS):
            middle = theta + step * curve / 2
            x, y, theta = x + step * math.cos(middle), y + step * math.sin(middle), theta + step * curve
            dx, dy = _AXLE * math.cos(theta), _AXLE * math.sin(theta)
            room = min(room, self._at(x + dx, y + dy), self._at(x - dx, y - dy))
            if room < (self._least if away < 1.0 else self._radius):
                return None
        return x, y, theta, room - self._radius
