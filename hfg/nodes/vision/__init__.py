"""What is found in pictures: people, faces, bar codes, markers, signs, chessboards, keypoints, depth.

These are OpenCV's objects: each keeps a detector or a matcher that is costly to make. `hfg.nodes.cv` has its functions.

    _detecting     PeopleDetector, CascadeDetector, BarcodeReader, MarkerDetector, ChessboardFinder, qr_code
    _keypoints     KeypointDetector, match_descriptors
    _depth         StereoDepth, CameraCalibration
    _marks         find_bullseyes, find_quadrilaterals
    _improving     EqualizeLocally
    _drawing       draw_boxes, draw_circles
"""

from __future__ import annotations

from hfg.nodes._extras import require

require("cv2", "vision")  # before the modules that import it

# isort: split
from hfg.nodes.vision._depth import Calibration, CameraCalibration, StereoDepth  # noqa: E402
from hfg.nodes.vision._detecting import (  # noqa: E402
    BarcodeReader,
    CascadeDetector,
    ChessboardFinder,
    MarkerDetector,
    PeopleDetector,
    qr_code,
)
from hfg.nodes.vision._drawing import Circles, draw_boxes, draw_circles  # noqa: E402
from hfg.nodes.vision._improving import EqualizeLocally  # noqa: E402
from hfg.nodes.vision._keypoints import KeypointDetector, match_descriptors  # noqa: E402
from hfg.nodes.vision._marks import Bullseye, find_bullseyes, find_quadrilaterals  # noqa: E402

__all__ = [
    "BarcodeReader",
    "Bullseye",
    "Calibration",
    "CameraCalibration",
    "CascadeDetector",
    "ChessboardFinder",
    "Circles",
    "EqualizeLocally",
    "KeypointDetector",
    "MarkerDetector",
    "PeopleDetector",
    "StereoDepth",
    "draw_boxes",
    "draw_circles",
    "find_bullseyes",
    "find_quadrilaterals",
    "match_descriptors",
    "qr_code",
]
