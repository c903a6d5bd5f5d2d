"""Seeing the robot: the map with both paths, distance and speed over time, what the sensors saw, in one report.

report ──── drawing     the map, the curves, and a moment seen from above, as SVG
"""

from examples.follow_person.showing.report import Showing

__all__ = ["Showing"]
