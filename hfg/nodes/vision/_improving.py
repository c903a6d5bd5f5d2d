"""Pictures made clearer."""

from __future__ import annotations

import cv2
from annotated_types import Interval

from hfg.images import Picture
from hfg.nodes._pictures import colour, gray, need_picture
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter


class EqualizeLocally(Node):
    """Spread the brightness of each region over the whole range (CLAHE).

    Fires once per picture. Of a picture in colour the lightness is spread and the colours are kept.

    Attributes:
      limit: how far the contrast may be raised.
      tiles: into how many regions width and height are parted.
      image: the picture: gray, or blue, green, red.
      out: of the same size; gray stays gray.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty, or has two channels.

    CS::APEX: csapex::Equalize.
    """

    limit = Parameter(2.0, Interval(gt=0, le=100), unit="1")
    tiles = Parameter(8, Interval(ge=1, le=64))
    image = Input(Picture)
    out = Output(Picture)

    def process(self, image: Picture) -> Picture:
        """Spread the brightness."""
        need_picture(self, image)
        spread = cv2.createCLAHE(self.limit, (self.tiles, self.tiles)).apply
        if image.ndim == 2 or image.shape[2] == 1:
            return spread(gray(image))  # type: ignore[no-any-return]
        lab = cv2.cvtColor(colour(image), cv2.COLOR_BGR2LAB)
        lab[:, :, 0] = spread(lab[:, :, 0].copy())
        return cv2.cvtColor(lab, cv2.COLOR_LAB2BGR)  # type: ignore[no-any-return]
