"""Frames: rigid transforms, where frames are over time, and values brought from one frame into another.

_transforms     transforms made, composed, inverted, taken apart, applied
_trees          LookupTransform, TransformPose, TransformScan, TransformCloud, TransformGrid
"""

from __future__ import annotations

from hfg.nodes.frames._transforms import (
    broadcast_pose,
    compose_transforms,
    euler_angles,
    fixed_frame,
    interpolate_transforms,
    invert_transform,
    pose_of_transform,
    transform_of_angles,
    transform_of_pose,
    transform_points,
)
from hfg.nodes.frames._trees import LookupTransform, TransformCloud, TransformGrid, TransformPose, TransformScan

__all__ = [
    "LookupTransform",
    "TransformCloud",
    "TransformGrid",
    "TransformPose",
    "TransformScan",
    "broadcast_pose",
    "compose_transforms",
    "euler_angles",
    "fixed_frame",
    "interpolate_transforms",
    "invert_transform",
    "pose_of_transform",
    "transform_of_angles",
    "transform_of_pose",
    "transform_points",
]
