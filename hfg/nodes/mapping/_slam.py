"""Localisation and mapping at once: each scan is matched against the map that the scans before have built."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from annotated_types import Interval, MinLen

from hfg.geometry import Grid, LaserScan, PoseInFrame, Transform
from hfg.nodes.mapping._fields import Field, match
from hfg.nodes.mapping._occupancy import OccupancyMap
from hfg.nodes.robotics import Covariance
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, State, slot

_OCCUPIED = 60  # percent
_SURE = 1e-6  # m^2 and rad^2 that are added to each covariance, so that it is never singular


class SlamScans(Node):
    """Localise a robot in the map that its laser scans are building, and build it (SLAM).

    Fires once per scan with the odometry of the same moment. The pose is carried on by what the odometry has moved, and
    corrected by matching the scan against the map (see `match_scan_to_grid`). The scan is then added to the map, if the
    robot has moved since the last one that was. The first scan begins the map, at the pose of the odometry. It closes
    no loops: what has drifted when a robot comes back after a long way stays so. After S. Kohlbrecher et al., A
    Flexible and Scalable SLAM System, SSRR (2011), but with a likelihood field.

    Attributes:
      cell: side of a cell of the map; with the size, it holds from the first scan until `clear`.
      size: side of the map, which has the origin of the frame in its middle.
      frame_id: name of the frame of the map.
      mount_x: where the laser is on the robot, ahead.
      mount_y: where it is, to the left.
      mount_yaw: the direction into which it looks, counter-clockwise.
      noise: standard deviation of a point of the laser.
      window: how far from the odometry to search, along x and y.
      turn_window: how far from its heading to search.
      drift: standard deviation of the odometry, by the way that it has moved.
      turn_drift: standard deviation of its heading, by the angle that it has turned.
      least: share of the points that must lie on obstacles of the map, for a match to correct the pose.
      step: way after which the next scan is added to the map.
      turn_step: turn after which it is.
      slack_s: how far the stamps of scan and odometry may be apart.
      scan: of a laser.
      odometry: pose of the robot, in a frame of its own.
      pose: of the robot in the map.
      covariance: of x, y and heading: what the odometry and the match together leave open.
      share: how many of the points lie on obstacles, from 0 to 1; low for long says that the robot is lost.
      grid: the map: 0 to 100 percent, -1 where nothing is known.
      clear: begins a new map, at the pose of the odometry.

    Raises:
      ValueError: the stamps of scan and odometry are too far apart, the robot has left the map, or there would be more
        than 25 million cells, or more to search than is possible.
    """

    cell = Parameter(0.05, Interval(ge=0.01, le=10), unit="m")
    size = Parameter(20.0, Interval(gt=0, le=10_000), unit="m")
    frame_id = Parameter("map", MinLen(1))
    mount_x = Parameter(0.0, Interval(ge=-100, le=100), unit="m")
    mount_y = Parameter(0.0, Interval(ge=-100, le=100), unit="m")
    mount_yaw = Parameter(0.0, Interval(ge=-2 * math.pi, le=2 * math.pi), unit="rad")
    noise = Parameter(0.03, Interval(ge=1e-3, le=10), unit="m")
    window = Parameter(0.15, Interval(ge=0, le=10), unit="m")
    turn_window = Parameter(0.08, Interval(ge=0, le=math.pi), unit="rad")
    drift = Parameter(0.1, Interval(ge=0, le=10), unit="1")
    turn_drift = Parameter(0.1, Interval(ge=0, le=10), unit="1")
    least = Parameter(0.4, Interval(ge=0, le=1), unit="1")
    step = Parameter(0.1, Interval(ge=0, le=100), unit="m")
    turn_step = Parameter(0.1, Interval(ge=0, le=math.pi), unit="rad")
    slack_s = Parameter(0.1, Interval(ge=0), unit="s")
    scan = Input(LaserScan)
    odometry = Input(PoseInFrame)
    pose = Output(PoseInFrame)
    covariance = Output(Covariance)
    share = Output(float)
    grid = Output(Grid)

    map: State[OccupancyMap | None] = State(None)
    field: State[Field | None] = State(None)
    at: State[Any] = State(None)
    spread: State[Any] = State(None)
    before: State[Transform | None] = State(None)
    added: State[Any] = State(None)

    def process(self, scan: LaserScan, odometry: PoseInFrame) -> None:
        """Localise, then map."""
        if abs(scan.stamp - odometry.stamp) > self.slack_s:
            raise ValueError(
                f"the scan is of {scan.stamp:.3f} s and the odometry of {odometry.stamp:.3f} s, more than slack_s = "
                f"{self.slack_s:g} s apart; bring them together with flow.JoinByStamp"
            )
        guess, covariance = self._carried_on(odometry.pose)
        mount = np.array([self.mount_x, self.mount_y, self.mount_yaw])
        hit = scan.hits
        far, angle = scan.ranges[hit], scan.angles[hit] + mount[2]
        points = np.stack([far * np.cos(angle), far * np.sin(angle)], 1) + mount[:2]
        share, pose = 0.0, guess
        if self.field is not None:
            found = match(self.field, points, guess, covariance, self.window, self.turn_window)
            share = found.share
            if share >= self.least:
                pose, covariance = found.pose, found.covariance
        self.at, self.spread, self.before = pose, covariance, odometry.pose
        self._add(scan, pose, mount)
        self.pose.send(PoseInFrame(self.frame_id, scan.stamp, Transform.of(pose[0], pose[1], yaw=pose[2])))
        self.covariance.send(covariance)
        self.share.send(share)
        if self.map is not None:
            self.grid.send(self.map.grid(self.frame_id, scan.stamp))

    @slot
    def clear(self) -> None:
        """Begin a new map."""
        self.map = self.field = self.at = self.added = self.before = None

    def _carried_on(self, odometry: Transform) -> tuple[Any, Any]:
        """Return the pose of the robot by odometry, and how sure that is."""
        if self.at is None or self.before is None:
            x, y, _ = odometry.translation
            return np.array([x, y, odometry.angles[2]]), np.eye(3) * _SURE
        step = self.before.inverse() @ odometry
        x, y, _ = step.translation
        turn = step.angles[2]
        cos, sin = math.cos(self.at[2]), math.sin(self.at[2])
        moved = np.array([cos * x - sin * y, sin * x + cos * y, turn])
        jacobian = np.eye(3)
        jacobian[:2, 2] = -moved[1], moved[0]
        way = (self.drift * math.hypot(x, y)) ** 2 + _SURE
        adds = np.diag([way, way, (self.turn_drift * turn) ** 2 + (self.drift * math.hypot(x, y) / 2) ** 2 + _SURE])
        guess = self.at + moved
        guess[2] = math.remainder(guess[2], 2 * math.pi)
        return guess, jacobian @ self.spread @ jacobian.T + adds

    def _add(self, scan: LaserScan, pose: Any, mount: Any) -> None:
        if self.added is not None:
            off = pose - self.added
            if math.hypot(off[0], off[1]) < self.step and abs(math.remainder(off[2], 2 * math.pi)) < self.turn_step:
                return
        if self.map is None:
            self.map = OccupancyMap(self.cell, self.size)
        if not np.abs(pose[:2]).max() < self.size / 2:
            raise ValueError(
                f"the robot is at {pose[0]:.2f}, {pose[1]:.2f} m and has left the map of {self.map.size:g} m; take a "
                "larger size"
            )
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        x, y = cos * mount[0] - sin * mount[1], sin * mount[0] + cos * mount[1]
        self.map.add(scan, np.array([pose[0] + x, pose[1] + y, pose[2] + mount[2]]))
        self.added = pose
        self.field = Field(
            self.map.values >= _OCCUPIED, self.map.cell, np.full(3, self.map.corner) * [1, 1, 0], self.noise
        )
