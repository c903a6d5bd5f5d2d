"""Values with a frame and a stamp. Their names and meanings are those of Foxglove's schemas.

A record refuses what it cannot mean when it is made. Points and ranges that are not numbers are allowed in it, because
drivers send such; nodes that cannot use them say so. Depends on `transforms`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from annotated_types import Ge, Gt, MinLen

from hfg.base.values import same
from hfg.geometry.transforms import Coordinates, Transform
from hfg.types import Named, Shape

Frame: TypeAlias = Annotated[str, MinLen(1)]
"""The name of a frame: "map", "base", "laser"."""

Row: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(None), Named("Row")]
"""One number each."""

Column: TypeAlias = Annotated[
    npt.NDArray[np.float32 | np.float64 | np.uint8 | np.uint16 | np.int32], Shape(None), Named("Column")
]
"""One value for each point of a cloud."""

Cells: TypeAlias = Annotated[
    npt.NDArray[np.float32 | np.float64 | np.uint8 | np.int8], Shape(None, None), Named("Cells")
]
"""Values of a grid: rows go along x, columns along y."""


def equal(one: object, other: object) -> bool:
    """Compare two records of arrays by their parts, which a dataclass cannot."""
    return same(one, other)


def need_header(frame_id: Any, stamp: Any) -> None:
    """Refuse a frame without a name, and a stamp that is not finite."""
    if not isinstance(frame_id, str) or not frame_id:
        raise ValueError(f"a frame has a name, got {frame_id!r}")
    if not math.isfinite(stamp):
        raise ValueError(f'a stamp is a finite number of seconds, got {stamp} in frame "{frame_id}"')


@dataclass(frozen=True, slots=True)
class FrameTransform:
    """Where a frame is in its parent.

    Attributes:
      parent: the frame around it.
      child: the frame.
      transform: pose of the child in the parent: it takes coordinates of the child to those of the parent.
      stamp: when that was so.
      static: it is so at any time, as for a sensor that is mounted on a robot.

    Raises:
      ValueError: a frame has no name or is its own parent, or the stamp is not finite.
    """

    parent: Frame
    child: Frame
    transform: Transform
    stamp: float = 0.0
    static: bool = False

    __eq__ = equal

    def __post_init__(self) -> None:
        need_header(self.parent, self.stamp)
        need_header(self.child, self.stamp)
        if self.parent == self.child:
            raise ValueError(f'a frame is not its own parent, got "{self.child}" twice')


@dataclass(frozen=True, slots=True)
class PoseInFrame:
    """Where something is.

    Attributes:
      frame_id: the frame around it.
      stamp: when it was there.
      pose: it takes coordinates of the thing's own frame to those of the frame around it.

    Raises:
      ValueError: the frame has no name, or the stamp is not finite.
    """

    frame_id: Frame
    stamp: float
    pose: Transform

    __eq__ = equal

    def __post_init__(self) -> None:
        need_header(self.frame_id, self.stamp)


@dataclass(frozen=True, slots=True)
class LaserScan:
    """One turn of a laser that scans a plane.

    Attributes:
      frame_id: of the laser: x ahead, y to the left.
      stamp: when it was measured.
      ranges: how far each beam went, in metres; a beam has hit something if that is between `min_range` and
        `max_range`, and nothing if it is more, 0 or less, or not a number.
      start_angle: of the first beam, from straight ahead, counter-clockwise.
      step: from beam to beam; negative if the laser turns clockwise.
      min_range: what is nearer is not measured.
      max_range: what is not nearer is not measured.

    Raises:
      ValueError: the frame has no name, the ranges are not a row, or another number is not finite.
    """

    frame_id: Frame
    stamp: float
    ranges: Row
    start_angle: float
    step: float
    min_range: Annotated[float, Ge(0)] = 0.0
    max_range: Annotated[float, Gt(0)] = 30.0

    __eq__ = equal

    def __post_init__(self) -> None:
        need_header(self.frame_id, self.stamp)
        if self.ranges.ndim != 1:
            raise ValueError(f"a scan has one range for each beam, got an array of {self.ranges.shape}")
        if not (math.isfinite(self.start_angle) and math.isfinite(self.step)):
            raise ValueError(f"the angles of a scan are finite, got start {self.start_angle} and step {self.step}")

    @property
    def angles(self) -> npt.NDArray[np.float64]:
        """The angle of each beam, counter-clockwise from straight ahead, not wrapped."""
        return self.start_angle + self.step * np.arange(len(self.ranges), dtype=np.float64)

    @property
    def hits(self) -> npt.NDArray[np.bool_]:
        """Which beams have hit something."""
        found: npt.NDArray[np.bool_] = hits(self.ranges, self.min_range, self.max_range)
        return found


@dataclass(frozen=True, slots=True)
class RingScan:
    """One turn of a laser with several rings, such as a VLP-16.

    Attributes:
      frame_id: of the laser: x ahead, y to the left, z up.
      stamp: when it was measured.
      ranges: how far each beam went: a row for each ring, a column for each direction. See `LaserScan`.
      elevations: the angle of each ring above the plane of x and y.
      start_angle: of the first column, from straight ahead, counter-clockwise.
      step: from column to column.
      min_range: what is nearer is not measured.
      max_range: what is not nearer is not measured.

    Raises:
      ValueError: the frame has no name, there is not one elevation for each row, or a number other than a range is not
        finite.
    """

    frame_id: Frame
    stamp: float
    ranges: Annotated[npt.NDArray[np.float64], Shape(None, None), Named("Rings")]
    elevations: Row
    start_angle: float
    step: float
    min_range: Annotated[float, Ge(0)] = 0.0
    max_range: Annotated[float, Gt(0)] = 100.0

    __eq__ = equal

    def __post_init__(self) -> None:
        need_header(self.frame_id, self.stamp)
        if self.ranges.ndim != 2 or self.elevations.shape != self.ranges.shape[:1]:
            raise ValueError(
                "each ring has a row of ranges and an elevation, got arrays of "
                f"{self.ranges.shape} and {self.elevations.shape}"
            )
        angles = (self.start_angle, self.step, *self.elevations)
        if not all(map(math.isfinite, angles)):
            raise ValueError(f"the angles of a scan are finite, got start {self.start_angle}, step {self.step}")


def hits(ranges: Any, min_range: float, max_range: float) -> Any:
    """Return which beams have hit something."""
    with np.errstate(invalid="ignore"):
        return (ranges > 0) & (ranges >= min_range) & (ranges < max_range)


@dataclass(frozen=True, slots=True)
class PointCloud:
    """Points with a frame, and what else is known of each.

    Attributes:
      frame_id: the frame of the coordinates.
      stamp: when they were measured.
      points: n x 2 or n x 3.
      fields: by name one value for each point: "ring", "intensity".

    Raises:
      ValueError: the frame has no name, the points are neither of the plane nor of space, or a field has more or fewer
        values than there are points, or the name of a coordinate.
    """

    frame_id: Frame
    stamp: float
    points: Coordinates
    fields: dict[str, Column] = field(default_factory=dict)

    __eq__ = equal

    def __post_init__(self) -> None:
        need_header(self.frame_id, self.stamp)
        if self.points.ndim != 2 or self.points.shape[1] not in (2, 3):
            raise ValueError(f"a cloud has rows of x, y or of x, y, z, got an array of {self.points.shape}")
        for name, values in self.fields.items():
            if values.shape != (len(self.points),) or name in ("x", "y", "z", ""):
                raise ValueError(
                    f"a field has a name other than x, y, z and one value for each of the {len(self.points)} points, "
                    f'got "{name}" of {values.shape}'
                )

    def __len__(self) -> int:
        return len(self.points)

    def select(self, chosen: Any) -> PointCloud:
        """Return the cloud of some of its points, by index or mask."""
        fields = {name: values[chosen] for name, values in self.fields.items()}
        return PointCloud(self.frame_id, self.stamp, self.points[chosen], fields)

    def need_finite(self) -> None:
        """Refuse coordinates that are not numbers.

        Raises:
          ValueError: there are some; the message has how many, of which cloud, and what to do.
        """
        finite: Any = np.isfinite(self.points).all(1)
        if not finite.all():
            raise ValueError(
                f'{int((~finite).sum())} of the {len(finite)} points of the cloud in frame "{self.frame_id}" at '
                f"{self.stamp:.3f} s are not finite; take them out first, with clouds.finite_points"
            )


@dataclass(frozen=True, slots=True)
class Grid:
    """A part of a plane, in square cells.

    Attributes:
      frame_id: the frame that the origin is in.
      stamp: when it was measured.
      origin: pose of the corner with the least x and y; the cells lie along its x and y axes.
      cell: side of a cell, in metres.
      values: `values[i, j]` is the cell from i to i + 1 cells along x, and from j to j + 1 along y.

    Raises:
      ValueError: the frame has no name, the cell is not a length, or the values have not two axes.
    """

    frame_id: Frame
    stamp: float
    origin: Transform
    cell: Annotated[float, Gt(0)]
    values: Cells

    __eq__ = equal

    def __post_init__(self) -> None:
        need_header(self.frame_id, self.stamp)
        if not (math.isfinite(self.cell) and self.cell > 0):
            raise ValueError(f"the side of a cell is a length above 0, got {self.cell}")
        if self.values.ndim != 2:
            raise ValueError(f"a grid has rows along x and columns along y, got an array of {self.values.shape}")


class Twist(NamedTuple):
    """A velocity in the plane, in the frame of the robot.

    Attributes:
      vx: ahead, in m/s.
      vy: to the left, in m/s.
      omega: counter-clockwise, in rad/s.
    """

    vx: float
    vy: float
    omega: float
