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
    "denoise_TVL1": "it returns nothing",
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
    "approxPolyDP": "Approximate a curve by one with fewer corners (Douglas and Peucker).",
    "applyColorMap": "Colour a gray picture by a colour map.",
    "batchDistance": "Find the nearest rows of a table for each row of another one, by trying all.",
    "blendLinear": "Blend two pictures, each weighted pixel by pixel.",
    "calcBackProject": "Replace each pixel by the value of its histogram bin: how likely it is one of those.",
    "calcCovarMatrix": "Calculate the covariance matrix of samples, and their mean.",
    "calcHist": "Calculate the histogram of an image.",
    "checkChessboard": "Check quickly whether a picture shows a chessboard.",
    "clipLine": "Clip a line segment against a rectangle.",
    "colorChange": "Change the colours of a region of a picture without visible borders.",
    "connectedComponents": "Label connected regions of a binary image.",
    "connectedComponentsWithAlgorithm": "Label connected regions of a binary image by a chosen algorithm.",
    "connectedComponentsWithStats": "Label connected regions of a binary image, with box, area and centroid of each.",
    "connectedComponentsWithStatsWithAlgorithm": (
        "Label connected regions of a binary image by a chosen algorithm, with box, area and centroid of each."
    ),
    "copyTo": "Copy the pixels of an image that a mask selects; the others are 0.",
    "cornerHarris": "Calculate how much each pixel looks like a corner (Harris).",
    "demosaicing": "Make a colour or gray picture of the Bayer pattern of a camera's sensor.",
    "detailEnhance": "Enhance the details of a picture.",
    "distanceTransform": "Calculate the distance from each pixel to the nearest zero pixel.",
    "drawFrameAxes": "Draw the axes of a coordinate system whose pose is known.",
    "drawMatchesKnn": "Draw the matches of keypoints in two pictures, several for each keypoint.",
    "edgePreservingFilter": "Smooth a picture but keep its edges.",
    "extractChannel": "Take one channel out of an image.",
    "fastNlMeansDenoising": "Remove noise from a picture by comparing patches of it (non-local means).",
    "fastNlMeansDenoisingColored": "Remove noise from a colour picture by comparing patches of it (non-local means).",
    "fastNlMeansDenoisingColoredMulti": (
        "Remove noise from a colour picture by comparing patches of it and its neighbours in time (non-local means)."
    ),
    "fastNlMeansDenoisingMulti": (
        "Remove noise from a picture by comparing patches of it and of its neighbours in time (non-local means)."
    ),
    "findChessboardCornersSB": "Find the inner corners of a chessboard by a method that looks at sectors.",
    "findContoursLinkRuns": "Find contours in a binary image, by linking runs of pixels.",
    "findTransformECC": "Find the transform that aligns two pictures best (enhanced correlation coefficient).",
    "findTransformECCMultiScale": "Find the transform that aligns two pictures best, from coarse to fine scales.",
    "flipND": "Flip an array along one axis.",
    "getAffineTransform": "Calculate the affine transform that maps three points to three others.",
    "goodFeaturesToTrackWithQuality": "Find strong corners in a picture, and how strong each is.",
    "groupRectangles": "Merge rectangles that lie close to each other.",
    "hconcat": "Put pictures of one height side by side.",
    "HoughCirclesWithAccumulator": "Find circles in a gray picture (Hough transform), and how many points are on each.",
    "HoughLinesWithAccumulator": "Find lines in a binary picture (Hough transform), and how many points are on each.",
    "HuMoments": "Calculate the seven invariants of Hu from moments: numbers that stay when a shape turns.",
    "illuminationChange": "Change the light of a region of a picture without visible borders.",
    "insertChannel": "Put one channel into an image.",
    "integral": "Calculate the sums over all rectangles that begin at the upper left corner (integral image).",
    "integral2": "Calculate the integral image of a picture and that of its squares.",
    "integral3": "Calculate the integral images of a picture, of its squares, and turned by 45 degrees.",
    "merge": "Make one image of several channels.",
    "meanStdDev": "Calculate mean and standard deviation of each channel; the latter of a population, divided by n.",
    "PCACompute": "Find the principal components of samples.",
    "PCACompute2": "Find the principal components of samples, and how much each of them explains.",
    "pencilSketch": "Draw a picture as with a pencil.",
    "phaseCorrelate": "Find by how much one picture is shifted against another, by their phases.",
    "rectangleIntersectionArea": "Calculate the area in which two rectangles overlap.",
    "rotatedRectangleIntersection": "Find the region in which two rotated rectangles overlap.",
    "recoverPose": "Find how a camera has turned and moved, from an essential matrix and points in two pictures.",
    "reduceArgMax": "Find where the largest element along an axis is.",
    "reduceArgMin": "Find where the smallest element along an axis is.",
    "solveP3P": "Find the poses of an object that three of its points in a picture allow.",
    "solvePnP": "Find the pose of an object from its points in a picture.",
    "solvePnPGeneric": "Find all poses of an object that its points in a picture allow.",
    "solvePnPRansac": "Find the pose of an object from its points in a picture, of which some may be wrong (RANSAC).",
    "solvePnPRefineLM": "Refine the pose of an object from its points in a picture (Levenberg and Marquardt).",
    "solvePnPRefineVVS": "Refine the pose of an object from its points in a picture (visual servoing).",
    "sortIdx": "Find the order in which each row or column of a matrix is sorted.",
    "split": "Split an image into its channels.",
    "stackBlur": "Blur an image; nearly as smooth as a Gaussian blur, and fast for large kernels.",
    "stylization": "Make a picture look painted.",
    "SVDecomp": "Calculate the singular value decomposition of a matrix.",
    "textureFlattening": "Remove the texture of a region but keep its edges.",
    "thresholdWithMask": "Compare each pixel that a mask selects with a threshold.",
    "transposeND": "Exchange the axes of an array.",
    "triangulatePoints": "Calculate points in space from their places in the pictures of two cameras.",
    "undistortImagePoints": "Correct the lens distortion of points in a picture; the results are pixels again.",
    "undistortPointsIter": "Correct the lens distortion of points, to a given accuracy.",
    "validateDisparity": "Mark disparities that a check from right to left does not confirm.",
    "vconcat": "Put pictures of one width one below the other.",
    "warpPolar": "Map an image to polar coordinates, linear or logarithmic.",
}
"""First lines of those that OpenCV does not describe, or in words that need the page around them."""

ENTRIES: Final[Mapping[tuple[str, str], str]] = {
    ("remap", "map1"): "For each pixel of the result, the x of the pixel that it comes from.",
    ("remap", "map2"): "For each pixel of the result, the y of the pixel that it comes from.",
    ("convertMaps", "map1"): "For each pixel, the x of the pixel that it comes from.",
    ("convertMaps", "map2"): "For each pixel, the y of the pixel that it comes from.",
    ("kmeans", "data"): "The samples, one row for each.",
    ("LUT", "lut"): "The 256 values that take the place of 0 to 255, or of -128 to 127.",
    ("fastNlMeansDenoisingMulti", "srcImgs"): "Colour pictures of one size, in the order of time.",
    ("fastNlMeansDenoisingColoredMulti", "srcImgs"): "Colour pictures of one size, in the order of time.",
    ("mulTransposed", "src"): "The matrix.",
    ("triangulatePoints", "projPoints1"): "Points in the picture of the first camera, one row for each.",
    ("triangulatePoints", "projPoints2"): "The same points in the picture of the second camera, one row for each.",
    ("moments", "binaryImage"): "Count all pixels of an image that are not 0 alike.",
}
"""What is said of arguments that a node takes in fewer kinds than OpenCV does, or that OpenCV says too much of."""

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

_UNITS: Final[Mapping[str, str]] = {
    "px": """
        reps center epsilon inpaintRadius M maxLineGap maxRadius max_rho min_rho rho_step minDist minDistance
        minLineLength poly_sigma pt ransacReprojThreshold reprojectionError rho sigma_s sigmaSpace sigmaX sigmaY sp
        threshold
    """,
    "rad": "aeps max_theta min_theta theta theta_step",
    "deg": "angle startAngle endAngle",
    "mm": "apertureWidth apertureHeight",
    "of the value": """
        beta borderValue C delta gamma h hColor high_threshold low_threshold loDiff upDiff lowerb upperb maxDiff maxVal
        minVal maxValue maxval newVal R ranges s sigmaColor sr thresh threshold1 threshold2 value val
    """,
    "of the points": "length ransacThreshold",
    "1": """
        alpha blue_mul confidence criteria dp eps epsilon_percentage fontScale fx fy green_mul k minEigThreshold param
        param1 param2 power prob pyr_scale qualityLevel red_mul scale shade_factor sigma_r srn stn termcrit tipLength
        VVSlambda
    """,
}
_OF: Final[Mapping[str, str]] = {name: unit for unit, names in _UNITS.items() for name in names.split()}
_OF_FUNCTION: Final[Mapping[tuple[str, str], str]] = {
    ("addWeighted", "beta"): "1",
    ("illuminationChange", "beta"): "1",
}


def unit_of(function: str, argument: str) -> str | None:
    """Return the unit of a real number: "1" for a plain number, "of the value" for that of the pixels or numbers."""
    return _OF_FUNCTION.get((function, argument), _OF.get(argument))
