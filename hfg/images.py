"""Types of images: number of channels and type of a pixel, checked when edges are drawn and on values.

Images are arrays as OpenCV has them: height x width, or height x width x channels, colours in the order blue, green,
red. The wrong type of pixel is dangerous: some functions of OpenCV end the whole process. So nodes that work on images
declare the type that they accept. Depends on `types`, not on OpenCV or nodes.

Examples:
  >>> from hfg.types import why_not
  >>> print(why_not(Depth, Gray))
  an array of float32 is not an array of uint8
  >>> print(wrong_image(np.zeros((480, 640)), Gray))
  expected Gray (an array of uint8, height x width), found an array of float64, 480 x 640
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Final, TypeAlias

import numpy as np
import numpy.typing as npt

from hfg.types import Named, Pixels, Shape, accepts, array_facts, describe, describe_value

__all__ = [
    "AnyImage",
    "Color",
    "ColorAlpha",
    "Depth",
    "DepthMillimetres",
    "Disparity",
    "FloatImage",
    "FlowField",
    "Gray",
    "Image",
    "Labels",
    "Mask",
    "Matrix",
    "OneOf",
    "Picture",
    "Points",
    "Rows",
    "describe_arrays",
    "wrong_image",
]


class Rows(Shape):
    """Metadata of a list of points: one row per point, or, as in OpenCV's results, one row of one column per point.

    Examples:
      >>> Rows(2).accepts((7, 2)), Rows(2).accepts((7, 1, 2)), Rows(2).accepts((7, 3))
      (True, True, False)
    """

    __slots__ = ()

    def __init__(self, *numbers: int) -> None:
        super().__init__(*numbers)

    def shapes(self) -> tuple[tuple[int | None, ...], ...]:
        """Return every allowed shape, `None` for an axis of any length."""
        return tuple(shape for count in self.axes for shape in ((None, count), (None, 1, count)))


class OneOf(Shape):
    """Metadata of an array of one of several shapes.

    Examples:
      >>> OneOf((3,), (3, 1)).accepts((3, 1)), OneOf((3,), (3, 1)).accepts((1, 3))
      (True, False)
    """

    __slots__ = ("allowed",)

    def __init__(self, *allowed: tuple[int | None, ...]) -> None:
        super().__init__()
        self.allowed = allowed

    def __eq__(self, other: object) -> bool:
        return isinstance(other, OneOf) and other.allowed == self.allowed

    def __hash__(self) -> int:
        return hash((OneOf, self.allowed))

    def __repr__(self) -> str:
        return f"OneOf({', '.join(map(str, self.allowed))})"

    def shapes(self) -> tuple[tuple[int | None, ...], ...]:
        """Return every allowed shape, `None` for an axis of any length."""
        return self.allowed


if TYPE_CHECKING:
    # Stubs such as OpenCV's only declare that a result is an array of numbers. So to a type checker an image is an
    # array of anything, and its pixels are checked when edges are drawn and on values.
    _Uint8: TypeAlias = npt.NDArray[Any]
    _Float32: TypeAlias = npt.NDArray[Any]
    _Uint16: TypeAlias = npt.NDArray[Any]
    _Int16: TypeAlias = npt.NDArray[Any]
    _Int32: TypeAlias = npt.NDArray[Any]
    _Coordinates: TypeAlias = npt.NDArray[Any]
    _Reals: TypeAlias = npt.NDArray[Any]
else:
    _Uint8 = npt.NDArray[np.uint8]
    _Float32 = npt.NDArray[np.float32]
    _Uint16 = npt.NDArray[np.uint16]
    _Int16 = npt.NDArray[np.int16]
    _Int32 = npt.NDArray[np.int32]
    _Coordinates = npt.NDArray[np.int32 | np.float32]
    _Reals = npt.NDArray[np.float32 | np.float64]

AnyImage: TypeAlias = Annotated[npt.NDArray[Any], Pixels(), Named("AnyImage")]
"""An image of any kind of pixel, with 1 to 4 channels."""

Image: TypeAlias = Annotated[_Uint8, Pixels(), Named("Image")]
"""An image of 8 bits, 0 to 255, with 1 to 4 channels: the type that cameras and files produce."""

Gray: TypeAlias = Annotated[_Uint8, Pixels(1), Named("Gray")]
"""An image of 8 bits and one channel."""

Color: TypeAlias = Annotated[_Uint8, Pixels(3), Named("Color")]
"""An image of 8 bits and three channels: blue, green, red, unless its maker says otherwise."""

ColorAlpha: TypeAlias = Annotated[_Uint8, Pixels(4), Named("ColorAlpha")]
"""An image of 8 bits and four channels: blue, green, red and opacity."""

Picture: TypeAlias = Annotated[_Uint8, Pixels(1, 3, 4), Named("Picture")]
"""An image of 8 bits that people can look at: gray, in colour, or with opacity."""

Mask: TypeAlias = Annotated[_Uint8, Pixels(1), Named("Mask")]
"""Selects pixels: 0 is out, anything else is in; written masks use 255. Any `Gray` image can be used."""

FloatImage: TypeAlias = Annotated[_Float32, Pixels(), Named("FloatImage")]
"""An image of real numbers with 1 to 4 channels; if a range is implied, it is 0 to 1."""

Depth: TypeAlias = Annotated[_Float32, Pixels(1), Named("Depth")]
"""Distance of each pixel in metres; 0 or NaN if unknown."""

DepthMillimetres: TypeAlias = Annotated[_Uint16, Pixels(1), Named("DepthMillimetres")]
"""Distance of each pixel in millimetres, as depth cameras send it; 0 if unknown."""

Disparity: TypeAlias = Annotated[_Int16, Pixels(1), Named("Disparity")]
"""How far each pixel moves from the left picture to the right one, in 1/16 pixel, as OpenCV computes it."""

Labels: TypeAlias = Annotated[_Int32, Pixels(1), Named("Labels")]
"""The number of the region that each pixel belongs to."""

FlowField: TypeAlias = Annotated[_Float32, Pixels(2), Named("FlowField")]
"""How far each pixel moves, in pixels: to the right, and down."""

Points: TypeAlias = Annotated[_Coordinates, Rows(2), Named("Points")]
"""Points of the plane, x and y in pixels: a contour, corners, a polygon."""

Matrix: TypeAlias = Annotated[_Reals, Shape(None, None), Named("Matrix")]
"""A matrix of real numbers."""

_LETTERS: Final = {2: "height x width", 3: "height x width x {}"}


def wrong_image(value: Any, hint: Any) -> str | None:
    """Return what an array type expects and what was found instead, or None if the value matches."""
    if accepts(value, hint):
        return None
    is_coloured = isinstance(value, np.ndarray) and accepts(value, Color) and accepts(value[..., 0], hint)
    remedy = '; read it with mode "gray", or put cvt_color in between' if is_coloured else ""
    return f"expected {describe(hint)} ({describe_arrays(hint)}), found {describe_value(value)}{remedy}"


def describe_arrays(hint: Any) -> str:
    """Return which arrays are of a type: dtypes and shapes in words.

    Examples:
      >>> print(describe_arrays(Points))
      an array of int32 or float32, any x 2, any x 1 x 2
    """
    facts = array_facts(hint)
    if facts is None:
        return describe(hint)
    dtypes = " or ".join(np.dtype(one).name for one in facts.dtypes) if len(facts.dtypes) < 9 else "numbers"
    return ", ".join(filter(None, [f"an array of {dtypes}", _shapes_in_words(hint, facts.shapes)]))


def _shapes_in_words(hint: Any, shapes: tuple[tuple[int | None, ...], ...]) -> str:
    if any(isinstance(item, Pixels) for item in getattr(hint, "__metadata__", ())):
        counts = sorted({shape[2] for shape in shapes if len(shape) == 3 and shape[2] is not None})
        if counts == [1]:
            return _LETTERS[2]
        channels = "1 to 4" if counts == [1, 2, 3, 4] else " or ".join(map(str, counts))
        long = _LETTERS[3].format(channels)
        return f"{_LETTERS[2]}, or {long}" if 1 in counts else long
    return ", ".join(" x ".join("any" if axis is None else str(axis) for axis in shape) for shape in shapes)
