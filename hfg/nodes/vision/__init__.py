"""What is found in pictures: people, faces, objects, bar codes, markers, signs, chessboards, keypoints, depth.

These are OpenCV's objects: each keeps a detector or a matcher that is costly to make. `hfg.nodes.cv` has its functions.

    _detecting     PeopleDetector, CascadeDetector, BarcodeReader, MarkerDetector, ChessboardFinder, qr_code
    _keypoints     KeypointDetector, match_descriptors
    _depth         StereoDepth, CameraCalibration
    _marks         find_bullseyes, find_quadrilaterals
    _improving     EqualizeLocally
    _drawing       draw_boxes, draw_circles
    _regions       crop_image, crop_boxes
    _poses         marker_poses
    _networks      DetectObjects, and its parts: image_tensor, RunNetwork, yolo_boxes, ssd_boxes
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
from hfg.nodes.vision._networks import (  # noqa: E402
    DetectObjects,
    Placement,
    RunNetwork,
    image_tensor,
    ssd_boxes,
    yolo_boxes,
)
from hfg.nodes.vision._poses import MarkerPose, marker_poses  # noqa: E402
from hfg.nodes.vision._regions import crop_boxes, crop_image  # noqa: E402

__all__ = [
    "BarcodeReader",
    "Bullseye",
    "Calibration",
    "CameraCalibration",
    "CascadeDetector",
    "ChessboardFinder",
    "Circles",
    "DetectObjects",
    "EqualizeLocally",
    "KeypointDetector",
    "MarkerDetector",
    "MarkerPose",
    "PeopleDetector",
    "Placement",
    "RunNetwork",
    "StereoDepth",
    "crop_boxes",
    "crop_image",
    "draw_boxes",
    "draw_circles",
    "find_bullseyes",
    "find_quadrilaterals",
    "image_tensor",
    "marker_poses",
    "match_descriptors",
    "qr_code",
    "ssd_boxes",
    "yolo_boxes",
]
