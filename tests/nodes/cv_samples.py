"""Ordinary values for the inputs of the generated OpenCV nodes, by their declared types."""

from __future__ import annotations

import typing
from typing import Any

import cv2
import numpy as np

from hfg.types import Named, array_facts

HEIGHT, WIDTH = 48, 64
GRID = np.array([[x, y] for y in range(8, 40, 8) for x in range(8, 56, 8)], np.float32)
"""Points of a picture."""


def picture(dtype: str, channels: int, seed: int = 0) -> Any:
    """A smooth picture with a few shapes; real numbers are 0 to 1, bool is a pattern."""
    drawn = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    cv2.rectangle(drawn, (6 + seed, 6), (30 + seed, 30), (200, 60, 90), -1)
    cv2.circle(drawn, (44, 26), 12, (30, 220, 160), -1)
    noise = np.random.default_rng(seed).integers(0, 25, drawn.shape, np.uint8)
    drawn = drawn + noise  # no sum is above 255
    planes = np.concatenate([drawn, drawn[:, :, :1]], axis=2)[:, :, :channels]
    if channels == 1:
        planes = planes[:, :, 0]
    kind = np.dtype(dtype)
    if kind.kind == "f":
        return (planes / 255).astype(kind)
    return np.ascontiguousarray(planes > 127 if kind == np.bool_ else planes.astype(kind))


PARAMETERS: dict[str, dict[str, Any]] = {
    "drawChessboardCorners": {"pattern_size": (6, 4)},
}
"""Values of parameters that belong to those samples, by OpenCV's names."""


def _turned(seed: int) -> Any:
    return cv2.Rodrigues(np.array([0.1 * seed, 0.05 - 0.2 * seed, 0.1 + 0.3 * seed * seed]))[0]


_BY_NAME: dict[str, Any] = {
    "Intrinsics": [[60, 0, 32], [0, 60, 24], [0, 0, 1]],
    "Matrix4x4": np.diag([1.0, 1, 60, 2]) + np.eye(4, k=1) * 0.1,
    "Matrix2x3": [[1, 0.1, 3], [-0.1, 1, 2]],
    "Matrix3x4": [[60, 0, 32, 1], [0, 60, 24, 2], [0, 0, 1, 0.5]],
    "Warp": [[1, 0, 0], [0, 1, 0]],
    "Vector3": [0.1, -0.2, 0.3],
    "Rotation": [0.1, -0.2, 0.3],
    "Homogeneous": [10.0, 12.0, 1.0],
    "Distortion": [0.01, -0.02, 0.001, 0.002],
    "ObjectPoints": np.column_stack([GRID, np.zeros(len(GRID))]),
    "ThreePoints": [[0, 0, 5], [1, 0, 6], [0, 1, 7]],
    "ThreeCorners": [[4, 4], [40, 5], [6, 38]],
    "FourCorners": [[4, 4], [40, 5], [6, 38], [44, 41]],
    "Contour": [[8, 8], [40, 9], [30, 20], [42, 36], [10, 34]],
    "Points": [[8, 8], [40, 9], [30, 20], [42, 36], [10, 34]],
    "Indices": [[0], [1], [3], [4]],
    "Matrix": np.random.default_rng(3).normal(size=(4, 4)),
    "Kernel": np.ones((3, 3)) / 9,
    "Element": np.ones((3, 3)),
    "PointRow": GRID[np.newaxis],
    "Coefficients": [[1.0, -3.0, 2.0, 0.5]],
    "Mixture": np.eye(3)[::-1],
    "Table": np.arange(255, -1, -1),
    "Numbers": [1.0, -3.0, 2.0, 0.5],
    "Samples": np.random.default_rng(4).normal(size=(20, 2)),
    "Histogram": np.arange(16.0)[:, np.newaxis],
    "Labels": np.pad(np.ones((HEIGHT - 20, WIDTH - 20)), 10),
    "PointSet": GRID[:, np.newaxis],
    "PointList": GRID[:, np.newaxis],
}


def sample(hint: Any, seed: int = 0, *, last: bool = False) -> Any:
    """An ordinary value of a type; an array has the first or the last dtype that is allowed."""
    if typing.get_origin(hint) in (typing.Union,) or type(hint).__name__ == "UnionType":
        hint = next(one for one in typing.get_args(hint) if one is not type(None))
    facts = array_facts(hint)
    if facts is None:
        return _plain(hint, seed, last)
    kind = np.dtype(facts.dtypes[-1 if last else 0])
    name = next((one.name for one in getattr(hint, "__metadata__", ()) if isinstance(one, Named)), "")
    if name in ("Corners", "ImagePoints"):
        return (GRID * (1 + 0.02 * seed) + seed).astype(kind)
    if name == "Bytes":
        return cv2.imencode(".png", picture("uint8", 3))[1]
    if name == "Matrix3x3":
        return _turned(seed).astype(kind)
    if name in _BY_NAME:
        return np.array(_BY_NAME[name]).astype(kind)
    counts = [1 if len(shape) == 2 else shape[2] for shape in facts.shapes]
    return picture(kind.name, counts[0] or 1, seed)


def _plain(hint: Any, seed: int, last: bool) -> Any:
    while typing.get_origin(hint) is typing.Annotated:
        hint = typing.get_args(hint)[0]
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is list and arguments[0] is cv2.KeyPoint:
        return [cv2.KeyPoint(float(x), float(y), 5.0) for x, y in GRID]
    if origin is list and arguments[0] is cv2.DMatch:
        return [cv2.DMatch(number, number, 0.5) for number in range(len(GRID))]
    if origin is list:
        if arguments[0] == list[cv2.DMatch]:
            return [[cv2.DMatch(number, number, 0.5)] for number in range(len(GRID))]
        return [sample(arguments[0], seed + number, last=last) for number in range(2 if last else 3)]
    if hint is float:
        return 0.3 + seed
    if hint == dict[str, float]:
        return cv2.moments(np.array(_BY_NAME["Contour"], np.int32))
    if hint == tuple[tuple[float, float], tuple[float, float], float]:
        return ((20.0 + seed, 18.0), (16.0, 10.0), 30.0)
    if origin is tuple:
        return tuple((10, 12, 20, 16)[: len(arguments)])
    raise LookupError(f"no sample of {hint}")
