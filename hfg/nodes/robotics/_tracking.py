"""Round things over time: where they are, how they move, and where they were when they went out of sight."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from annotated_types import Interval

from hfg.base.clock import now
from hfg.nodes.robotics._scans import Disk, Pose, Ranges, need_pairs
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, State

_JUMP = 0.3  # metres: what is farther from where a disk should be is another one
_GAIN, _SPEED_GAIN = 0.7, 0.25  # of the alpha-beta filter
_STILL = 0.05  # m/s: a standing thing is never measured as quite still


class _Track:
    """One disk: where it is, how it moves, and since when it was not seen."""

    __slots__ = ("at", "disk", "missed", "seen", "speed")

    def __init__(self, disk: Disk, now: float) -> None:
        self.disk, self.at, self.speed = disk, np.array([disk.x, disk.y]), np.zeros(2)
        self.seen, self.missed = now, 0

    def expected(self, dt: float) -> Any:
        """Return where it should be now; what is out of sight stands."""
        return self.at if self.missed else self.at + self.speed * dt

    def correct(self, disk: Disk, dt: float, now: float, fastest: float) -> None:
        """It was seen."""
        expected = self.expected(dt)
        off = np.array([disk.x, disk.y]) - expected
        if self.missed:  # it has come into sight again, anywhere: that says nothing of how fast it is
            self.at, self.speed = expected + off, np.zeros(2)
        else:
            self.at = expected + _GAIN * off
            self.speed = self.speed + _SPEED_GAIN / dt * off
            self.speed *= min(1.0, fastest / max(float(np.hypot(*self.speed)), 1e-9))
        self.disk, self.seen, self.missed = disk, now, 0

    def miss(self) -> None:
        """It was not seen."""
        self.missed += 1

    def tell(self) -> Disk:
        """Return it as it is known."""
        x, y = map(float, self.at)
        moves = not self.missed and float(np.hypot(*self.speed)) > _STILL
        vx, vy = map(float, self.speed) if moves else (0.0, 0.0)
        return Disk(x, y, self.disk.points, vx, vy)


class DiskTracks:
    """Follows disks from scan to scan; the plain part of `TrackDisks`.

    Args:
      memory: for how long a disk is kept that cannot be seen, in seconds.
      fastest: of the disks, in m/s.
      radius: of the disks, in metres.
    """

    def __init__(self, *, memory: float = 4.0, fastest: float = 1.0, radius: float = 0.25) -> None:
        self.limit(memory, fastest, radius)
        self._tracks: list[_Track] = []
        self._last = -math.inf

    def limit(self, memory: float, fastest: float, radius: float) -> None:
        """Follow them by other limits from now on."""
        self._memory, self._fastest, self._radius = memory, fastest, radius

    def update(self, seen: list[Disk], pose: Any, ranges: Any, angles: Any, now: float) -> list[Disk]:
        """Take in what is seen now; give that, and what is out of sight, all with their velocities.

        Args:
          seen: in the map frame.
          pose: pose of the laser, in the map frame.
          ranges: ranges of the scan.
          angles: angles of the scan.
          now: when it was measured.
        """
        dt, self._last = max(now - self._last, 1e-3), now
        left = list(seen)
        for track in sorted(self._tracks, key=lambda one: -one.seen):
            expected = track.expected(dt)
            reach = _JUMP + (self._fastest * (now - track.seen) if track.missed else 0.0)
            near = [one for one in left if math.dist((one.x, one.y), expected) < reach]
            if near:
                best = min(near, key=lambda one: math.dist((one.x, one.y), expected))
                left.remove(best)
                track.correct(best, dt, now, self._fastest)
                continue
            track.miss()
            hidden = _is_hidden(track.at, pose, ranges, angles, self._radius)
            if now - track.seen > self._memory or (not hidden and track.missed > 1):
                self._tracks.remove(track)
        self._tracks += [_Track(one, now) for one in left]
        return [track.tell() for track in self._tracks]


def _is_hidden(at: Any, pose: Any, ranges: Any, angles: Any, radius: float) -> bool:
    """Say whether a disk could be there without a beam that would have had to hit it."""
    across, up = float(at[0] - pose[0]), float(at[1] - pose[1])
    far = math.hypot(across, up)
    if far <= radius or not len(angles):
        return True
    bearing = math.atan2(up, across) - float(pose[2])
    with np.errstate(invalid="ignore"):  # a pose or an angle that is no number hides nothing
        off = np.abs(np.remainder(angles - bearing + math.pi, 2 * math.pi) - math.pi)
    on = off < 0.6 * math.asin(radius / far)
    if not on.any():
        return True  # behind the laser, or between two beams
    with np.errstate(invalid="ignore"):
        return bool((ranges[on] < far).any())


class TrackDisks(Node):
    """Follow round things from scan to scan, also those that are out of sight for a while.

    Fires once per list of disks with the scan in which they were found. A disk that something else hides, or that is
    where the laser does not look, is kept where it was seen last, as standing; one that should be seen and is not has
    gone.

    Attributes:
      memory: for how long a disk is kept that cannot be seen.
      fastest: of the disks.
      radius: of the disks.
      seen: in the map frame.
      pose: pose of the laser, in the map frame.
      ranges: how far each beam went, in metres.
      angles: angles of the beams, in radians, counter-clockwise from straight ahead.
      disks: with their velocities.

    Raises:
      ValueError: there are more or fewer angles than ranges.
    """

    memory = Parameter(4.0, Interval(ge=0), unit="s")
    fastest = Parameter(1.0, Interval(gt=0), unit="m/s")
    radius = Parameter(0.25, Interval(gt=0), unit="m")
    seen = Input(list[Disk])
    pose = Input(Pose)
    ranges = Input(Ranges)
    angles = Input(Ranges)
    disks = Output(list[Disk])

    tracks: State[DiskTracks] = State(factory=DiskTracks)

    def process(self, seen: list[Disk], pose: Pose, ranges: Ranges, angles: Ranges) -> list[Disk]:
        """Follow them."""
        need_pairs(ranges, angles)
        self.tracks.limit(self.memory, self.fastest, self.radius)
        return self.tracks.update(seen, pose, ranges, angles, now())
