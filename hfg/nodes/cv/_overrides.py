"""What neither the stub nor the documentation of OpenCV says: kinds of arrays, defaults, limits and choices.

An argument is looked up under its function first, then only under its name. Names are OpenCV's own. A test calls every
function with each default of ours and without it: both give the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any, Final, Literal, NamedTuple, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt
from annotated_types import Ge, Gt, Interval, Le, Len, MinLen, Predicate

from hfg.base.values import Colour
from hfg.encoding.pictures import need_fair_size
from hfg.images import Color, Gray, Labels, Mask, Matrix, OneOf, Points, Rows
from hfg.nodes._encodable import is_encodable
from hfg.nodes._making import port_name
from hfg.nodes.cv._room import copy_with_room
from hfg.nodes.cv._stub import enumerations
from hfg.ports.specs import REQUIRED
from hfg.types import Named, Pixels, Shape

Convert: TypeAlias = Callable[[Any, Mapping[str, Any]], Any]
"""Turns the value of a port into OpenCV's argument; it sees the inputs by name."""


class Say(NamedTuple):
    """Declarations about one argument.

    Attributes:
      hint: its type; None to take the stub's.
      default: REQUIRED if there is no declaration.
      convert: makes OpenCV's argument of the value.
      port: it is an input, although it is not an array.
      drop: it is omitted; OpenCV makes it.
      given: what OpenCV is given for an argument that is dropped but that it wants to have.
    """

    hint: Any = None
    default: Any = REQUIRED
    convert: Convert | None = None
    port: bool = False
    drop: bool = False
    given: Any = REQUIRED


Size: TypeAlias = tuple[int, int]
Board: TypeAlias = Annotated[tuple[int, int], Interval(ge=1, le=200)]
# OpenCV computes with numbers of 16 or 32 bits; what lies beyond ends the process (getRectSubPix) or takes minutes.
Position: TypeAlias = Annotated[tuple[int, int], Interval(ge=-32767, le=32767)]
Exact: TypeAlias = Annotated[tuple[float, float], Interval(ge=-32767, le=32767)]
Box: TypeAlias = Annotated[tuple[int, int, int, int], Interval(ge=-32767, le=32767)]
Channels: TypeAlias = Annotated[tuple[float, ...], Len(1, 4)]
Rotated: TypeAlias = tuple[tuple[float, float], tuple[float, float], float]
Reals: TypeAlias = np.float32 | np.float64

Kernel: TypeAlias = Annotated[npt.NDArray[np.uint8 | np.int32 | Reals], Shape(None, None), Named("Kernel")]
Element: TypeAlias = Annotated[npt.NDArray[np.uint8], Shape(None, None), Named("Element")]
Intrinsics: TypeAlias = Annotated[npt.NDArray[Reals], Shape(3, 3), Named("Intrinsics")]
Three: TypeAlias = Annotated[npt.NDArray[Reals], Shape(3, 3), Named("Matrix3x3")]
Four: TypeAlias = Annotated[npt.NDArray[Reals], Shape(4, 4), Named("Matrix4x4")]
Affine: TypeAlias = Annotated[npt.NDArray[Reals], Shape(2, 3), Named("Matrix2x3")]
Projection: TypeAlias = Annotated[npt.NDArray[Reals], Shape(3, 4), Named("Matrix3x4")]
Distortion: TypeAlias = Annotated[
    npt.NDArray[Reals],
    OneOf((4,), (5,), (8,), (1, 4), (1, 5), (1, 8), (4, 1), (5, 1), (8, 1), (1, 14), (14, 1)),
    Named("Distortion"),
]
Vector3: TypeAlias = Annotated[npt.NDArray[Reals], OneOf((3,), (3, 1), (1, 3)), Named("Vector3")]
Corners: TypeAlias = Annotated[npt.NDArray[np.float32], Rows(2), Named("Corners")]
Exacts: TypeAlias = Annotated[npt.NDArray[Reals], Rows(2), Named("ImagePoints")]
Solids: TypeAlias = Annotated[npt.NDArray[Reals], Rows(3), Named("ObjectPoints")]
FlatPoints: TypeAlias = Annotated[npt.NDArray[np.float32], OneOf((4, 2), (4, 1, 2)), Named("FourCorners")]
ThreePoints: TypeAlias = Annotated[npt.NDArray[np.float32], OneOf((3, 2), (3, 1, 2)), Named("ThreeCorners")]
DoubleThree: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(3, 3), Named("Matrix3x3")]
Doubles: TypeAlias = Annotated[npt.NDArray[np.float64], Shape(1, None, 2), Named("PointRow")]
Histogram: TypeAlias = Annotated[npt.NDArray[np.float32], OneOf((None,), (None, 1), (None, None)), Named("Histogram")]
Numbers: TypeAlias = Annotated[npt.NDArray[Reals], OneOf((None,), (None, 1), (1, None)), Named("Numbers")]
Bytes: TypeAlias = Annotated[npt.NDArray[np.uint8], OneOf((None,), (1, None), (None, 1)), Named("Bytes")]
RealImage: TypeAlias = Annotated[npt.NDArray[Reals], Pixels(), Named("RealImage")]
RealPlane: TypeAlias = Annotated[npt.NDArray[Reals], Pixels(1), Named("RealPlane")]
FloatPlane: TypeAlias = Annotated[npt.NDArray[np.float32], Pixels(1), Named("FloatPlane")]


ShapeOrPoints: TypeAlias = (
    Points | Annotated[npt.NDArray[np.uint8 | np.uint16 | np.int16 | Reals], Pixels(1), Named("Plane")]
)
"""A contour, or an image of which the pixels that are not 0 are meant."""
GrayOrPoints: TypeAlias = Points | Gray
OneOrThree: TypeAlias = Annotated[npt.NDArray[np.uint8], Pixels(1, 3), Named("Mask")]


def is_odd(value: int) -> bool:
    """Say whether a number is odd."""
    return value % 2 == 1


def sides_are_odd(value: Size) -> bool:
    """Say whether width and height are odd numbers from 1 to 255."""
    return all(side % 2 == 1 and 1 <= side <= 255 for side in value)


def window_is_small(value: Size) -> bool:
    """Say whether width and height are 1 to 255."""
    return 1 <= value[0] <= 255 and 1 <= value[1] <= 255


def sides_fit(value: Size) -> bool:
    """Say whether width and height are 1 to 16384."""
    return 1 <= value[0] <= 16384 and 1 <= value[1] <= 16384


def _int(default: Any, low: int | None = None, high: int | None = None, *, odd: bool = False) -> Say:
    return Say(_limited(int, low, high, [Predicate(is_odd)] if odd else []), default)


def _float(default: Any, low: float | None = None, high: float | None = None, *, above: float | None = None) -> Say:
    return Say(_limited(float, low, high, [] if above is None else [Gt(above)]), default)


def _limited(hint: Any, low: float | None, high: float | None, more: list[Any]) -> Any:
    limits = [*([] if low is None else [Ge(low)]), *([] if high is None else [Le(high)]), *more]
    for limit in limits:
        hint = Annotated[hint, limit]
    return hint


def _pick(group: str, default: str, prefix: str | None = None, *, less: str = "") -> Say:
    """One constant of a group."""
    names = _names(group, prefix, less)
    return Say(Literal[tuple(names)], default, lambda value, inputs: names[value])


def _several(constants: str, default: tuple[str, ...] = ()) -> Say:
    """Any number of constants, whose prefix is written once: "CALIB_ A B"."""
    prefix, *words = constants.split()
    names = {word: int(getattr(cv2, prefix + word)) for word in words}

    def add(value: Any, inputs: Mapping[str, Any]) -> int:
        total = 0
        for word in value:
            total |= names[word]
        return total

    return Say(frozenset[Literal[tuple(names)]], frozenset(default), add)  # type: ignore[misc]


def _words(constants: str, default: str) -> Say:
    """One of some constants, whose prefix is written once: "LMEDS"."""
    prefix, *words = constants.split()
    prefix = "" if prefix == "-" else prefix
    names = {word: int(getattr(cv2, prefix + word)) for word in words}
    return Say(Literal[tuple(names)], default, lambda value, inputs: names[value])


def _names(group: str, prefix: str | None, less: str) -> dict[str, int]:
    constants = [one for one in enumerations()[group] if one not in less.split() and hasattr(cv2, one)]
    if prefix is None:
        prefix = constants[0][: constants[0].find("_") + 1]
    return {one.removeprefix(prefix): int(getattr(cv2, one)) for one in constants if one.startswith(prefix)}


_DTYPES: Final = {"same": -1, "uint8": 0, "int8": 1, "uint16": 2, "int16": 3, "int32": 4, "float32": 5, "float64": 6}


def _dtype(default: str, *allowed: str) -> Say:
    """The type of the result's pixels."""
    words = allowed or ("same", "uint8", "uint16", "int16", "float32", "float64")
    return Say(Literal[tuple(words)], default, lambda value, inputs: _DTYPES[value])


def _sizes(default: Any, *, odd: bool = False) -> Say:
    return Say(Annotated[Size, Predicate(sides_are_odd if odd else sides_fit)], default)


def _criteria(count: int, epsilon: float) -> Say:
    """Return how many rounds at most, and what change is small enough to stop."""
    both = cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS
    return Say(
        Annotated[tuple[int, float], Predicate(rounds_are_few)],
        (count, epsilon),
        lambda value, inputs: (both, max(1, value[0]), value[1]),
    )


def rounds_are_few(value: tuple[int, float]) -> bool:
    """Say whether there are 1 to 10000 rounds and the change is 0 to 1e9."""
    return 1 <= value[0] <= 10000 and 0 <= value[1] <= 1e9  # OpenCV squares it, and stops before it begins


def can_be_encoded(value: str) -> bool:
    """Say whether a text has no half of a pair of surrogates, for which OpenCV ends the process."""
    return is_encodable(value)


def _first(inputs: Mapping[str, Any]) -> Any:
    return next(iter(inputs.values()))


def _as_image(value: Any, inputs: Mapping[str, Any]) -> Any:
    height, width = _first(inputs).shape[:2]
    return (width, height) if value is None else value


def _in_the_middle(value: Any, inputs: Mapping[str, Any]) -> Any:
    height, width = _first(inputs).shape[:2]
    return ((width - 1) / 2, (height - 1) / 2) if value is None else value


def _to_the_corner(value: Any, inputs: Mapping[str, Any]) -> Any:
    height, width = _first(inputs).shape[:2]
    return float(np.hypot(width, height) / 2) if value is None else value


def _all_but_the_rim(value: Any, inputs: Mapping[str, Any]) -> Any:
    height, width = _first(inputs).shape[:2]
    return (1, 1, max(1, width - 2), max(1, height - 2)) if value is None else value


def _for_each_channel(value: Any, inputs: Mapping[str, Any]) -> Any:
    shape = _first(inputs).shape
    channels = shape[2] if len(shape) == 3 else 1
    return np.array([*value, *[value[-1]] * channels][:channels], np.float64)


def _in_the_middle_of_dst(value: Any, inputs: Mapping[str, Any]) -> Any:
    height, width = inputs["dst"].shape[:2]
    return (width // 2, height // 2) if value is None else value


def _threshold_type(value: Any, inputs: Mapping[str, Any]) -> int:
    """The ways to find the threshold are added to what is done with it."""
    for found in ("OTSU", "TRIANGLE"):
        if value.endswith(f"_{found}"):
            return int(getattr(cv2, f"THRESH_{value.removesuffix('_' + found)}") + getattr(cv2, f"THRESH_{found}"))
    return int(getattr(cv2, f"THRESH_{value}"))


def bins_are_few(value: tuple[int, ...]) -> bool:
    """Say whether there are 1 to 2 ** 20 bins."""
    return all(one >= 1 for one in value) and int(np.prod(value, dtype=object)) <= 2**20


def _in_a_list(value: Any, inputs: Mapping[str, Any]) -> Any:
    return [value]


def _in_columns(value: Any, inputs: Mapping[str, Any]) -> Any:
    """Return points as OpenCV takes a single one, too: n x 2 numbers are n x 1 pairs."""
    return np.reshape(value, (-1, 1, value.shape[-1]))


def _among_rows(value: Any, inputs: Mapping[str, Any]) -> Any:
    """OpenCV reads in a few rows above and below the picture."""
    return copy_with_room(value, rows=4)


def _painted(value: Colour, inputs: Mapping[str, Any]) -> tuple[float, ...]:
    """Return a colour as the picture has it: how light it is where there is one channel, else blue, green, red."""
    shape = _first(inputs).shape
    if len(shape) == 2 or shape[2] == 1:
        return (0.299 * value.red + 0.587 * value.green + 0.114 * value.blue,)
    return (*map(float, value.bgr), 255.0)


PAINT: Final = Say(Colour, Colour(0, 255, 0), _painted)
SAME_SIZE: Final = Say(Annotated[Size, Predicate(sides_fit)] | None, None, _as_image)
MIDDLE: Final = Say(Exact | None, None, _in_the_middle)
DROP: Final = Say(drop=True)
NOTHING: Final = Say(drop=True, given=None)
IMAGE: Final = Say()
INTERPOLATION: Final = _pick("InterpolationFlags", "LINEAR", "INTER_", less="INTER_MAX")
ROBUST: Final = _words("- RANSAC LMEDS", "RANSAC")
ROBUST_OR_ALL: Final = _words("USAC_ DEFAULT", "DEFAULT")


def _each(names: list[str], said: Mapping[str, Say]) -> dict[str, Mapping[str, Say]]:
    """Say the same of several functions."""
    return dict.fromkeys(names, said)


COMMON: Final[Mapping[str, Say]] = {
    # arrays
    **dict.fromkeys(["mask", "inputMask", "templateMask", "inpaintMask", "referenceMask", "sampleMask"], Say(Mask)),
    **dict.fromkeys(["contour", "curve", "points", "contour1", "contour2", "p1", "p2"], Say(Points)),
    **dict.fromkeys(["pts", "contours"], Say(Annotated[list[Points], MinLen(1)])),
    **dict.fromkeys(["points1", "points2", "srcPoints", "dstPoints", "imagePoints"], Say(Exacts)),
    **dict.fromkeys(["prevPts", "corners", "projPoints1", "projPoints2"], Say(Corners)),
    "objectPoints": Say(Solids),
    **dict.fromkeys(["cameraMatrix", "cameraMatrix1", "cameraMatrix2", "newCameraMatrix", "K"], Say(Intrinsics)),
    **dict.fromkeys(["distCoeffs", "distCoeffs1", "distCoeffs2"], Say(Distortion)),
    **dict.fromkeys(["rvec", "tvec", "rvec1", "tvec1", "rvec2", "tvec2", "T"], Say(Vector3)),
    **dict.fromkeys(["F", "E", "H", "R"], Say(Three)),
    **dict.fromkeys(["projMatrix", "projMatr1", "projMatr2"], Say(Projection)),
    "Q": Say(Four),
    "kernel": Say(Kernel),
    **dict.fromkeys(["kernelX", "kernelY"], Say(Numbers)),
    **dict.fromkeys(["H1", "H2", "hist"], Say(Histogram)),
    **dict.fromkeys(["mtx", "A", "B", "data", "samples", "eigenvectors", "mean"], Say(Matrix)),
    **dict.fromkeys(["box", "rect1", "rect2", "ellipse_params"], Say(Rotated, port=True)),
    # numbers and choices
    "borderType": _pick("BorderTypes", "DEFAULT", less="BORDER_WRAP BORDER_TRANSPARENT BORDER_ISOLATED"),
    "borderMode": _pick("BorderTypes", "CONSTANT", less="BORDER_TRANSPARENT BORDER_ISOLATED"),
    "borderValue": Say(Channels, (0.0,)),
    "interpolation": INTERPOLATION,
    "ddepth": _dtype("same"),
    "dtype": _dtype("same"),
    "ksize": _int(3, 1, 31, odd=True),
    "blockSize": _int(3, 1, 255),
    "anchor": Say(Position, (-1, -1)),
    "scale": _float(1.0, -1e15, 1e15),  # times NaN or infinity, the kernels of filters have NaN
    "delta": _float(0.0),
    "iterations": _int(1, 0, 1000),
    "normalize": Say(bool, True),
    "color": PAINT,
    "thickness": _int(1, -1, 255),
    **dict.fromkeys(["lineType", "line_type"], _pick("LineTypes", "8", "LINE_")),
    "shift": _int(0, 0, 16),
    "offset": Say(Position, (0, 0)),
    "pt1": Say(Position, (8, 8)),
    "pt2": Say(Position, (24, 24)),
    "center": Say(Position, (16, 16)),
    "angleInDegrees": Say(bool, False),
    "criteria": _criteria(30, 0.01),
    "patternSize": Say(Board, (9, 6)),
    "imageSize": _sizes((640, 480)),
    "imgsize": _sizes((640, 480)),
    "connectivity": Say(Literal[8, 4], 8),
    "ltype": _dtype("int32", "int32", "uint16"),
    "ccltype": _pick("ConnectedComponentsAlgorithmsTypes", "DEFAULT"),
    "normType": _pick("NormTypes", "L2", less="NORM_TYPE_MASK NORM_RELATIVE NORM_MINMAX NORM_HAMMING NORM_HAMMING2"),
    "distanceType": _words("DIST_ L1 L2 C", "L2"),
    "distType": _words("DIST_ L1 L2 L12 FAIR WELSCH HUBER", "L2"),
    "maskSize": _pick("DistanceTransformMasks", "MASK_PRECISE", "DIST_"),
    "type": _pick("ThresholdTypes", "BINARY", less="THRESH_MASK THRESH_DRYRUN"),
    "thresh": _float(127.0),
    "maxval": _float(255.0),
    "sdepth": _dtype("same", "same", "int32", "float32", "float64"),
    "sqdepth": _dtype("same", "same", "float32", "float64"),
    "ransacReprojThreshold": _float(3.0, 0.0),
    "confidence": _float(0.99, 0.0, 0.999999),
    "maxIters": _int(2000, 1, 100000),
    "refineIters": _int(10, 0, 1000),
    "closed": Say(bool, True),
    "alpha": _float(1.0),
    "beta": _float(0.0),
    "flags": _int(0, 0),
    "winSize": Say(Annotated[Size, Predicate(window_is_small)], (21, 21)),
    "maxLevel": _int(3, 0, 16),
    "handleMissingValues": Say(bool, False),
    "hint": DROP,
    "useExtrinsicGuess": DROP,
    "centerPrincipalPoint": Say(bool, False),
    "conjB": Say(bool, False),
    "lastIndex": Say(bool, False),
    "axis": _int(0, 0, 1),
    "templateWindowSize": _int(7, 1, 31, odd=True),
    "searchWindowSize": _int(21, 1, 61, odd=True),
    "warpMatrix": Say(Annotated[npt.NDArray[np.float32], Shape(2, 3), Named("Warp")]),
    "motionType": _words("MOTION_ TRANSLATION EUCLIDEAN AFFINE", "AFFINE"),
    "gaussFiltSize": _int(5, 1, 31, odd=True),
    "dstCn": _int(0, 0, 4),
    "minDistance": _float(10.0, 0.0, 32767.0),
    "qualityLevel": _float(0.01, above=0.0, high=1.0),
    "maxCorners": _int(100, 0, 100000),
    "useHarrisDetector": Say(bool, False),
    "k": _float(0.04),
    "rho": _float(1.0, 0.1, 100.0),
    "theta": _float(float(np.pi / 180), 0.001, 3.2),
    "srn": _float(0.0, 0.0, 100.0),
    "stn": _float(0.0, 0.0, 100.0),
    "min_theta": _float(0.0, 0.0, float(np.pi)),
    "max_theta": _float(float(np.pi), 0.0, float(np.pi)),
    "use_edgeval": Say(bool, False),
    "solveMethod": _pick("DecompTypes", "LU"),
}

_MATCHES: Final[Mapping[str, Say]] = {
    "img1": Say(Annotated[npt.NDArray[np.uint8], Pixels(1, 3), Named("Picture")]),
    "img2": Say(Annotated[npt.NDArray[np.uint8], Pixels(1, 3), Named("Picture")]),
    "keypoints1": Say(list[cv2.KeyPoint]),
    "keypoints2": Say(list[cv2.KeyPoint]),
    "outImg": NOTHING,
    "matchColor": PAINT,
    "singlePointColor": Say(Colour, Colour(255, 0, 0), _painted),
    "matchesMask": DROP,
    "flags": _several("DRAW_MATCHES_FLAGS_ NOT_DRAW_SINGLE_POINTS DRAW_RICH_KEYPOINTS"),
}

FUNCTIONS: Final[Mapping[str, Mapping[str, Say]]] = {
    "HuMoments": {"m": Say(dict[str, float], port=True)},
    "clipLine": {
        "imgRect": Say(Box, (0, 0, 640, 480)),
        "pt1": Say(Position, port=True),
        "pt2": Say(Position, port=True),
    },
    "cubeRoot": {"val": Say(float, port=True)},
    "ellipse2Poly": {
        "center": Say(Position, port=True),
        "axes": Say(Annotated[Size, Predicate(sides_fit)], (12, 6)),
        "angle": _int(0, 0, 360),
        "arcStart": _int(0, 0, 360),
        "arcEnd": _int(360, 0, 360),
        "delta": _int(5, 1, 90),
    },
    "fastAtan2": {"y": Say(float, port=True), "x": Say(float, port=True)},
    "getRotationMatrix2D": {"angle": Say(float, port=True), "center": Say(Exact, (0.0, 0.0))},
    "groupRectangles": {
        "rectList": Say(list[Box], port=True),
        "groupThreshold": _int(1, 0, 1000),
        "eps": _float(0.2, 0.0),
    },
    "rectangleIntersectionArea": {
        **dict.fromkeys(["a", "b"], Say(tuple[float, float, float, float], port=True)),
    },
    "CamShift": {"probImage": Say(Gray), "window": Say(Box, (8, 8, 16, 16)), "criteria": _criteria(10, 1.0)},
    "meanShift": {"probImage": Say(Gray), "window": Say(Box, (8, 8, 16, 16)), "criteria": _criteria(10, 1.0)},
    "Canny": {
        "threshold1": _float(100.0, 0.0),
        "threshold2": _float(200.0, 0.0),
        "apertureSize": Say(Literal[3, 5, 7], 3),
        "L2gradient": Say(bool, False),
    },
    "EMD": {
        "signature1": Say(FloatPlane),
        "signature2": Say(FloatPlane),
        "distType": _words("DIST_ L1 L2 C", "L2"),
        "cost": DROP,
        "lowerBound": DROP,
    },
    "GaussianBlur": {
        "ksize": _sizes((5, 5), odd=True),
        "sigmaX": _float(0.0, 0.0),
        "sigmaY": _float(0.0, 0.0),
    },
    **_each(
        ["HoughCircles", "HoughCirclesWithAccumulator"],
        {
            "image": Say(convert=_among_rows),
            "method": _words("HOUGH_ GRADIENT GRADIENT_ALT", "GRADIENT"),
            "dp": _float(1.0, 1.0, 10.0),
            "minDist": _float(20.0, 1.0, 32767.0),
            "param1": _float(100.0, 0.1),
            "param2": _float(100.0, 0.1),  # with almost nothing GRADIENT_ALT reads beyond its memory
            "minRadius": _int(0, 0),
            "maxRadius": _int(0),
        },
    ),
    "HoughLines": {"threshold": _int(100, 1)},
    "HoughLinesWithAccumulator": {"threshold": _int(100, 1)},
    "HoughLinesP": {"threshold": _int(50, 1), "minLineLength": _float(0.0, 0.0), "maxLineGap": _float(0.0, 0.0)},
    "HoughLinesPointSet": {
        "point": Say(Annotated[npt.NDArray[np.float32 | np.int32], Shape(None, 1, 2), Named("PointSet")]),
        "lines_max": _int(20, 1, 1000),
        "threshold": _int(1, 1),
        "min_rho": _float(0.0, 0.0),
        "max_rho": _float(360.0, 1.0, 10000.0),
        "rho_step": _float(1.0, 0.1),
        "theta_step": _float(float(np.pi / 180), 0.001),
        "max_theta": _float(float(np.pi / 2), 0.0, float(np.pi)),
    },
    "LUT": {"lut": Say(Annotated[npt.NDArray[np.uint8], OneOf((256,), (256, 1), (1, 256)), Named("Table")])},
    "Laplacian": {"ksize": _int(1, 1, 31, odd=True)},
    "PCACompute": {"mean": NOTHING, "eigenvectors": DROP, "maxComponents": _int(0, 0)},
    "PCACompute2": {"mean": NOTHING, "eigenvectors": DROP, "eigenvalues": DROP, "maxComponents": _int(0, 0)},
    "PSNR": {"R": _float(255.0, above=0.0)},
    "RQDecomp3x3": {"src": Say(Three)},
    "Rodrigues": {"src": Say(Annotated[npt.NDArray[Reals], OneOf((3,), (3, 1), (1, 3), (3, 3)), Named("Rotation")])},
    "SVDecomp": {"src": Say(Matrix), "flags": _several("SVD_ MODIFY_A NO_UV FULL_UV")},
    "Scharr": {"ddepth": _dtype("same"), "dx": _int(1, 0, 1), "dy": _int(0, 0, 1)},
    "Sobel": {"dx": _int(1, 0, 2), "dy": _int(0, 0, 2), "ksize": Say(Literal[1, 3, 5, 7], 3)},
    "accumulate": {"dst": Say(RealImage)},
    "accumulateProduct": {"dst": Say(RealImage)},
    "accumulateSquare": {"dst": Say(RealImage)},
    "accumulateWeighted": {"dst": Say(RealImage), "alpha": _float(0.1, 0.0, 1.0)},
    "adaptiveThreshold": {
        "maxValue": _float(255.0, 0.0),
        "adaptiveMethod": _pick("AdaptiveThresholdTypes", "MEAN_C", "ADAPTIVE_THRESH_"),
        "thresholdType": _words("THRESH_ BINARY BINARY_INV", "BINARY"),
        "blockSize": _int(11, 3, 255, odd=True),
        "C": _float(2.0),
    },
    "addWeighted": {"alpha": _float(0.5), "beta": _float(0.5), "gamma": _float(0.0)},
    "applyColorMap": {"colormap": _pick("ColormapTypes", "JET")},
    "approxPolyDP": {"epsilon": _float(3.0, 0.0)},
    "approxPolyN": {
        "nsides": _int(4, 3, 100),
        "epsilon_percentage": _float(-1.0),
        "ensure_convex": Say(bool, True),
    },
    "arrowedLine": {"tipLength": _float(0.1, 0.0, 1.0)},
    "batchDistance": {
        "src1": Say(FloatPlane),
        "src2": Say(FloatPlane),
        "dtype": _dtype("float32", "float32"),
        "normType": _words("NORM_ L1 L2 L2SQR", "L2"),
        "K": _int(1, 1, 1000),
        "mask": DROP,
        "update": DROP,
        "crosscheck": DROP,
    },
    "bilateralFilter": {"d": _int(5, -1, 25), "sigmaColor": _float(50.0, 0.0), "sigmaSpace": _float(50.0, 0.0, 100.0)},
    "blendLinear": {"weights1": Say(FloatPlane), "weights2": Say(FloatPlane)},
    "blur": {"ksize": _sizes((3, 3))},
    "boundingRect": {"array": Say(GrayOrPoints)},
    "boxFilter": {"ksize": _sizes((3, 3))},
    "sqrBoxFilter": {"ksize": _sizes((3, 3)), "ddepth": _dtype("float32", "float32", "float64", "same")},
    "buildOpticalFlowPyramid": {
        "withDerivatives": Say(bool, True),
        "pyrBorder": _pick("BorderTypes", "REFLECT_101", less="BORDER_TRANSPARENT BORDER_ISOLATED BORDER_WRAP"),
        "derivBorder": _pick("BorderTypes", "CONSTANT", less="BORDER_TRANSPARENT BORDER_ISOLATED BORDER_WRAP"),
        "tryReuseInputImage": DROP,
    },
    "calcBackProject": {
        "images": Say(None, REQUIRED, _in_a_list),
        "channels": Say(Annotated[tuple[int, ...], MinLen(1)], (0,)),
        "ranges": Say(Annotated[tuple[float, ...], MinLen(2)], (0.0, 256.0)),
        "hist": Say(Annotated[npt.NDArray[np.float32], OneOf((None, 1)), Named("Histogram")]),
    },
    "calcCovarMatrix": {
        "mean": NOTHING,
        "flags": _several("COVAR_ NORMAL SCRAMBLED SCALE ROWS COLS", ("NORMAL", "ROWS")),
        "ctype": _dtype("float64", "float32", "float64"),
    },
    "calcHist": {
        "images": Say(None, REQUIRED, _in_a_list),
        "channels": Say(Annotated[tuple[int, ...], Len(1, 3)], (0,)),
        "histSize": Say(Annotated[tuple[int, ...], Len(1, 3), Predicate(bins_are_few)], (256,)),
        "ranges": Say(Annotated[tuple[float, ...], Len(2, 6)], (0.0, 256.0)),
        "accumulate": DROP,
    },
    "calcOpticalFlowFarneback": {
        "flow": NOTHING,
        "pyr_scale": _float(0.5, 0.1, 0.9),
        "levels": _int(3, 1, 16),
        "winsize": _int(15, 1, 101),
        "iterations": _int(3, 1, 100),
        "poly_n": Say(Literal[5, 7], 5),
        "poly_sigma": _float(1.2, above=0.0),
        "flags": _words("OPTFLOW_ FARNEBACK_GAUSSIAN", "FARNEBACK_GAUSSIAN"),
    },
    "calcOpticalFlowPyrLK": {
        "nextPts": NOTHING,
        "criteria": _criteria(30, 0.01),
        "flags": _several("OPTFLOW_ LK_GET_MIN_EIGENVALS"),
        "minEigThreshold": _float(1e-4, 0.0),
    },
    "calibrationMatrixValues": {"apertureWidth": _float(0.0, 0.0), "apertureHeight": _float(0.0, 0.0)},
    "cartToPolar": {},
    "checkChessboard": {"size": Say(Board, (9, 6))},
    "checkRange": {"quiet": Say(drop=True, given=True), "minVal": _float(-1e308), "maxVal": _float(1e308)},
    "circle": {"radius": _int(8, 0, 16384)},
    "colorChange": {
        "src": Say(Color),
        "mask": Say(OneOrThree),
        "red_mul": _float(1.0, 0.0, 2.5),
        "green_mul": _float(1.0, 0.0, 2.5),
        "blue_mul": _float(1.0, 0.0, 2.5),
    },
    "compare": {"cmpop": _pick("CmpTypes", "EQ")},
    "compareHist": {"method": _pick("HistCompMethods", "CORREL", less="HISTCMP_HELLINGER")},
    "completeSymm": {"m": Say(Matrix), "lowerToUpper": Say(bool, False)},
    "computeCorrespondEpilines": {"points": Say(Corners), "whichImage": Say(Literal[1, 2], 1)},
    "contourArea": {"oriented": Say(bool, False)},
    "convertMaps": {
        "map1": Say(FloatPlane),
        "map2": Say(FloatPlane),
        "dstmap1type": _words("CV_ 16SC2 32FC1 32FC2", "16SC2"),
        "nninterpolation": Say(bool, False),
    },
    "convertPointsFromHomogeneous": {"src": Say(Solids)},
    "convertPointsToHomogeneous": {"src": Say(Exacts)},
    "convexHull": {"clockwise": Say(bool, False), "returnPoints": Say(bool, True)},
    "convexityDefects": {
        "contour": Say(Annotated[npt.NDArray[np.int32], Rows(2), Named("Contour")]),
        "convexhull": Say(Annotated[npt.NDArray[np.int32], OneOf((None, 1)), Named("Indices")]),
    },
    "copyMakeBorder": {
        **dict.fromkeys(["top", "bottom", "left", "right"], _int(8, 0, 4096)),
        "borderType": _pick("BorderTypes", "CONSTANT", less="BORDER_TRANSPARENT BORDER_ISOLATED"),
        "value": Say(Channels, (0.0,)),
    },
    "cornerHarris": {"blockSize": _int(2, 1, 31), "k": _float(0.04)},
    "cornerSubPix": {
        "winSize": Say(Annotated[Size, Predicate(window_is_small)], (5, 5)),
        "zeroZone": Say(Size, (-1, -1)),
    },
    "correctMatches": {
        "F": Say(DoubleThree),
        **dict.fromkeys(["points1", "points2"], Say(Doubles)),
    },
    "cvtColor": {"code": _pick("ColorConversionCodes", "BGR2GRAY", "COLOR_", less="COLOR_COLORCVT_MAX")},
    "dct": {"flags": _several("DCT_ INVERSE ROWS")},
    "idct": {"flags": _several("DCT_ ROWS")},
    "demosaicing": {
        "code": _words("COLOR_Bayer BG2BGR GB2BGR RG2BGR GR2BGR BG2GRAY GB2GRAY RG2GRAY GR2GRAY", "BG2BGR"),
    },
    "decomposeHomographyMat": {},
    "detailEnhance": {"src": Say(Color), "sigma_s": _float(10.0, 0.0, 200.0), "sigma_r": _float(0.15, 0.0, 1.0)},
    "determinant": {},
    "dft": {"flags": _several("DFT_ INVERSE SCALE ROWS COMPLEX_OUTPUT REAL_OUTPUT"), "nonzeroRows": _int(0, 0)},
    "idft": {"flags": _several("DFT_ SCALE ROWS COMPLEX_OUTPUT REAL_OUTPUT"), "nonzeroRows": _int(0, 0)},
    **_each(
        ["dilate", "erode"],
        {
            "kernel": Say(Element, None),
            "borderType": _pick("BorderTypes", "CONSTANT", less="BORDER_TRANSPARENT BORDER_ISOLATED BORDER_WRAP"),
            "borderValue": DROP,
        },
    ),
    "morphologyEx": {
        "op": _pick("MorphTypes", "OPEN", less="MORPH_HITMISS"),
        "kernel": Say(Element, None),
        "borderType": _pick("BorderTypes", "CONSTANT", less="BORDER_TRANSPARENT BORDER_ISOLATED BORDER_WRAP"),
        "borderValue": DROP,
    },
    "distanceTransform": {"dstType": DROP},  # uint8 is for one kind of distance only
    "distanceTransformWithLabels": {
        "maskSize": _words("DIST_MASK_ 5", "5"),
        "labelType": _pick("DistanceTransformLabelTypes", "CCOMP", "DIST_LABEL_"),
    },
    "divSpectrums": {"flags": _several("DFT_ ROWS")},
    "mulSpectrums": {"flags": _several("DFT_ ROWS")},
    "drawChessboardCorners": {"patternWasFound": Say(bool, True)},
    "drawContours": {
        "contourIdx": _int(-1, -1),
        "hierarchy": DROP,  # wrong numbers in it end the process
        "maxLevel": DROP,
    },
    "drawFrameAxes": {"thickness": _int(3, -1, 255), "length": _float(1.0, above=0.0)},
    "drawKeypoints": {
        "keypoints": Say(list[cv2.KeyPoint]),
        "outImage": NOTHING,
        "color": PAINT,
        "flags": _several("DRAW_MATCHES_FLAGS_ DRAW_RICH_KEYPOINTS"),
    },
    "drawMatches": {**_MATCHES, "matches1to2": Say(list[cv2.DMatch])},
    "drawMatchesKnn": {**_MATCHES, "matches1to2": Say(list[list[cv2.DMatch]])},
    "drawMarker": {
        "position": Say(Position, (16, 16)),
        "markerType": _pick("MarkerTypes", "CROSS"),
        "markerSize": _int(20, 1, 1000),
    },
    "edgePreservingFilter": {
        "src": Say(Color),
        "flags": _words("- RECURS_FILTER NORMCONV_FILTER", "RECURS_FILTER"),
        "sigma_s": _float(60.0, 0.0, 200.0),
        "sigma_r": _float(0.4, 0.0, 1.0),
    },
    "eigen": {"src": Say(Matrix)},
    "eigenNonSymmetric": {"src": Say(Matrix)},
    "ellipse": {
        "axes": Say(Annotated[Size, Predicate(sides_fit)], (12, 6)),
        "angle": _float(0.0),
        "startAngle": _float(0.0),
        "endAngle": _float(360.0),
    },
    **_each(
        ["estimateAffine2D", "estimateAffinePartial2D", "estimateTranslation2D"],
        {"from_": Say(Corners), "to": Say(Corners), "method": ROBUST},
    ),
    **_each(
        ["estimateAffine3D", "estimateTranslation3D"],
        {
            "src": Say(Solids),
            "dst": Say(Solids),
            "ransacThreshold": _float(3.0, above=0.0),
            "out": DROP,
        },
    ),
    "exp": {},
    "extractChannel": {"coi": _int(0, 0, 3)},
    "insertChannel": {"src": Say(Gray), "dst": Say(Color), "coi": _int(0, 0, 2)},
    "fastNlMeansDenoising": {"h": _float(3.0, 0.0)},
    "fastNlMeansDenoisingColored": {"src": Say(Color), "h": _float(3.0, 0.0), "hColor": _float(3.0, 0.0)},
    **_each(
        ["fastNlMeansDenoisingMulti", "fastNlMeansDenoisingColoredMulti"],
        {
            "srcImgs": Say(Annotated[list[Color], MinLen(1)]),
            "imgToDenoiseIndex": _int(0, 0, 10000),
            "temporalWindowSize": _int(1, 1, 15, odd=True),
            "h": _float(3.0, 0.0),
            "hColor": _float(3.0, 0.0),
        },
    ),
    "fillConvexPoly": {"points": Say(Annotated[npt.NDArray[np.int32], Rows(2), Named("Contour")])},
    "fillPoly": {"pts": Say(Annotated[list[Annotated[npt.NDArray[np.int32], Rows(2), Named("Contour")]], MinLen(1)])},
    "polylines": {
        "pts": Say(Annotated[list[Annotated[npt.NDArray[np.int32], Rows(2), Named("Contour")]], MinLen(1)]),
        "isClosed": Say(bool, True),
    },
    "filterSpeckles": {
        "img": Say(Annotated[npt.NDArray[np.int16 | np.uint8], Pixels(1), Named("Disparity")]),
        "newVal": _float(0.0),
        "maxSpeckleSize": _int(100, 0),
        "maxDiff": _float(16.0, 0.0),
        "buf": DROP,
    },
    "findChessboardCorners": {
        "flags": _several(
            "CALIB_CB_ ADAPTIVE_THRESH NORMALIZE_IMAGE FILTER_QUADS FAST_CHECK", ("ADAPTIVE_THRESH", "NORMALIZE_IMAGE")
        ),
    },
    **_each(
        ["findChessboardCornersSB", "findChessboardCornersSBWithMeta"],
        {"flags": _several("CALIB_CB_ NORMALIZE_IMAGE EXHAUSTIVE ACCURACY LARGER MARKER")},
    ),
    "findCirclesGrid": {
        "flags": _several("CALIB_CB_ SYMMETRIC_GRID ASYMMETRIC_GRID CLUSTERING", ("SYMMETRIC_GRID",)),
        "blobDetector": DROP,
        "patternSize": Say(Board, (4, 3)),
    },
    "findContours": {
        "mode": _pick("RetrievalModes", "EXTERNAL", less="RETR_FLOODFILL"),
        "method": _pick("ContourApproximationModes", "SIMPLE", "CHAIN_APPROX_", less="CHAIN_APPROX_LINK_RUNS"),
    },
    "findEssentialMat": {
        "method": ROBUST,
        "prob": _float(0.999, above=0.0, high=0.999999),
        "threshold": _float(1.0, above=0.0),
        "maxIters": _int(1000, 1, 100000),
    },
    "findFundamentalMat": {"method": _words("FM_ RANSAC LMEDS 7POINT 8POINT", "RANSAC")},
    "findHomography": {
        "method": Say(
            Literal["ALL", "RANSAC", "LMEDS", "RHO"],
            "ALL",
            lambda value, inputs: {"ALL": 0, "RANSAC": cv2.RANSAC, "LMEDS": cv2.LMEDS, "RHO": cv2.RHO}[value],
        ),
        "confidence": _float(0.995, 0.0, 0.999999),
    },
    **_each(["findTransformECC"], {"criteria": _criteria(50, 0.001)}),
    "findTransformECCWithMask": {"criteria": _criteria(50, 1e-6)},
    "findTransformECCMultiScale": {"eccParams": DROP},
    "findNonZero": {
        # float16 is read as if it were float64
        "src": Say(
            Annotated[
                npt.NDArray[np.uint8 | np.int8 | np.uint16 | np.int16 | np.int32 | Reals], Pixels(1), Named("Plane")
            ]
        )
    },
    "fitLine": {
        "param": _float(0.0, 0.0),
        "reps": _float(0.01, 0.0),
        "aeps": _float(0.01, 0.0),
    },
    "flip": {
        "flipCode": Say(
            Literal["horizontal", "vertical", "both"],
            "horizontal",
            lambda value, inputs: {"horizontal": 1, "vertical": 0, "both": -1}[value],
        )
    },
    "floodFill": {
        "mask": NOTHING,
        "seedPoint": Say(Position, (0, 0)),
        "newVal": Say(Colour, Colour(255, 255, 255), _painted),
        "loDiff": Say(Channels, (0.0, 0.0, 0.0, 0.0)),
        "upDiff": Say(Channels, (0.0, 0.0, 0.0, 0.0)),
        "flags": _words("FLOODFILL_ FIXED_RANGE", "FIXED_RANGE"),
    },
    "getAffineTransform": {"src": Say(ThreePoints), "dst": Say(ThreePoints)},
    "getPerspectiveTransform": {"src": Say(FlatPoints), "dst": Say(FlatPoints)},
    "getClosestEllipsePoints": {"points": Say(Corners)},
    "getOptimalNewCameraMatrix": {
        "alpha": _float(0.0, 0.0, 1.0),
        "newImgSize": Say(Size, (0, 0)),
    },
    "getRectSubPix": {
        "patchSize": _sizes((16, 16)),
        "center": MIDDLE,
        "patchType": _dtype("same", "same", "float32"),
    },
    "goodFeaturesToTrack": {},
    "goodFeaturesToTrackWithQuality": {"gradientSize": Say(Literal[3, 5, 7], 3)},
    "grabCut": {
        "img": Say(Color),
        "mask": NOTHING,
        "rect": Say(Box | None, None, _all_but_the_rim),
        "bgdModel": NOTHING,
        "fgdModel": NOTHING,
        "iterCount": _int(3, 1, 100),
        "mode": _words("GC_ INIT_WITH_RECT", "INIT_WITH_RECT"),
    },
    "hconcat": {"src": Say(Annotated[list[Color], MinLen(1)])},
    "vconcat": {"src": Say(Annotated[list[Color], MinLen(1)])},
    "merge": {"mv": Say(Annotated[list[Gray], Len(1, 4)])},
    "illuminationChange": {
        "src": Say(Color),
        "mask": Say(OneOrThree),
        "alpha": _float(0.2, 0.0, 2.0),
        "beta": _float(0.4, 0.0, 2.0),
    },
    "imdecode": {"buf": Say(Bytes), "flags": _words("IMREAD_ COLOR GRAYSCALE UNCHANGED ANYDEPTH", "COLOR")},
    "imencode": {"ext": Say(Literal[".png", ".jpg", ".bmp", ".tiff", ".webp"], ".png"), "params": DROP},
    "inRange": {
        "lowerb": Say(Channels, (0.0,), _for_each_channel),
        "upperb": Say(Channels, (127.0,), _for_each_channel),
    },
    **_each(
        ["initInverseRectificationMap", "initUndistortRectifyMap"],
        {"size": _sizes((640, 480)), "m1type": _words("CV_ 32FC1 16SC2 32FC2", "32FC1")},
    ),
    "inpaint": {
        "inpaintRadius": _float(3.0, 0.0, 50.0),
        "flags": _words("INPAINT_ NS TELEA", "TELEA"),
    },
    "intersectConvexConvex": {"handleNested": Say(bool, True)},
    "invert": {"src": Say(Matrix), "flags": _words("DECOMP_ LU SVD CHOLESKY EIG", "LU")},
    "invertAffineTransform": {"M": Say(Affine)},
    "kmeans": {
        "data": Say(Annotated[npt.NDArray[np.float32], Shape(None, None), Named("Samples")]),
        "K": _int(2, 1, 1000),
        "bestLabels": NOTHING,
        "criteria": _criteria(10, 1.0),
        "attempts": _int(3, 1, 100),
        "flags": _words("KMEANS_ RANDOM_CENTERS PP_CENTERS", "PP_CENTERS"),
    },
    "linearPolar": {"center": MIDDLE, "maxRadius": _float(100.0, above=0.0), "flags": INTERPOLATION},
    "logPolar": {"center": MIDDLE, "M": _float(20.0, above=0.0), "flags": INTERPOLATION},
    "matchShapes": {
        **dict.fromkeys(["contour1", "contour2"], Say(GrayOrPoints)),
        "method": _pick("ShapeMatchModes", "I1", "CONTOURS_MATCH_"),
        "parameter": Say(drop=True, given=0.0),
    },
    "matchTemplate": {"method": _pick("TemplateMatchModes", "CCOEFF_NORMED"), "mask": DROP},
    "medianBlur": {"ksize": _int(3, 1, 255, odd=True)},
    "minEnclosingConvexPolygon": {"points": Say(Corners), "k": _int(4, 4, 100)},  # 3 reads at address 0
    "moments": {"array": Say(ShapeOrPoints), "binaryImage": Say(bool, False)},
    "mulTransposed": {"src": Say(Matrix), "aTa": Say(bool, True), "delta": DROP},
    "normalize": {
        "dst": NOTHING,
        "norm_type": _words("NORM_ INF L1 L2 MINMAX", "L2"),
    },
    "patchNaNs": {"a": Say(Annotated[npt.NDArray[Reals], Pixels(), Named("RealImage")]), "val": _float(0.0)},
    "pencilSketch": {
        "src": Say(Color),
        "sigma_s": _float(60.0, 0.0, 200.0),
        "sigma_r": _float(0.07, 0.0, 1.0),
        "shade_factor": _float(0.02, 0.0, 0.1),
    },
    "perspectiveTransform": {
        "src": Say(Annotated[npt.NDArray[Reals], Shape(None, 1, 2), Named("PointList")]),
        "m": Say(Three),
    },
    "phaseCorrelate": {"window": Say(RealPlane)},
    "phaseCorrelateIterative": {"L2size": _int(7, 1, 31, odd=True), "maxIters": _int(10, 1, 1000)},
    "pointPolygonTest": {"pt": Say(Exact, (16.0, 16.0)), "measureDist": Say(bool, True)},
    "pow": {"power": _float(2.0)},
    "projectPoints": {"aspectRatio": DROP},
    "putText": {
        "text": Say(Annotated[str, Len(0, 1000), Predicate(can_be_encoded)], "hfg"),
        "org": Say(Position, (8, 24)),
        "fontFace": _pick("HersheyFonts", "SIMPLEX", "FONT_HERSHEY_"),
        "fontScale": _float(1.0, above=0.0, high=100.0),
        "bottomLeftOrigin": Say(bool, False),
    },
    **_each(
        ["pyrDown", "pyrUp"],
        {"dstsize": DROP, "borderType": _words("BORDER_ DEFAULT", "DEFAULT")},
    ),
    "pyrMeanShiftFiltering": {
        "sp": _float(5.0, 1.0, 50.0),
        "sr": _float(20.0, 1.0, 255.0),
        "maxLevel": _int(1, 0, 8),
        "termcrit": _criteria(5, 1.0),
    },
    "recoverPose": {
        **dict.fromkeys(["E", "cameraMatrix"], Say(DoubleThree)),
    },
    "reduce": {
        "dim": _int(0, 0, 1),
        "rtype": _pick("ReduceTypes", "AVG"),
        "dtype": _dtype("float32", "same", "int32", "float32", "float64"),
    },
    "remap": {"map1": Say(FloatPlane), "map2": Say(FloatPlane)},
    "repeat": {"ny": _int(2, 1, 16), "nx": _int(2, 1, 16)},
    "reprojectImageTo3D": {"ddepth": _dtype("same", "same", "int16", "int32", "float32")},
    "resize": {
        "dsize": Say(Annotated[Size, Predicate(sides_fit)] | None, None),
        "fx": _float(0.5, above=0.0, high=16.0),
        "fy": _float(0.5, above=0.0, high=16.0),
    },
    "rotate": {"rotateCode": _pick("RotateFlags", "90_CLOCKWISE")},
    "sampsonDistance": {
        "pt1": Say(Annotated[npt.NDArray[np.float64], OneOf((3,), (3, 1)), Named("Homogeneous")]),
        "pt2": Say(Annotated[npt.NDArray[np.float64], OneOf((3,), (3, 1)), Named("Homogeneous")]),
        "F": Say(DoubleThree),
    },
    "scaleAdd": {},
    "seamlessClone": {
        "src": Say(Color),
        "dst": Say(Color),
        "mask": Say(Annotated[npt.NDArray[np.uint8], Pixels(1, 3, 4), Named("Mask")]),
        "p": Say(Position | None, None, _in_the_middle_of_dst),
        "flags": _words("- NORMAL_CLONE MIXED_CLONE MONOCHROME_TRANSFER", "NORMAL_CLONE"),
    },
    "setIdentity": {"s": Say(Channels, (1.0,))},
    "solveCubic": {"coeffs": Say(Annotated[npt.NDArray[Reals], OneOf((1, 4), (4, 1)), Named("Coefficients")])},
    "solvePoly": {"coeffs": Say(Numbers), "maxIters": _int(300, 1, 10000)},
    "solveP3P": {
        "objectPoints": Say(Annotated[npt.NDArray[Reals], OneOf((3, 3), (3, 1, 3)), Named("ThreePoints")]),
        "imagePoints": Say(Annotated[npt.NDArray[Reals], OneOf((3, 2), (3, 1, 2)), Named("ThreeCorners")]),
        "flags": _words("SOLVEPNP_ P3P AP3P", "P3P"),
    },
    "solvePnP": {"flags": _pick("SolvePnPMethod", "ITERATIVE", less="SOLVEPNP_MAX_COUNT")},
    "solvePnPGeneric": {
        "flags": _pick("SolvePnPMethod", "ITERATIVE", less="SOLVEPNP_MAX_COUNT"),
        "rvec": DROP,
        "tvec": DROP,
    },
    "solvePnPRansac": {
        "iterationsCount": _int(100, 1, 100000),
        "reprojectionError": _float(8.0, above=0.0),
        "flags": _pick("SolvePnPMethod", "ITERATIVE", less="SOLVEPNP_MAX_COUNT"),
    },
    "solvePnPRefineLM": {"criteria": DROP},
    "solvePnPRefineVVS": {"criteria": DROP, "VVSlambda": _float(1.0, 0.0)},
    **_each(
        ["sort", "sortIdx"],
        {"flags": _several("SORT_ EVERY_ROW EVERY_COLUMN ASCENDING DESCENDING")},
    ),
    "spatialGradient": {"ksize": Say(Literal[3], 3), "borderType": _words("BORDER_ DEFAULT REPLICATE", "DEFAULT")},
    "split": {"m": IMAGE},
    "stackBlur": {"ksize": _sizes((5, 5), odd=True)},
    "stereoRectify": {
        "flags": _several("CALIB_ ZERO_DISPARITY", ("ZERO_DISPARITY",)),
        "alpha": _float(-1.0, -1.0, 1.0),
        "newImageSize": Say(Size, (0, 0)),
    },
    "stereoRectifyUncalibrated": {"imgSize": _sizes((640, 480)), "threshold": _float(5.0, 0.0)},
    "stylization": {"src": Say(Color), "sigma_s": _float(60.0, 0.0, 200.0), "sigma_r": _float(0.45, 0.0, 1.0)},
    "textureFlattening": {
        "src": Say(Color),
        "mask": Say(OneOrThree),
        "low_threshold": _float(30.0, 0.0),
        "high_threshold": _float(45.0, 0.0),
        "kernel_size": Say(Literal[3, 5, 7], 3),
    },
    "threshold": {
        "type": Say(
            Literal[
                "BINARY",
                "BINARY_INV",
                "TRUNC",
                "TOZERO",
                "TOZERO_INV",
                "BINARY_OTSU",
                "BINARY_INV_OTSU",
                "BINARY_TRIANGLE",
                "BINARY_INV_TRIANGLE",
            ],
            "BINARY",
            _threshold_type,
        )
    },
    "thresholdWithMask": {"dst": IMAGE, "type": _words("THRESH_ BINARY BINARY_INV TRUNC TOZERO TOZERO_INV", "BINARY")},
    "transform": {
        "src": Say(Annotated[npt.NDArray[np.uint8 | np.float32], Pixels(3), Named("Picture")]),
        "m": Say(Annotated[npt.NDArray[Reals], OneOf((3, 3), (3, 4)), Named("Mixture")]),
    },
    "triangulatePoints": dict.fromkeys(["projPoints1", "projPoints2"], Say(Corners, convert=_in_columns)),
    "transposeND": {"order": Say(tuple[int, ...], (1, 0))},
    "undistortImagePoints": {"src": Say(Exacts), "arg1": DROP},
    "undistortPoints": {"src": Say(Exacts), "P": Say(Three)},
    "undistortPointsIter": {"src": Say(Exacts), "P": Say(Three), "criteria": _criteria(5, 0.01)},
    "validateDisparity": {
        "disparity": Say(Annotated[npt.NDArray[np.int16], Pixels(1), Named("Disparity")]),
        "cost": Say(Annotated[npt.NDArray[np.int16 | np.int32], Pixels(1), Named("Cost")]),
        "minDisparity": _int(0),
        "numberOfDisparities": _int(16, 1, 512),
        "disp12MaxDisp": _int(1, 0),
    },
    "warpAffine": {
        "M": Say(Affine),
        "dsize": SAME_SIZE,
        "flags": INTERPOLATION,
    },
    "warpPerspective": {"M": Say(Three), "dsize": SAME_SIZE, "flags": INTERPOLATION},
    "warpPolar": {
        "dsize": SAME_SIZE,
        "center": MIDDLE,
        "maxRadius": Say(Annotated[float, Gt(0.0)] | None, None, _to_the_corner),
        "flags": INTERPOLATION,
    },
    "watershed": {"image": Say(Color), "markers": Say(Labels)},
    "convertScaleAbs": {},
    "convertFp16": {"src": Say(FloatPlane)},
    "copyTo": {"mask": Say(Annotated[npt.NDArray[np.uint8], Pixels(1, 2, 3, 4), Named("Mask")])},
    "preCornerDetect": {"ksize": Say(Literal[1, 3, 5, 7], 3)},
    "cornerEigenValsAndVecs": {"ksize": Say(Literal[1, 3, 5, 7], 3)},
    "cornerMinEigenVal": {"ksize": Say(Literal[1, 3, 5, 7], 3)},
}


class Need(NamedTuple):
    """A requirement on the values of a firing beyond their types; without it OpenCV ends the process or never returns.

    Attributes:
      says: when it is not met, as a part of a sentence, for the documentation.
      wrong: says what is wrong, or None; it sees inputs and parameters by OpenCV's names.
    """

    says: str
    wrong: Callable[[Mapping[str, Any], Mapping[str, Any]], str | None]


_LARGEST: Final = 1e15


def _near(name: str) -> Need:
    """Numbers that are NaN, or so large that squares or differences overflow, become places beyond the memory."""

    def wrong(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
        array = inputs[name]
        if array.dtype.kind != "f" or bool((np.abs(array) <= _LARGEST).all()):
            return None
        return f"{name} has a number that is not within 1e15; clip it, or replace NaN and infinity, first"

    return Need(f"{name} has a number that is not within 1e15", wrong)


def _matches_name_keypoints(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
    pairs = [inputs["matches1to2"]] if not _is_nested(inputs["matches1to2"]) else inputs["matches1to2"]
    first, second = len(inputs["keypoints1"]), len(inputs["keypoints2"])
    for match in (one for pair in pairs for one in pair):
        if not (0 <= match.queryIdx < first and 0 <= match.trainIdx < second):
            return (
                f"a match names the keypoints {match.queryIdx} and {match.trainIdx}, and there are {first} and {second}"
            )
    return None


def _is_nested(matches: Any) -> bool:
    return bool(matches) and isinstance(matches[0], list)


def _anchor_is_inside(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
    """Intel's filters read from where the anchor says before OpenCV looks at it."""
    width, height = parameters.get("ksize") or _size_of(inputs.get("kernel"))
    x, y = parameters["anchor"]
    if -1 <= x < width and -1 <= y < height:
        return None
    return f"the anchor {x}, {y} is outside of the kernel of {width} x {height}; -1, -1 is its middle"


_MOST_STEPS: Final = 10**12
"""Of one firing; about ten minutes."""


def _work_ends(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
    """An element that is not a rectangle is applied point by point, and again in each iteration."""
    kernel = inputs.get("kernel")
    if kernel is None or bool(np.all(kernel)):
        return None
    points, iterations = int(np.count_nonzero(kernel)), int(parameters["iterations"])
    steps = inputs["src"].size * points * iterations
    if steps <= _MOST_STEPS:
        return None
    return (
        f"an element of {points:,} points in {iterations:,} iterations needs {steps:,} steps, the limit is "
        f"{_MOST_STEPS:,}; make the picture or the element smaller, or use a rectangle"
    )


def _size_of(kernel: Any) -> tuple[int, int]:
    return (3, 3) if kernel is None else (kernel.shape[1], kernel.shape[0])


def _power_fits(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
    """OpenCV takes integers for float64 when the power is not an integer, and writes beyond the picture."""
    power = parameters["power"]
    if inputs["src"].dtype in (np.float32, np.float64) or (float(power).is_integer() and abs(power) < 2**31):
        return None
    return f"the power {power:g} needs an array of float32 or float64; {inputs['src'].dtype} takes whole powers only"


def _has_an_absolute_value(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
    """For a negative power OpenCV looks the absolute value up in a table, and -2 ** 31 of int32 has none."""
    array = inputs["src"]
    if parameters["power"] >= 0 or array.dtype != np.int32 or array.size == 0 or array.min() > -(2**31):
        return None
    return "src has -2,147,483,648, which int32 cannot negate; clip it, or convert src to float64, for a negative power"


def _maps_are_alike(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
    first, second = inputs["map1"], inputs.get("map2")
    if second is None or first.shape[:2] == second.shape[:2]:
        return None
    return f"map1 is {_shown(first)} and map2 {_shown(second)}; they have one size"


def _corners_fill_the_board(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
    columns, rows = parameters["patternSize"]
    count = len(inputs["corners"])
    if not parameters["patternWasFound"] or count == columns * rows:
        return None
    return f"a board of {columns} x {rows} that was found has {columns * rows} corners, and there are {count}"


def _points_are_pairs(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
    first, second = len(inputs["projPoints1"]), len(inputs["projPoints2"])
    return None if first == second else f"there are {first} points of the first camera and {second} of the second"


def _steps_are_in_the_picture(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
    """With longer steps there is no place to count in."""
    height, width = inputs["image"].shape[:2]
    rho, most = parameters["rho"], 2 * (width + height) + 1
    if rho <= most:
        return None
    return f"rho is {rho:g}, more than {most}, the most that lines in a picture of {height} x {width} are apart"


def _mask_is_alike(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
    name = "src" if "src" in inputs else "src1"
    src, mask = inputs[name], inputs.get("mask")
    if mask is None or src.shape[:2] == mask.shape[:2]:
        return None
    return f"{name} is {_shown(src)} and mask {_shown(mask)}; they have one size"


def _is_wide(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
    return None if inputs["src"].shape[1] >= 2 else "src is one pixel wide, and needs two"


def _points_are_no_line(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
    """OpenCV turns round and round a hull that is as thin as its rounding, 1e-5."""
    hull = cv2.convexHull(inputs["points"])
    if len(hull) <= 3 or min(cv2.minAreaRect(hull)[1]) >= 1e-3:
        return None
    return "the points lie almost on a line, within a thousandth of a pixel; fit_line takes them"


def _disparities_are_of_the_range(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
    """OpenCV counts by the disparity without a look whether it is one."""
    disparity, cost = inputs["disparity"], inputs["cost"]
    if disparity.shape[:2] != cost.shape[:2]:
        return f"disparity is {_shown(disparity)} and cost {_shown(cost)}; they have one size"
    least = parameters["minDisparity"]
    most = least + parameters["numberOfDisparities"]
    counted = disparity[disparity != (least - 1) * 16]
    if not counted.size or (counted.min() >= least * 16 and counted.max() < most * 16):
        return None
    return f"disparity has numbers that are not within {least * 16} and {most * 16 - 1}, sixteenths of the disparities"


def _labels_are_few(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
    """OpenCV marks pixels of 32 bits by their highest bits, and follows invalid marks beyond the image."""
    image = inputs["image"]
    if image.dtype != np.int32 or (image.min() >= 0 and image.max() <= 2**29):
        return None
    return "image has a number that is not within 0 and 2 ** 29; clip it, or convert it to uint8, first"


def _finite(*names: str) -> Need:
    """Refuse what is not a number, or infinite: OpenCV counts such elements in one place and not in another."""

    def wrong(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
        for name in names:
            array = inputs.get(name)
            if array is not None and array.dtype.kind == "f" and not bool(np.isfinite(array).all()):
                return f"{port_name(name)} has NaN or infinity; replace it first, as patch_nans does for NaN"
        return None

    return Need(f"{' or '.join(map(port_name, names))} has NaN or infinity", wrong)


def _picture_is_fair(inputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> str | None:
    try:
        need_fair_size(bytes(inputs["buf"]), "the picture")
    except ValueError as error:
        return str(error)
    return None


def _shown(array: Any) -> str:
    return f"{array.shape[0]} x {array.shape[1]}"


_MATCHED: Final = Need("a match names a keypoint that is not there", _matches_name_keypoints)
_ONE_SIZE: Final = Need("the mask has another size", _mask_is_alike)
_NEEDED: Final[tuple[tuple[str, Need], ...]] = (
    ("kmeans", _near("data")),
    ("bilateralFilter", _near("src")),
    ("drawMatches drawMatchesKnn", _MATCHED),
    (
        "blur boxFilter dilate erode filter2D morphologyEx sqrBoxFilter",
        Need("the anchor is outside of the kernel", _anchor_is_inside),
    ),
    ("dilate erode morphologyEx", Need("the work would not end", _work_ends)),
    ("pow", Need("the array is of integers and the power is no whole number", _power_fits)),
    ("pow", Need("the power is negative and an array of int32 has -2,147,483,648", _has_an_absolute_value)),
    ("imdecode", Need("the picture has more pixels than HFG_MOST_PICTURE_PIXELS, 134,217,728", _picture_is_fair)),
    ("convertMaps", Need("the maps have two sizes", _maps_are_alike)),
    ("drawChessboardCorners", Need("a board that was found has more or fewer corners", _corners_fill_the_board)),
    ("triangulatePoints", Need("the cameras do not see equally many points", _points_are_pairs)),
    ("HoughLinesP", Need("rho is more than the picture", _steps_are_in_the_picture)),
    ("minMaxLoc norm normalize", _ONE_SIZE),
    ("spatialGradient", Need("the picture is one pixel wide", _is_wide)),
    ("minEnclosingTriangle", Need("the points lie almost on a line", _points_are_no_line)),
    ("validateDisparity", Need("there are disparities outside of their range", _disparities_are_of_the_range)),
    ("eigenNonSymmetric", _finite("src")),
    ("filter2D", _finite("kernel")),
    ("invert SVDecomp", _finite("src")),
    ("findContours", Need("an image of int32 has a number that is not within 0 and 2 ** 29", _labels_are_few)),
    ("sepFilter2D", _finite("kernelX", "kernelY")),
)
NEEDS: Final[Mapping[str, tuple[Need, ...]]] = {
    name: tuple(need for names, need in _NEEDED if name in names.split())
    for names, _ in _NEEDED
    for name in names.split()
}
"""What OpenCV does not look at, found by placing each array before a page that nobody may touch."""
