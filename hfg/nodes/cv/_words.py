"""Which functions of OpenCV are nodes, under which category they are found, and what their outputs are called.

Names are OpenCV's own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

__all__ = ["ABOUT", "APEX", "CATEGORIES", "NO_NODES", "OUTPUTS", "OVERLOADS"]

_CATEGORIES: Final[Mapping[str, str]] = {
    "filter": """
        GaussianBlur Laplacian Scharr Sobel bilateralFilter blur boxFilter edgePreservingFilter filter2D medianBlur
        pyrMeanShiftFiltering sepFilter2D spatialGradient sqrBoxFilter stackBlur buildOpticalFlowPyramid pyrDown pyrUp
        fastNlMeansDenoising fastNlMeansDenoisingColored fastNlMeansDenoisingMulti fastNlMeansDenoisingColoredMulti
    """,
    "geometry": """
        getRotationMatrix2D clipLine
        convertMaps copyMakeBorder flip flipND getAffineTransform getPerspectiveTransform getRectSubPix hconcat
        invertAffineTransform linearPolar logPolar perspectiveTransform remap repeat resize rotate transpose transposeND
        vconcat warpAffine warpPerspective warpPolar
    """,
    "colour": """
        LUT applyColorMap cvtColor cvtColorTwoPlane decolor demosaicing extractChannel insertChannel merge split
        transform
    """,
    "threshold": "adaptiveThreshold inRange threshold thresholdWithMask",
    "edges": """
        Canny HoughCircles HoughCirclesWithAccumulator HoughLines HoughLinesP HoughLinesPointSet
        HoughLinesWithAccumulator
    """,
    "features": """
        batchDistance cornerEigenValsAndVecs cornerHarris cornerMinEigenVal cornerSubPix goodFeaturesToTrack
        goodFeaturesToTrackWithQuality matchTemplate preCornerDetect
    """,
    "morphology": "dilate erode morphologyEx",
    "segmentation": """
        connectedComponents connectedComponentsWithAlgorithm connectedComponentsWithStats
        connectedComponentsWithStatsWithAlgorithm distanceTransform distanceTransformWithLabels filterSpeckles floodFill
        grabCut kmeans watershed
    """,
    "shapes": """
        HuMoments ellipse2Poly groupRectangles rectangleIntersectionArea
        approxPolyDP approxPolyN arcLength boundingRect boxPoints contourArea convexHull convexityDefects findContours
        findContoursLinkRuns fitEllipse fitEllipseAMS fitEllipseDirect fitLine getClosestEllipsePoints
        intersectConvexConvex isContourConvex matchShapes minAreaRect minEnclosingCircle minEnclosingConvexPolygon
        minEnclosingTriangle moments pointPolygonTest rotatedRectangleIntersection
    """,
    "drawing": """
        arrowedLine circle drawChessboardCorners drawContours drawFrameAxes drawKeypoints drawMarker drawMatches
        drawMatchesKnn ellipse fillConvexPoly fillPoly line polylines putText rectangle
    """,
    "histogram": "EMD calcBackProject calcHist compareHist equalizeHist",
    "arithmetic": """
        cubeRoot fastAtan2
        absdiff accumulate accumulateProduct accumulateSquare accumulateWeighted add addWeighted bitwise_and bitwise_not
        bitwise_or bitwise_xor blendLinear cartToPolar compare convertFp16 convertScaleAbs copyTo divide exp log
        magnitude max min multiply normalize patchNaNs phase polarToCart pow scaleAdd sqrt subtract
    """,
    "statistics": """
        PSNR checkRange countNonZero findNonZero hasNonZero integral integral2 integral3 mean meanStdDev minMaxLoc norm
        reduce reduceArgMax reduceArgMin sort sortIdx sumElems
    """,
    "matrix": """
        Mahalanobis PCABackProject PCACompute PCACompute2 PCAProject SVBackSubst SVDecomp calcCovarMatrix completeSymm
        dct dft determinant divSpectrums eigen eigenNonSymmetric gemm idct idft invert mulSpectrums mulTransposed
        setIdentity solve solveCubic solveLP solvePoly trace
    """,
    "motion": """
        CamShift calcOpticalFlowFarneback calcOpticalFlowPyrLK computeECC findTransformECC findTransformECCMultiScale
        findTransformECCWithMask meanShift phaseCorrelate phaseCorrelateIterative
    """,
    "calibration": """
        RQDecomp3x3 Rodrigues calibrateCamera calibrateHandEye calibrateRobotWorldHandEye calibrationMatrixValues
        checkChessboard composeRT computeCorrespondEpilines convertPointsFromHomogeneous convertPointsToHomogeneous
        correctMatches decomposeEssentialMat decomposeHomographyMat decomposeProjectionMatrix estimateAffine2D
        estimateAffine3D estimateAffinePartial2D estimateChessboardSharpness estimateTranslation2D
        estimateTranslation3D find4QuadCornerSubpix findChessboardCorners findChessboardCornersSB
        findChessboardCornersSBWithMeta findCirclesGrid findEssentialMat findFundamentalMat findHomography
        getDefaultNewCameraMatrix getOptimalNewCameraMatrix initCameraMatrix2D initInverseRectificationMap
        initUndistortRectifyMap matMulDeriv projectPoints recoverPose sampsonDistance solveP3P solvePnP solvePnPGeneric
        solvePnPRansac solvePnPRefineLM solvePnPRefineVVS triangulatePoints undistort undistortImagePoints
        undistortPoints undistortPointsIter
    """,
    "stereo": "reprojectImageTo3D stereoRectify stereoRectifyUncalibrated validateDisparity",
    "photo": """
        colorChange detailEnhance illuminationChange inpaint pencilSketch seamlessClone stylization textureFlattening
    """,
    "code": "imdecode imencode",
}
CATEGORIES: Final[Mapping[str, tuple[str, ...]]] = {name: tuple(words.split()) for name, words in _CATEGORIES.items()}
"""The functions of each category. A function that OpenCV adds is found under "other"."""

_MANY = "it needs the results of many pictures at once: hfg.nodes.vision:CameraCalibration collects them for one camera"
_SIZES = "the sizes of its matrices depend on each other: numpy and scipy.linalg do that"
_FILES = "it reads or writes files: hfg.nodes.files and hfg.nodes.video do that"
_SCREEN = "it needs a window: hfg.nodes.display shows pictures"
NO_NODES: Final[Mapping[str, str]] = {
    **dict.fromkeys(
        [
            "calibrateCamera",
            "calibrateCameraExtended",
            "calibrateCameraRO",
            "calibrateCameraROExtended",
            "calibrateHandEye",
            "calibrateRobotWorldHandEye",
            "initCameraMatrix2D",
            "rectify3Collinear",
            "stereoCalibrate",
            "stereoCalibrateExtended",
        ],
        _MANY,
    ),
    **dict.fromkeys(
        [
            "imdecodeWithMetadata",
            "imdecodeanimation",
            "imdecodemulti",
            "imencodeWithMetadata",
            "imencodemulti",
            "imwrite",
            "imwriteWithMetadata",
            "imwritemulti",
            "writeOpticalFlow",
        ],
        _FILES,
    ),
    **dict.fromkeys(["addText", "imshow", "selectROI", "selectROIs"], _SCREEN),
    **dict.fromkeys(["randShuffle", "randn", "randu"], "what it gives is not made of its inputs"),
    **dict.fromkeys(
        ["Mahalanobis", "PCABackProject", "PCAProject", "SVBackSubst", "gemm", "matMulDeriv", "solve", "solveLP"],
        _SIZES,
    ),
    "cvtColorTwoPlane": "its second picture has half the size of the first: join them, and cvt_color does it",
    "estimateChessboardSharpness": "its corners belong to one picture and board: hfg.nodes.vision:ChessboardFinder",
    "find4QuadCornerSubpix": "corner_sub_pix does it for all corners",
    "broadcast": "numpy does that: np.broadcast_to",
    "denoise_TVL1": "it gives nothing back",
    "mixChannels": "it writes into several arrays at once; split and merge do that",
    "filterHomographyDecompByVisibleRefpoints": "it takes several lists that depend on each other",
}
"""Functions that take arrays and are no nodes for all that, with the reason."""

OVERLOADS: Final[Mapping[str, int]] = {
    "findContoursLinkRuns": 0,
    "findEssentialMat": 0,
    "findFundamentalMat": 1,
    "findTransformECC": 1,
    "goodFeaturesToTrack": 0,
    "norm": 0,
    "recoverPose": 1,
    "findCirclesGrid": 1,
}
"""Which way to call a function is the node's; the first unless it stands here."""

OUTPUTS: Final[Mapping[str, Mapping[str, str]]] = {
    "CamShift": {"retval": "box"},
    "EMD": {"retval": "distance", "lowerBound": "lower_bound"},
    "buildOpticalFlowPyramid": {"retval": "levels"},
    "checkRange": {"retval": "in_range"},
    "connectedComponents": {"retval": "count"},
    "connectedComponentsWithAlgorithm": {"retval": "count"},
    "connectedComponentsWithStats": {"retval": "count"},
    "connectedComponentsWithStatsWithAlgorithm": {"retval": "count"},
    "decomposeHomographyMat": {"retval": "count"},
    "distanceTransformWithLabels": {"dst": "distance"},
    "eigen": {"retval": "found"},
    "estimateAffine3D": {"retval": "found", "out": "transform"},
    "estimateTranslation3D": {"retval": "found", "out": "translation"},
    "estimateAffine2D": {"retval": "transform"},
    "estimateAffinePartial2D": {"retval": "transform"},
    "estimateTranslation2D": {"retval": "translation"},
    "findChessboardCorners": {"retval": "found"},
    "findChessboardCornersSB": {"retval": "found"},
    "findChessboardCornersSBWithMeta": {"retval": "found"},
    "findCirclesGrid": {"retval": "found"},
    "findEssentialMat": {"retval": "essential"},
    "findFundamentalMat": {"retval": "fundamental"},
    "findHomography": {"retval": "homography"},
    "findTransformECC": {"retval": "correlation", "warpMatrix": "found"},
    "findTransformECCMultiScale": {"retval": "correlation", "warpMatrix": "found"},
    "findTransformECCWithMask": {"retval": "correlation", "warpMatrix": "found"},
    "filterSpeckles": {"img": "filtered"},
    "floodFill": {"retval": "area", "image": "filled", "mask": "flooded", "rect": "rect"},
    "fastNlMeansDenoising": {},
    "getOptimalNewCameraMatrix": {"retval": "camera_matrix_new", "validPixROI": "valid"},
    "grabCut": {"mask": "mask", "bgdModel": "background_model", "fgdModel": "foreground_model"},
    "groupRectangles": {},
    "imencode": {"retval": "encoded"},
    "intersectConvexConvex": {"retval": "area", "p12": "intersection"},
    "invert": {"retval": "condition"},
    "kmeans": {"retval": "compactness", "bestLabels": "labels"},
    "meanShift": {"retval": "rounds", "window": "window_found"},
    "mean": {"retval": "mean"},
    "minEnclosingConvexPolygon": {"retval": "area"},
    "minEnclosingTriangle": {"retval": "area"},
    "phaseCorrelate": {"retval": "shift"},
    "recoverPose": {"retval": "inliers"},
    "rotatedRectangleIntersection": {"retval": "kind", "intersectingRegion": "region"},
    "RQDecomp3x3": {"retval": "angles"},
    "solveCubic": {"retval": "count"},
    "solveP3P": {"retval": "count"},
    "solvePnP": {"retval": "found"},
    "solvePnPGeneric": {"retval": "count"},
    "solvePnPRansac": {"retval": "found"},
    "solvePoly": {"retval": "error"},
    "stereoRectifyUncalibrated": {"retval": "found"},
    "threshold": {"retval": "used"},
    "thresholdWithMask": {"retval": "used"},
}
"""What outputs are called instead of OpenCV's word for them."""

ABOUT: Final[Mapping[str, str]] = {
    "imencode": "Encode an image as a file of the given kind holds it.",
    "imdecode": "Decode an image from the bytes of a file.",
}
"""First lines of those that OpenCV does not describe."""

APEX: Final[Mapping[str, str]] = {
    "Canny": "Canny",
    "GaussianBlur": "GaussianBlur",
    "HoughCircles": "HoughCircle",
    "HoughLinesP": "HoughLinesP",
    "Laplacian": "Laplacian",
    "Scharr": "Scharr",
    "Sobel": "Sobel",
    "adaptiveThreshold": "AdaptiveThreshold",
    "applyColorMap": "MatrixToHeatmap",
    "bilateralFilter": "BilateralFilter",
    "bitwise_and": "SetOperation",
    "blur": "BoxBlur",
    "buildOpticalFlowPyramid": "Pyramid",
    "calcHist": "Histogram",
    "convertScaleAbs": "FloatToUchar ContrastBrightness",
    "copyMakeBorder": "CopyMakeBorder ImagePadding",
    "copyTo": "FilterApplyMask",
    "cornerEigenValsAndVecs": "EigenValsAndVecs",
    "cornerHarris": "CornerHarris",
    "cvtColor": "ColorConvert",
    "demosaicing": "Debayer",
    "distanceTransformWithLabels": "DistanceTransform",
    "drawKeypoints": "DisplayKeypoints",
    "equalizeHist": "Equalize",
    "findHomography": "FindHomography",
    "flip": "Flip",
    "getRectSubPix": "ExtractROI",
    "grabCut": "GrabCut",
    "inRange": "ColorSegmentation",
    "magnitude": "Magnitude",
    "meanStdDev": "MeanStdDev",
    "medianBlur": "MedianFilter",
    "merge": "Merge",
    "minMaxLoc": "MinMaxLoc",
    "morphologyEx": "Morpholocial",
    "multiply": "Times",
    "normalize": "Normalize",
    "putText": "ImageTextLabel",
    "rectangle": "RenderROIs",
    "resize": "Resize Scale",
    "rotate": "RotateImage",
    "split": "Split",
    "threshold": "MonoFilter",
    "undistort": "Undistort",
    "warpPerspective": "PerspectiveTransform",
}
"""The nodes of CS::APEX that a function stands for, in whole or for the most part."""
