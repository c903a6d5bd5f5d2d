"""Nodes that know where frames are, and bring values of one frame into another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from annotated_types import Interval, MinLen

from hfg.geometry import FrameTransform, Grid, LaserScan, PointCloud, PoseInFrame, Transform, TransformTree
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, State, slot


class _Framed(Node):
    """A node with a tree of frames."""

    target = Parameter("map", MinLen(1))
    slack_s = Parameter(0.0, Interval(ge=0), unit="s")
    keep_s = Parameter(10.0, Interval(gt=0), unit="s")

    tree: State[TransformTree] = State(factory=TransformTree)

    @slot
    def transforms(self, transforms: list[FrameTransform]) -> None:
        """Take in where frames are."""
        self.tree.keep_s = self.keep_s
        for one in transforms:
            self.tree.add(one)

    def find(self, source: str, stamp: float) -> Transform:
        """Return the transform to the target."""
        return self.tree.lookup(self.target, source, stamp, self.slack_s)


class LookupTransform(_Framed):
    """Look up where a frame is in another one.

    Fires once per stamp. Between two known poses of a frame it interpolates.

    Attributes:
      target: the frame around it.
      source: the frame that is looked for.
      slack_s: how far outside of what is known the first or last pose of a frame still holds.
      keep_s: how long poses are remembered, before the newest of each frame.
      transforms: where frames are; static ones hold at any time.
      stamp: when, in seconds on the run's clock.
      found: pose of the source in the target.

    Raises:
      FrameError: a frame is unknown, the two are not connected, the stamp is too old or too new, or frames that were
        told are not a tree.
      ValueError: the stamp is not finite, source and target are the same, or the result is too far away for a float.
    """

    source = Parameter("base", MinLen(1))
    stamp = Input(float)
    found = Output(FrameTransform)

    def process(self, stamp: float) -> FrameTransform:
        """Look it up."""
        return FrameTransform(self.target, self.source, self.find(self.source, stamp), stamp)


class TransformPose(_Framed):
    """Bring poses into another frame.

    Fires once per pose.

    Attributes:
      target: the frame to bring them into.
      slack_s: how far outside of what is known the first or last pose of a frame still holds.
      keep_s: how long poses of frames are remembered, before the newest of each frame.
      transforms: where frames are; static ones hold at any time.
      pose: in its frame, at its stamp.
      out: in the target, with the same stamp.

    Raises:
      FrameError: a frame is unknown, the two are not connected, the stamp is too old or too new, or frames that were
        told are not a tree.
      ValueError: the result is too far away for a float.
    """

    pose = Input(PoseInFrame)
    out = Output(PoseInFrame)

    def process(self, pose: PoseInFrame) -> PoseInFrame:
        """Bring it there."""
        return PoseInFrame(self.target, pose.stamp, self.find(pose.frame_id, pose.stamp) @ pose.pose)


class TransformCloud(_Framed):
    """Bring point clouds into another frame.

    Fires once per cloud. A cloud of the plane becomes one of space if the frames are tilted.

    Attributes:
      target: the frame to bring them into.
      slack_s: how far outside of what is known the first or last pose of a frame still holds.
      keep_s: how long poses of frames are remembered, before the newest of each frame.
      transforms: where frames are; static ones hold at any time.
      cloud: in its frame, at its stamp.
      out: in the target, with the same stamp, points in the same order, fields as they were.

    Raises:
      FrameError: a frame is unknown, the two are not connected, the stamp is too old or too new, or frames that were
        told are not a tree.
      ValueError: a frame is too far away for a float.
    """

    cloud = Input(PointCloud)
    out = Output(PointCloud)

    def process(self, cloud: PointCloud) -> PointCloud:
        """Bring it there."""
        points = self.find(cloud.frame_id, cloud.stamp).apply(cloud.points)
        return replace(cloud, frame_id=self.target, points=points)


class TransformScan(_Framed):
    """Bring the points that a laser has hit into another frame.

    Fires once per scan. The result is a cloud, because beams of another frame do not begin at its origin.

    Attributes:
      target: the frame to bring them into.
      slack_s: how far outside of what is known the first or last pose of a frame still holds.
      keep_s: how long poses of frames are remembered, before the newest of each frame.
      transforms: where frames are; static ones hold at any time.
      scan: of a laser, at its stamp.
      out: in the target, with the same stamp, in the order of the beams; of space if the laser is tilted.

    Raises:
      FrameError: a frame is unknown, the two are not connected, the stamp is too old or too new, or frames that were
        told are not a tree.
      ValueError: a frame is too far away for a float.
    """

    scan = Input(LaserScan)
    out = Output(PointCloud)

    def process(self, scan: LaserScan) -> PointCloud:
        """Bring it there."""
        hit = scan.hits
        far, at = scan.ranges[hit], scan.angles[hit]
        points = np.stack([far * np.cos(at), far * np.sin(at)], 1)
        return PointCloud(self.target, scan.stamp, self.find(scan.frame_id, scan.stamp).apply(points))


class TransformGrid(_Framed):
    """Bring grids into another frame, by moving their origin; no cell changes.

    Fires once per grid.

    Attributes:
      target: the frame to bring them into.
      slack_s: how far outside of what is known the first or last pose of a frame still holds.
      keep_s: how long poses of frames are remembered, before the newest of each frame.
      transforms: where frames are; static ones hold at any time.
      grid: in its frame, at its stamp.
      out: in the target, with the same stamp and the same values.

    Raises:
      FrameError: a frame is unknown, the two are not connected, the stamp is too old or too new, or frames that were
        told are not a tree.
      ValueError: the result is too far away for a float.
    """

    grid = Input(Grid)
    out = Output(Grid)

    def process(self, grid: Grid) -> Grid:
        """Bring it there."""
        origin = self.find(grid.frame_id, grid.stamp) @ grid.origin
        return replace(grid, frame_id=self.target, origin=origin)
