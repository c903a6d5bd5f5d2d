"""Seeing the robots: a video from above, the arena with their ways, what their cameras saw, in one report.

report ──── observing     what they believe, see and do, from the trace
│   ├────── top_view ──── cameras    one picture of the video; detections drawn in
│   ├────── ways          the arena with the ways, as SVG
│   └────── video         the file
"""

from examples.fetch_delivery.showing.report import Showing

__all__ = ["Showing"]
