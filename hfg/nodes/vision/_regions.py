"""Regions of pictures: cut out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from annotated_types import Interval, Unit

from hfg.images import AnyImage
from hfg.nodetypes.functions import node

Box = tuple[int, int, int, int]
Pixels = Annotated[int, Interval(ge=-1_000_000, le=1_000_000), Unit("px")]
Side = Annotated[int, Interval(ge=1, le=1_000_000), Unit("px")]


def _cut(image: Any, box: Box) -> Any:
    """Return the part of a picture that lies in a box; None if there is none."""
    left, upper, width, height = box
    part = image[max(0, upper) : max(0, upper + height), max(0, left) : max(0, left + width)]
    return part.copy() if part.size else None


@node
def crop_image(
    image: AnyImage, *, left: Pixels = 0, upper: Pixels = 0, width: Side = 320, height: Side = 240
) -> AnyImage | None:
    """Crop a picture: cut out a region of interest (ROI).

    Fires once per picture. It is silent if the region lies outside of the picture.

    Args:
      image: of any kind.
      left: edge of the region.
      upper: edge of the region.
      width: of the region; what lies outside of the picture is left out.
      height: of the region; what lies outside of the picture is left out.

    Returns:
      out: the region, with the same kind of pixels.
    """
    part: AnyImage | None = _cut(image, (left, upper, width, height))
    return part


@node
def crop_boxes(
    image: AnyImage, boxes: Sequence[Box], *, margin: Annotated[int, Interval(ge=0, le=10_000), Unit("px")] = 0
) -> list[AnyImage]:
    """Cut the regions of boxes out of a picture, such as the faces or people that a detector has found.

    Fires once per picture with its boxes.

    Args:
      image: of any kind.
      boxes: left, upper edge, width, height in pixels.
      margin: by how much each box is made larger on each side.

    Returns:
      out: in the order of the boxes; boxes outside of the picture are left out, those beyond its edge cut off.
    """
    wider = [(left - margin, upper - margin, wide + 2 * margin, high + 2 * margin) for left, upper, wide, high in boxes]
    return [part for part in (_cut(image, box) for box in wider) if part is not None]
