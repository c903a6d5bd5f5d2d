"""Paths over a grid of costs."""

from __future__ import annotations

from typing import Annotated, Any, TypeAlias

import numpy as np
import numpy.typing as npt
from annotated_types import Interval, Unit

from hfg.nodes._extras import require
from hfg.nodes.robotics._scans import Positions
from hfg.nodetypes.functions import node
from hfg.types import Named, Shape

Costs: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(None, None), Named("Costs")]
"""What it costs to cross each cell of a grid, for each metre; rows go along x, columns along y."""

Place: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(2), Named("Place")]
"""A point of the plane: x and y in metres."""


@node
def plan_path(
    costs: Costs,
    start: Place,
    goal: Place,
    *,
    cell: Annotated[float, Interval(gt=0), Unit("m")] = 0.1,
    left: Annotated[float, Unit("m")] = 0.0,
    lower: Annotated[float, Unit("m")] = 0.0,
    smooth: Annotated[int, Interval(ge=0, le=100)] = 3,
) -> Positions | None:
    """Find the cheapest path over a grid.

    Fires once per set of costs. It is silent if there is no path, or if the start or the goal does not lie on the grid.
    The start may lie in a blocked cell, such as that of the robot itself; then the path begins at the nearest one that
    is free.

    Args:
      costs: of each cell; 0 or less, infinite or not a number is blocked.
      start: where the path begins.
      goal: where it ends.
      cell: side of a cell, in metres.
      left: x of the edge of the first row of cells.
      lower: y of the edge of the first column of cells.
      smooth: how often the corners of the path are rounded.

    Returns:
      out: from the start to the goal, one point for each cell on the way.
    """
    blocked = ~(np.isfinite(costs) & (costs > 0))
    origin = np.array([left, lower])
    ends = [_cell(place, origin, cell, costs.shape) for place in (start, goal)]
    if ends[0] is None or ends[1] is None or blocked.all() or blocked[ends[1]]:
        return None
    first = ends[0]
    if blocked[first]:
        free = np.argwhere(~blocked)
        first = tuple(free[np.argmin(((free - first) ** 2).sum(1))].tolist())
    graph = require("skimage.graph", "robotics")
    search = graph.MCP_Geometric(np.where(blocked, -1.0, costs))
    search.find_costs([first], [ends[1]])
    try:
        cells = np.array(search.traceback(ends[1]), np.float64)
    except ValueError:
        return None
    path = origin + (cells + 0.5) * cell
    for _ in range(smooth):
        if len(path) > 2:
            rounder = (path[:-2] + 2 * path[1:-1] + path[2:]) / 4
            under = ((rounder - origin) / cell).astype(int)
            free = ~blocked[under[:, 0], under[:, 1]]
            path[1:-1][free] = rounder[free]
    if first != ends[0]:
        path = np.concatenate([np.array(start)[None], path])
    path[0], path[-1] = start, goal
    return path if len(path) > 1 else np.array([start, goal])


def _cell(place: Any, origin: Any, cell: float, shape: tuple[int, ...]) -> Any:
    with np.errstate(over="ignore", invalid="ignore"):
        at = np.floor((place - origin) / cell)
    if not (np.isfinite(at).all() and 0 <= at[0] < shape[0] and 0 <= at[1] < shape[1]):
        return None
    return int(at[0]), int(at[1])
