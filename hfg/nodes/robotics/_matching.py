"""Where a robot is: a scan laid onto the walls of a known map, from a first guess and how sure that is."""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from annotated_types import Interval, Unit

from hfg.nodes.robotics._scans import Pose, Positions, Segments
from hfg.nodetypes.functions import node
from hfg.types import Named, Shape

Covariance: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(3, 3), Named("Covariance")]
"""How sure a pose is: of x, y in metres and the heading in radians."""


class ScanMatch(NamedTuple):
    """Where a scan fits onto a map.

    Attributes:
      pose: x, y and heading in the map.
      covariance: of it, from what the scan and the first guess say together.
      share: how many of the points lie on a wall, 0 to 1.
      spread: how far those lie off, root of the mean of squares, in metres.
    """

    pose: Pose
    covariance: Covariance
    share: float
    spread: float


@node
def match_scan(
    points: Positions,
    guess: Pose,
    segments: Segments,
    covariance: Covariance | None = None,
    *,
    noise: Annotated[float, Interval(gt=0), Unit("m")] = 0.02,
    reach: Annotated[float, Interval(gt=0), Unit("m")] = 0.4,
    tolerance: Annotated[float, Interval(gt=0), Unit("m")] = 0.06,
    rounds: Annotated[int, Interval(ge=1, le=100)] = 12,
) -> ScanMatch:
    """Lay a scan onto the walls of a map, starting from a guess.

    Fires once per scan. Each point pulls its nearest wall (point to line, by Gauss and Newton); what lies far off every
    wall, such as other robots, counts less and less and then nothing. The guess pulls too, as hard as it is sure: where
    the walls do not say where along them the robot is, the guess does, and the covariance tells so.

    Args:
      points: in the robot's frame, in metres.
      guess: the pose from odometry.
      segments: the walls.
      covariance: of the guess; without this input it is 0.3 m and 0.15 rad.
      noise: of a point, in metres; take more than the laser's own, for walls are never quite where the map says.
      reach: how far from its wall a point may be at first, in metres.
      tolerance: how far a point may be off to count as on the wall, in metres.
      rounds: how often it is tried to do better.

    Returns:
      out: the match; with fewer than three points or no wall it is the guess, with a share of 0.

    Raises:
      ValueError: the guess or its covariance contains NaN, or the covariance is not valid.
    """
    before = np.diag([0.09, 0.09, 0.0225]) if covariance is None else covariance
    if not (np.isfinite(guess).all() and np.isfinite(before).all()):
        raise ValueError(f"a guess and its covariance consist of finite numbers, got {guess} and {before}")
    prior = _inverse(before)
    points, segments = points[np.isfinite(points).all(1)], segments[np.isfinite(segments).all((1, 2))]
    if len(points) < 3 or not len(segments):
        return ScanMatch(np.array(guess, np.float64), np.array(before, np.float64), 0.0, 0.0)
    pull = _Pull(points, segments)
    pose, width = np.array(guess, np.float64), reach
    information = prior
    for _ in range(rounds):
        off, jacobian, far = pull.at(pose, 0.25 * tolerance)
        # Tukey's biweight: what lies beyond `width` does not pull at all.
        share = np.minimum(far / width, 1.0)
        pulled = jacobian * ((1 - share * share) ** 2 / noise**2)[:, None]
        information = pulled.T @ jacobian + prior
        step = np.linalg.solve(information, -(pulled.T @ off) - prior @ _difference(pose, guess))
        pose = moved(pose, step)
        narrower = max(tolerance, width * 0.6)
        if np.abs(step).max() < 1e-3 and narrower == width:
            break
        width = narrower
    off, _, far = pull.at(pose, 0.25 * tolerance)
    on = far < tolerance
    spread = float(np.sqrt(np.mean(off[on] ** 2))) if on.any() else 0.0
    return ScanMatch(pose, np.linalg.inv(information), float(on.mean()), spread)


def _inverse(covariance: Any) -> Any:
    try:
        if np.linalg.eigvalsh((covariance + covariance.T) / 2).min() <= 0:
            raise np.linalg.LinAlgError
        return np.linalg.inv(covariance)
    except np.linalg.LinAlgError:
        raise ValueError(f"a covariance is symmetric and positive, got {covariance.tolist()}") from None


class _Pull:
    """The points and the walls: which wall each point belongs to, and how far off it is.

    To look for the nearest of all walls is what takes the time, so that is done only when the pose has moved by enough
    to change it; in between each point keeps its wall.
    """

    def __init__(self, points: Any, segments: Any) -> None:
        self.points = points
        along = segments[:, 1] - segments[:, 0]
        self.length = np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)
        self.along = along / self.length[:, None]
        self.normal = np.stack([-self.along[:, 1], self.along[:, 0]], 1)
        self.to_line = (segments[:, 0] * self.normal).sum(1)
        self.to_start = (segments[:, 0] * self.along).sum(1)
        self.farthest = float(np.hypot(points[:, 0], points[:, 1]).max())
        self.sought_at: Any = None
        self.wall: Any = None

    def at(self, pose: Any, tolerance: float) -> tuple[Any, Any, Any]:
        """Return for each point how far its line is, how that changes with the pose, and how far its wall is."""
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        arms = self.points @ np.array([[cos, sin], [-sin, cos]])
        places = arms + pose[:2]
        if self.sought_at is None or self._went(pose) > tolerance:
            self.wall, self.sought_at = self._nearest(places), pose
        wall = self.wall
        normals = self.normal[wall]
        off = (places * normals).sum(1) - self.to_line[wall]
        along = (places * self.along[wall]).sum(1) - self.to_start[wall]
        beyond = np.maximum(np.maximum(-along, along - self.length[wall]), 0)
        turn = normals[:, 1] * arms[:, 0] - normals[:, 0] * arms[:, 1]
        return off, np.concatenate([normals, turn[:, None]], 1), np.hypot(off, beyond)

    def _went(self, pose: Any) -> float:
        """Return how far the farthest point has moved at most since the walls were sought."""
        step = _difference(pose, self.sought_at)
        return float(np.hypot(step[0], step[1]) + abs(step[2]) * self.farthest)

    def _nearest(self, places: Any) -> Any:
        off = places @ self.normal.T - self.to_line
        along = places @ self.along.T - self.to_start
        beyond = np.maximum(np.maximum(-along, along - self.length), 0)
        return (off * off + beyond * beyond).argmin(1)


def _difference(pose: Any, guess: Any) -> Any:
    apart = pose - guess
    apart[2] = np.remainder(apart[2] + np.pi, 2 * np.pi) - np.pi
    return apart


def moved(pose: Any, step: Any) -> Any:
    """Return a pose after a step in the frame of the map; its heading lies between -pi and pi."""
    after = pose + step
    after[2] = np.remainder(after[2] + np.pi, 2 * np.pi) - np.pi
    return after
