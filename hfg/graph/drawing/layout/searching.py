"""A way among nodes that the user has placed anywhere, where no way with few corners is free (Dijkstra).

It walks from one place of the grid to the next. Where it turns, it changes from a strip of one axis into one of the
other; the first and the last part are at the height of their ports, so they are not in the result.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from itertools import groupby
from typing import Literal, TypeAlias

from hfg.graph.drawing.layout.grid import Grid

_Step: TypeAlias = tuple[int, int, str]
"""A place of the grid, and the axis along whose strip it was reached."""

_TURN = 40.0


def search(
    grid: Grid, tail: tuple[int, int, bool], head: tuple[int, int, bool]
) -> list[tuple[Literal["x", "y"], int]] | None:
    """Return the strips that a way runs along, or None without any; an end is a place and whether it goes sideways."""
    start: _Step = (tail[0], tail[1], "y" if tail[2] else "x")
    goal: _Step = (head[0], head[1], "y" if head[2] else "x")
    came: dict[_Step, _Step] = {start: start}
    least = {start: 0.0}
    waiting = [(0.0, start)]
    while waiting:
        cost, step = heapq.heappop(waiting)
        if step == goal:
            return _legs(came, start, goal)
        if cost > least[step]:
            continue
        for length, after in _next(grid, step):
            more = cost + length
            if more < least.get(after, float("inf")):
                least[after], came[after] = more, step
                heapq.heappush(waiting, (more, after))
    return None


def _next(grid: Grid, step: _Step) -> Iterator[tuple[float, _Step]]:
    x, y, along = step
    yield _TURN, (x, y, "x" if along == "y" else "y")
    for by in (-1, 1):
        after = (x + by, y) if along == "y" else (x, y + by)
        if 0 <= after[0] < len(grid.x) and 0 <= after[1] < len(grid.y) and not grid.y.busy[after[1]] >> after[0] & 1:
            axis, strip = (grid.x, after[0]) if along == "y" else (grid.y, after[1])
            yield axis.width(strip), (*after, along)


def _legs(came: dict[_Step, _Step], start: _Step, goal: _Step) -> list[tuple[Literal["x", "y"], int]]:
    steps = [goal]
    while steps[-1] != start:
        steps.append(came[steps[-1]])
    runs: list[tuple[Literal["x", "y"], int]] = []
    for along, run in groupby(reversed(steps), key=lambda step: step[2]):
        x, y, _ = next(run)
        runs.append(("x", x) if along == "x" else ("y", y))
    if len(runs) == 1:  # both ports in one strip, but not at one height: it turns where it likes
        middle = steps[len(steps) // 2]
        return [("x", middle[0]) if runs[0][0] == "y" else ("y", middle[1])]
    return runs[1:-1]
