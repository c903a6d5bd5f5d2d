"""Draws results for people to look at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Final

import cv2
from annotated_types import Interval, Unit

from hfg.base.values import Colour
from hfg.images import Color, Picture, wrong_image
from hfg.nodes._pictures import colour
from hfg.nodetypes.functions import node

__all__ = ["draw_boxes"]

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
    wrong = wrong_image(image, Picture)
    if wrong is not None:
        raise TypeError(f'input "image" of draw_boxes: {wrong}')
    if image.size == 0:
        raise ValueError('input "image" of draw_boxes is empty')
    drawn = colour(image).copy()
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
    return drawn  # type: ignore[no-any-return]
