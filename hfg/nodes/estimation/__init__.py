"""Estimation: Kalman filters, tracks of many targets, odometry of wheels and of an IMU.

_kalman     predict, correct, KalmanFilter, AlphaBeta
_extended   ExtendedKalmanFilter
_tracks     cluster_detections, TrackPoints, which needs SciPy
_odometry   twists of differential, omnidirectional and Ackermann drives, IntegrateTwist, FuseGyro
"""

from __future__ import annotations

from hfg.geometry import Twist
from hfg.nodes.estimation._extended import ExtendedKalmanFilter
from hfg.nodes.estimation._kalman import AlphaBeta, KalmanFilter, correct, predict
from hfg.nodes.estimation._odometry import (
    FuseGyro,
    IntegrateTwist,
    OmniTwist,
    ackermann_twist,
    differential_twist,
    moved_by,
)
from hfg.nodes.estimation._tracks import PointTracks, Track, TrackPoints, cluster_detections

__all__ = [
    "AlphaBeta",
    "ExtendedKalmanFilter",
    "FuseGyro",
    "IntegrateTwist",
    "KalmanFilter",
    "OmniTwist",
    "PointTracks",
    "Track",
    "TrackPoints",
    "Twist",
    "ackermann_twist",
    "cluster_detections",
    "correct",
    "differential_twist",
    "moved_by",
    "predict",
]
