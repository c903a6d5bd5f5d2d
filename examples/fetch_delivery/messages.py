"""What robot and arena say to each other: commands one way, measurements the other.

Metres, radians and seconds. A pose is `(x, y, theta)`; velocities are in the robot's own frame, x ahead and y to its
left. These are plain records: the simulated arena makes them and knows nothing of graphs, the graphs read them and know
nothing of the arena.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

Vector: TypeAlias = NDArray[np.float64]
Picture: TypeAlias = NDArray[np.uint8]
"""Grey levels, 480 rows of 640 columns."""


class Twist(NamedTuple):
    """A velocity in the robot's frame: the commanded or the actual one."""

    vx: float = 0.0
    vy: float = 0.0
    omega: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """One turn of the laser: how far it is in each direction.

    Attributes:
      ranges: in metres, one for each angle; `max_range` where nothing is.
      angles: from the robot's heading, counter-clockwise.
      stamp: when it was measured.
      max_range: how far the laser can see.
    """

    ranges: Vector
    angles: Vector
    stamp: float
    max_range: float = 30.0


@dataclass(frozen=True, slots=True, eq=False)
class Odometry:
    """Where the wheels say the robot is; they slip, so this drifts.

    Attributes:
      pose: `(x, y, theta)` in a frame that begins where the robot began; theta is not wrapped.
      twist: `(vx, vy, omega)` in the robot's frame.
      stamp: when it was measured.
    """

    pose: Vector
    twist: Vector
    stamp: float
