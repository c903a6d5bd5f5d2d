"""Videos and cameras: sources that read them, a sink that writes them, and what changes from picture to picture.

    _reading   VideoFile, Camera
    _writing   WriteVideo
    _pictures  collage, Screenshot
    _motion    BackgroundSubtractor, FrameDifference, RunningMean, OpticalFlow, PointTracker, ObjectTracker

`hfg.nodes.vision` finds things in one picture, `hfg.nodes.cv` has OpenCV's functions.
"""

from __future__ import annotations

from hfg.nodes._extras import require

require("cv2", "vision")  # before the modules that import it

# isort: split
from hfg.nodes.video._motion import (  # noqa: E402
    BackgroundSubtractor,
    FrameDifference,
    ObjectTracker,
    OpticalFlow,
    PointTracker,
    RunningMean,
)
from hfg.nodes.video._pictures import Screenshot, collage  # noqa: E402
from hfg.nodes.video._reading import Camera, VideoFile  # noqa: E402
from hfg.nodes.video._writing import WriteVideo  # noqa: E402

__all__ = [
    "BackgroundSubtractor",
    "Camera",
    "FrameDifference",
    "ObjectTracker",
    "OpticalFlow",
    "PointTracker",
    "RunningMean",
    "Screenshot",
    "VideoFile",
    "WriteVideo",
    "collage",
]
