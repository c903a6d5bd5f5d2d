"""Scans of lasers and point clouds: filtered, thinned, cut, grouped, and turned into grids for planning.

_scans      scans made, filtered, turned into clouds and back
_shaping    clouds cropped, thinned, flattened
_surfaces   planes by RANSAC, the ground
_clusters   Euclidean clusters
_grids      obstacle grids, and what it costs to cross them

Clusters and costs need SciPy.
"""

from __future__ import annotations

from hfg.nodes.clouds._clusters import Cluster, cluster_points
from hfg.nodes.clouds._grids import grid_costs, obstacle_grid
from hfg.nodes.clouds._scans import (
    cloud_to_scan,
    filter_scan_angles,
    filter_scan_median,
    filter_scan_ranges,
    filter_scan_shadows,
    make_scan,
    ranges_and_angles,
    rings_to_cloud,
    scan_to_cloud,
)
from hfg.nodes.clouds._shaping import crop_box, crop_distance, finite_points, flatten_cloud, voxel_grid
from hfg.nodes.clouds._surfaces import Plane, fit_plane, split_ground, split_plane

__all__ = [
    "Cluster",
    "Plane",
    "cloud_to_scan",
    "cluster_points",
    "crop_box",
    "crop_distance",
    "filter_scan_angles",
    "filter_scan_median",
    "filter_scan_ranges",
    "filter_scan_shadows",
    "finite_points",
    "fit_plane",
    "flatten_cloud",
    "grid_costs",
    "make_scan",
    "obstacle_grid",
    "ranges_and_angles",
    "rings_to_cloud",
    "scan_to_cloud",
    "split_ground",
    "split_plane",
    "voxel_grid",
]
