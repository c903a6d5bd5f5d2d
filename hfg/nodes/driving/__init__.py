"""Driving: plans for cars, paths made smooth and checked, followers, limits, and stopping before obstacles.

_maneuvers  plan_maneuver, which needs SciPy and scikit-image
_paths      smooth_path, check_path
_following  pure_pursuit, stanley_steering, FollowManeuver
_limiting   LimitTwist, slow_for_obstacles
_curves     Dubins curves
_grids      obstacles of a grid
"""

from __future__ import annotations

from hfg.nodes.driving._following import FollowManeuver, pure_pursuit, stanley_steering
from hfg.nodes.driving._grids import Poses
from hfg.nodes.driving._limiting import LimitTwist, slow_for_obstacles
from hfg.nodes.driving._maneuvers import Gears, plan_maneuver
from hfg.nodes.driving._paths import check_path, smooth_path

__all__ = [
    "FollowManeuver",
    "Gears",
    "LimitTwist",
    "Poses",
    "check_path",
    "plan_maneuver",
    "pure_pursuit",
    "slow_for_obstacles",
    "smooth_path",
    "stanley_steering",
]
