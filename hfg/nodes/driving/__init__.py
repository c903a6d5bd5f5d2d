"""Driving: followers of paths, limits of speed and acceleration, and stopping before obstacles.

_following  pure_pursuit, stanley_steering
_limiting   LimitTwist, slow_for_obstacles
"""

from __future__ import annotations

from hfg.nodes.driving._following import pure_pursuit, stanley_steering
from hfg.nodes.driving._limiting import LimitTwist, slow_for_obstacles

__all__ = ["LimitTwist", "pure_pursuit", "slow_for_obstacles", "stanley_steering"]
