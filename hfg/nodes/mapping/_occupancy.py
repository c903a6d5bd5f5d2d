"""Occupancy grids from scans: how probable it is that something is in a cell, as log odds that add up."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from annotated_types import Interval

from hfg.geometry import Grid, LaserScan, PoseInFrame, Transform
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, State, slot

_MOST_CELLS = 25_000_000


class OccupancyMap:
    """A square of cells, with log odds of each; the plain part of `MapScans`.

    Args:
      cell: side of a cell, in metres.
      size: side of the square, in metres; the origin of the frame is in its middle.

    Raises:
      ValueError: there would be more than 25 million cells.
    """

    def __init__(self, cell: float, size: float) -> None:
        self.side = max(1, math.ceil(size / cell - 1e-9))
        if self.side**2 > _MOST_CELLS:
            raise ValueError(
                f"a map has at most 25 million cells, got {self.side} x {self.side}; take larger cells, or a smaller "
                "size"
            )
        self.cell, self.size = cell, size
        self.corner = -self.side * cell / 2
        self.odds = np.zeros(self.side**2, np.float32)
        self.values = np.full((self.side, self.side), -1, np.int8)
        self.changed = 0

    def add(
        self, scan: LaserScan, pose: Any, *, hit: float = 0.7, miss: float = 0.4, sure: float = 0.97, clear: float = 0.0
    ) -> None:
        """Take in a scan; the further arguments are those of `MapScans`.

        Args:
          scan: what the laser has measured.
          pose: of the laser: x, y and heading in the frame of the map.
          hit: probability of a cell in which a beam ends.
          miss: probability of a cell that a beam passes.
          sure: greatest probability, and 1 minus the least one.
          clear: how far a beam that hit nothing passes, in metres.
        """
        ends, nothing = self._ends(scan, pose, clear)
        passed = np.zeros(self.side**2, bool)
        passed[self._crossed(pose[:2], np.concatenate([ends, nothing]))] = True
        occupied, inside = self.cells(ends)
        occupied = occupied[inside]
        passed[occupied] = False
        free, occupied = np.flatnonzero(passed), np.unique(occupied)
        self.odds[free] += math.log(miss / (1 - miss))
        self.odds[occupied] += math.log(hit / (1 - hit))
        known = np.concatenate([free, occupied])
        limit = math.log(sure / (1 - sure))
        self.odds[known] = odds = np.clip(self.odds[known], -limit, limit)
        self.values.reshape(-1)[known] = np.rint(100 / (1 + np.exp(-odds)))
        self.changed += 1

    def cells(self, points: Any) -> tuple[Any, Any]:
        """Return the number of each point's cell, and whether the point is on the map."""
        with np.errstate(over="ignore", invalid="ignore"):
            index = np.floor((points - self.corner) / self.cell)
        inside = ((index >= 0) & (index < self.side)).all(-1)
        return np.where(inside[..., None], index, 0).astype(np.int64) @ np.array([self.side, 1]), inside

    def grid(self, frame_id: str, stamp: float) -> Grid:
        """Return the map as it is now."""
        origin = Transform.of(x=self.corner, y=self.corner)
        return Grid(frame_id, stamp, origin, self.cell, self.values.copy())

    def _ends(self, scan: LaserScan, pose: Any, clear: float) -> tuple[Any, Any]:
        """Return where beams have hit something, and how far those are free that have hit nothing."""
        hits = scan.hits
        headings = scan.angles + pose[2]
        rays = np.stack([np.cos(headings), np.sin(headings)], 1)
        nothing = (scan.ranges >= scan.max_range) & (clear > 0)
        far = min(clear, scan.max_range)
        return pose[:2] + scan.ranges[hits, None] * rays[hits], pose[:2] + far * rays[nothing]

    def _crossed(self, start: Any, ends: Any) -> Any:
        """Return the cells between a start and ends, looked at twice for each cell of the way."""
        if not len(ends):
            return np.zeros(0, np.int64)
        way = ends - start
        reach = 2 * self.cell * self.side * math.sqrt(2)  # farther away there is no cell, if the start is on the map
        length = np.hypot(way[:, 0], way[:, 1])
        way = way * np.minimum(1, reach / np.maximum(length, 1e-12))[:, None]
        counts = np.ceil(2 * np.minimum(length, reach) / self.cell).astype(np.int64) + 1
        beam = np.repeat(np.arange(len(way)), counts)
        step = np.arange(len(beam)) - np.repeat(np.cumsum(counts) - counts, counts)
        cells, inside = self.cells(start + way[beam] * (step / counts[beam])[:, None])
        return cells[inside]


class MapScans(Node):
    """Build an occupancy grid map from laser scans and the poses at which they were taken, by log odds.

    Fires once per scan with its pose. In each scan a cell is hit if a beam ends in it, and free if beams only pass it;
    the log odds of both add up. After H. Moravec and A. Elfes, High Resolution Maps from Wide Angle Sonar (1985), and
    S. Thrun, W. Burgard, D. Fox, Probabilistic Robotics (2005), table 9.1.

    Attributes:
      cell: side of a cell.
      size: side of the map, which has the origin of its frame in its middle; the cell and the size of the first scan
        hold until `clear`.
      hit: probability of something in a cell in which a beam ends.
      miss: probability of something in a cell that a beam passes.
      sure: greatest probability, and 1 minus the least one, so that the map can still change.
      clear_range: how far a beam that hit nothing passes free cells; 0 if it says nothing. A range that is not a number
        never says anything.
      scan: of a laser.
      pose: of the laser when the scan was taken; its height, roll and pitch do not count.
      grid: 0 to 100 percent, -1 where nothing is known, as in ROS; in the frame of the pose.
      clear: forgets the map.

    Raises:
      ValueError: a pose is in another frame than the one before, or there would be more than 25 million cells.
    """

    cell = Parameter(0.05, Interval(ge=1e-3, le=100), unit="m")
    size = Parameter(20.0, Interval(gt=0, le=10_000), unit="m")
    hit = Parameter(0.7, Interval(gt=0.5, lt=1), unit="1")
    miss = Parameter(0.4, Interval(gt=0, lt=0.5), unit="1")
    sure = Parameter(0.97, Interval(gt=0.5, lt=1), unit="1")
    clear_range = Parameter(0.0, Interval(ge=0, le=1000), unit="m")
    scan = Input(LaserScan)
    pose = Input(PoseInFrame)
    grid = Output(Grid)

    map: State[OccupancyMap | None] = State(None)
    frame: State[str] = State("")

    def process(self, scan: LaserScan, pose: PoseInFrame) -> Grid:
        """Take it in."""
        if self.map is None:
            self.map, self.frame = OccupancyMap(self.cell, self.size), pose.frame_id
        if pose.frame_id != self.frame:
            raise ValueError(f'the map is in frame "{self.frame}", got a pose in frame "{pose.frame_id}"')
        x, y, _ = pose.pose.translation
        place = np.array([x, y, pose.pose.angles[2]])
        self.map.add(scan, place, hit=self.hit, miss=self.miss, sure=self.sure, clear=self.clear_range)
        return self.map.grid(pose.frame_id, scan.stamp)

    @slot
    def clear(self) -> None:
        """Forget the map."""
        self.map = None
