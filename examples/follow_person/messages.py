"""Measurements and commands that robot and world exchange. Metres, radians and seconds.

The simulated world makes these records without graphs, and graphs read them without the world. Scans are `RingScan` of
`hfg.geometry`; velocities are `Twist` of `hfg.nodes.estimation`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hfg.geometry import RingScan
from hfg.nodes.estimation import Twist

__all__ = ["Array", "Camera", "Imu", "Photo", "Picture", "RingScan", "Twist"]

Array: TypeAlias = NDArray[np.float64]
Picture: TypeAlias = NDArray[np.uint8]
"""Rows of pixels: blue, green, red."""


class Imu(NamedTuple):
    """Measurements of the inertial unit.

    Attributes:
      yaw_rate: counter-clockwise, in rad/s; it has a bias.
      roll: of the robot, positive if its left side is up.
      pitch: positive if its front is down.
    """

    yaw_rate: float
    roll: float
    pitch: float


class Camera(NamedTuple):
    """A pinhole camera that looks ahead.

    Attributes:
      width: of its picture, in pixels.
      height: of its picture.
      focal: focal length, in pixels.
      above: how high it is above the robot's frame, in metres.
    """

    width: int = 480
    height: int = 360
    focal: float = 300.0
    above: float = 0.9


@dataclass(frozen=True, slots=True, eq=False)
class Photo:
    """A picture of the camera.

    Attributes:
      picture: its pixels.
      stamp: when it was taken.
      camera: that took it.
    """

    picture: Picture
    stamp: float
    camera: Camera
