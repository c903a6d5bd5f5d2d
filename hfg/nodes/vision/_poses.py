"""Where markers are in space, from their corners in a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import cv2
import numpy as np
from annotated_types import Interval, MaxLen, Unit

from hfg.geometry import Transform
from hfg.nodes.vision._detecting import Corners
from hfg.nodetypes.functions import node

_MATRIX = [[600.0, 0.0, 320.0], [0.0, 600.0, 240.0], [0.0, 0.0, 1.0]]


class MarkerPose(NamedTuple):
    """Where a marker is.

    Attributes:
      number: of the marker.
      pose: of the marker in the optical frame of the camera: x to the right, y down, z ahead. The marker's own x is to
        the right on it, y up, and z points out of it.
      error: how far the corners lie from where they should be, in pixels, root of the mean square.
    """

    number: int
    pose: Transform
    error: float


@node
def marker_poses(
    numbers: Sequence[int],
    corners: Sequence[Corners],
    *,
    side: Annotated[float, Interval(gt=0, le=1000), Unit("m")] = 0.1,
    matrix: Annotated[list[list[float]], Unit("px")] = _MATRIX,
    distortion: Annotated[list[float], MaxLen(14), Unit("1")] = [],  # noqa: B006 - it is only read
) -> list[MarkerPose]:
    """Compute the poses of square markers (ArUco, AprilTag) from their corners and the camera matrix.

    Fires once per set of markers. After T. Collins and A. Bartoli, Infinitesimal Plane-Based Pose Estimation,
    International Journal of Computer Vision 109 (2014): cv2.solvePnP with IPPE_SQUARE. For a camera that looks ahead,
    its optical frame is mounted by `frames.fixed_frame(roll=-pi/2, yaw=-pi/2)`.

    Args:
      numbers: as `MarkerDetector` sends them.
      corners: for each marker upper left, upper right, lower right, lower left, in pixels.
      side: of a marker, without its white rim.
      matrix: focal lengths and centre: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], as `CameraCalibration` finds them.
      distortion: of the lens: k1, k2, p1, p2, k3 ...; empty for none.

    Returns:
      out: in the order of the markers, without those whose corners are not those of a square.

    Raises:
      ValueError: there are not as many numbers as corners, or the matrix or the distortion is not one.
    """
    if len(numbers) != len(corners):
        raise ValueError(f"each marker has a number and corners, got {len(numbers)} and {len(corners)}")
    camera, bends = _camera(matrix, distortion)
    half = side / 2
    model = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
    found = []
    for number, outline in zip(numbers, corners, strict=True):
        points = np.asarray(outline, np.float64).reshape(-1, 2)
        pose = _solved(model, points, camera, bends) if points.shape == (4, 2) and _is_convex(points) else None
        if pose is not None:
            found.append(MarkerPose(int(number), *pose))
    return found


def _camera(matrix: Any, distortion: Any) -> tuple[Any, Any]:
    try:
        camera, bends = np.array(matrix, np.float64), np.array(distortion, np.float64)
    except ValueError:
        camera, bends = np.zeros(0), np.zeros(0)
    sound = camera.shape == (3, 3) and np.isfinite(camera).all() and np.allclose(camera[2], [0, 0, 1])
    if not (sound and camera[0, 0] > 0 and camera[1, 1] > 0 and np.abs(camera).max() < 1e7):
        raise ValueError(f"a camera matrix is [[fx, 0, cx], [0, fy, cy], [0, 0, 1]] in pixels, got {matrix!r:.200}")
    if len(bends) not in (0, 4, 5, 8, 12, 14) or not (np.isfinite(bends).all() and np.abs(bends).max(initial=0) < 1e6):
        raise ValueError(f"a lens has 0, 4, 5, 8, 12 or 14 finite coefficients of distortion, got {distortion!r:.200}")
    return camera, bends


def _is_convex(points: Any) -> bool:
    """Say whether four corners go clockwise round something, in a picture whose y goes down."""
    if not (np.isfinite(points).all() and np.abs(points).max() < 1e6):
        return False
    sides = np.roll(points, -1, 0) - points
    after = np.roll(sides, -1, 0)
    return bool((sides[:, 0] * after[:, 1] - sides[:, 1] * after[:, 0] > 1e-3).all())


def _solved(model: Any, points: Any, camera: Any, bends: Any) -> tuple[Transform, float] | None:
    try:
        _, turns, places, errors = cv2.solvePnPGeneric(model, points, camera, bends, flags=cv2.SOLVEPNP_IPPE_SQUARE)
    except cv2.error:
        return None
    for turn, place, error in zip(turns, places, np.ravel(errors), strict=True):
        if np.isfinite(turn).all() and np.isfinite(place).all() and place[2] > 0:
            angle = float(np.linalg.norm(turn))
            axis = turn.ravel() / angle if angle > 1e-12 else np.zeros(3)
            rotation = np.array([*(axis * math.sin(angle / 2)), math.cos(angle / 2)])
            return Transform(place.ravel(), rotation), float(error)
    return None
