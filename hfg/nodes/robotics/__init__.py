"""What robots on wheels need: scans of a laser, where they are, where things are and how they move, paths.

_scans          scan_points, nearest_obstacle, expected_ranges, find_disks
_matching       match_scan
_landmarks      LandmarkMap
_planning       plan_path, which needs scikit-image
_tracking       TrackDisks
"""

from __future__ import annotations

from hfg.nodes.robotics._landmarks import Landmark, LandmarkMap, LandmarkMixture
from hfg.nodes.robotics._matching import Covariance, ScanMatch, match_scan
from hfg.nodes.robotics._planning import Costs, Place, plan_path
from hfg.nodes.robotics._scans import (
    Disk,
    Pose,
    Positions,
    Ranges,
    Segments,
    expected_ranges,
    find_disks,
    nearest_obstacle,
    scan_points,
)
from hfg.nodes.robotics._tracking import DiskTracks, TrackDisks

__all__ = [
    "Costs",
    "Covariance",
    "Disk",
    "DiskTracks",
    "Landmark",
    "LandmarkMap",
    "LandmarkMixture",
    "Place",
    "Pose",
    "Positions",
    "Ranges",
    "ScanMatch",
    "Segments",
    "TrackDisks",
    "expected_ranges",
    "find_disks",
    "match_scan",
    "nearest_obstacle",
    "plan_path",
    "scan_points",
]
