"""Draws results for people to look at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Final, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
from annotated_types import Interval, Unit

from hfg.base.values import Colour
from hfg.images import Color, Picture, wrong_image
from hfg.nodes._pictures import colour
from hfg.nodetypes.functions import node

Box = tuple[int, int, int, int]
_FARTHEST: Final = 32767  # OpenCV draws with 16 bits before the point


@node
def draw_boxes(
    image: Picture,
    boxes: Sequence[Box],
    labels: Sequence[str] = (),
    *,
    color: Colour = Colour(0, 255, 0),
    thickness: Annotated[int, Interval(ge=1, le=64)] = 2,
    size: Annotated[float, Interval(ge=0.1, le=10), Unit("1")] = 0.5,
) -> Color:
    """Draw boxes around what was found, with words above them.

    Fires once per picture with its boxes, whether there are any or not. Parts beyond the picture are cut off.

    Args:
      image: the picture, which stays as it is: gray, or blue, green, red.
      boxes: left, upper edge, width, height in pixels.
      labels: what stands above each box, within the picture, in their order; further boxes have none. Letters beyond
        ASCII are drawn as "?".
      color: of boxes and words.
      thickness: of the lines, in pixels.
      size: of the words; 1 is about 22 pixels high.

    Returns:
      out: blue, green, red, of the size of the picture.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty or has two channels, or a box lies more than 32767 pixels away.

    CS::APEX: csapex::RenderROIs.
    """
    drawn = _copy(image, "draw_boxes")
    for number, (x, y, width, height) in enumerate(boxes):
        if max(abs(x), abs(y), abs(x + width), abs(y + height)) > _FARTHEST:
            raise ValueError(f"a box lies within {_FARTHEST} pixels, got {(x, y, width, height)}")
        cv2.rectangle(drawn, (x, y), (x + width - 1, y + height - 1), color.bgr, thickness)
        if number < len(labels):
            text = labels[number].encode("ascii", "replace").decode()
            pen = max(1, thickness // 2)
            (across, up), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, pen)
            place = (max(0, min(x, drawn.shape[1] - across)), max(y - 4 - thickness, up))
            cv2.putText(drawn, text, place, cv2.FONT_HERSHEY_SIMPLEX, size, color.bgr, pen, cv2.LINE_AA)
    return drawn


class Circles(NamedTuple):
    """A picture with circles, and their number."""

    out: Color
    found: int


@node(outputs=Circles)
def draw_circles(
    image: Picture,
    circles: npt.NDArray[Any],
    *,
    color: Colour = Colour(0, 255, 0),
    thickness: Annotated[int, Interval(ge=1, le=64)] = 2,
) -> Circles:
    """Draw circles around what was found, such as the coins that `hough_circles` finds, and count them.

    Fires once per picture with its circles. Parts beyond the picture are cut off.

    Args:
      image: the picture, which stays as it is: gray, or blue, green, red.
      circles: x, y and radius of each in pixels, in rows; further columns are left out.
      color: of the circles.
      thickness: of the lines, in pixels.

    Returns:
      out: blue, green, red, of the size of the picture.
      found: how many circles there are.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty or has two channels, or the circles are not rows of three numbers or more.
    """
    drawn = _copy(image, "draw_circles")
    if circles.ndim not in (2, 3) or circles.shape[-1] < 3:
        raise ValueError(
            'input "circles" of draw_circles has rows of x, y and radius, got an array of '
            + " x ".join(map(str, circles.shape))
        )
    rows = circles.reshape(-1, circles.shape[-1])[:, :3].astype(np.float64)
    shown = rows[np.isfinite(rows).all(axis=1) & (np.abs(rows) <= _FARTHEST).all(axis=1) & (rows[:, 2] >= 0)]
    for x, y, radius in np.rint(shown * 16).astype(int).tolist():
        cv2.circle(drawn, (x, y), radius, color.bgr, thickness, cv2.LINE_AA, 4)
    return Circles(drawn, len(rows))


def _copy(image: npt.NDArray[Any], name: str) -> npt.NDArray[np.uint8]:
    """Return a copy of a picture in colour, on which one can draw."""
    wrong = wrong_image(image, Picture)
    if wrong is not None:
        raise TypeError(f'input "image" of {name}: {wrong}')
    if image.size == 0:
        raise ValueError(f'input "image" of {name} is empty')
    copy: npt.NDArray[np.uint8] = colour(image).copy()
    return copy
