"""Mapping: occupancy grids from scans, scans matched against them, and maps in files as ROS has them.

_occupancy  MapScans, and OccupancyMap, its plain part
_fields     match_scan_to_grid
_slam       SlamScans: localisation in the map that is being built
_files      save_map, load_map, which need OpenCV

Matching needs SciPy.
"""

from __future__ import annotations

from hfg.nodes.mapping._fields import match_scan_to_grid
from hfg.nodes.mapping._files import load_map, save_map
from hfg.nodes.mapping._occupancy import MapScans, OccupancyMap
from hfg.nodes.mapping._slam import SlamScans

__all__ = ["MapScans", "OccupancyMap", "SlamScans", "load_map", "match_scan_to_grid", "save_map"]
