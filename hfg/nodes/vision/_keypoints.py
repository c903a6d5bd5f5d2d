"""Keypoints, what describes them, and which of two pictures belong together."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import cv2
import numpy as np
import numpy.typing as npt
from annotated_types import Interval, Unit

from hfg.images import Mask, Picture
from hfg.nodes._pictures import gray, need_picture, refusal
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Input, Output, Parameter, State
from hfg.types import Named, Shape

Descriptors = Annotated[npt.NDArray[np.uint8 | np.float32], Shape(None, None), Named("Descriptors")]
Places = Annotated[npt.NDArray[np.float32], Shape(None, 2), Named("Places")]


class KeypointDetector(Node):
    """Find keypoints and describe them.

    Fires once per picture. A picture without keypoints gives empty ones.

    Attributes:
      method: how: ORB, AKAZE and BRISK describe by bits (uint8), SIFT and KAZE by real numbers (float32).
      most: how many keypoints at most, the strongest.
      image: the picture: gray, or in colour, which is made gray.
      mask: where to look; everywhere if nothing is connected.
      keypoints: OpenCV's keypoints.
      points: where they are, one row for each: x, y in pixels.
      descriptors: one row for each keypoint.

    Raises:
      TypeError: the picture or the mask is not of 8 bits.
      ValueError: the picture is empty or has two channels, or one row for AKAZE and KAZE; or the mask has another size.

    CS::APEX: csapex::ExtractKeypoints, csapex::ExtractDescriptors.
    """

    method = Parameter("ORB", type=Literal["ORB", "SIFT", "AKAZE", "BRISK", "KAZE"])
    most = Parameter(500, Interval(ge=1, le=100_000))
    image = Input(Picture)
    mask = Input(Mask | None, optional=True)
    keypoints = Output(list[cv2.KeyPoint])
    points = Output(Places)
    descriptors = Output(Descriptors)

    detector: State[Any] = State(None)
    made_of: State[Any] = State(None)

    def process(self, image: Picture, mask: Mask | None) -> None:
        """Find and describe."""
        need_picture(self, image)
        if mask is not None:
            need_picture(self, mask, Mask, "mask")
            if mask.shape[:2] != image.shape[:2]:
                raise ValueError(f"the mask is as large as the picture, {image.shape[:2]}, got one of {mask.shape[:2]}")
        if self.method in ("AKAZE", "KAZE") and image.shape[0] < 2:  # OpenCV reads and writes beyond its memory
            raise ValueError(f"{self.method} needs a picture of at least two rows, got one of one row")
        if self.made_of != (self.method, self.most):
            self.detector, self.made_of = self._make(), (self.method, self.most)
        try:
            found, described = self.detector.detectAndCompute(gray(image), mask)
        except cv2.error as error:
            raise refusal(f"OpenCV's {self.method}", error) from None
        order = sorted(range(len(found)), key=lambda place: -found[place].response)[: self.most]
        keypoints = [found[place] for place in order]
        kind = np.float32 if self.method in ("SIFT", "KAZE") else np.uint8
        self.keypoints.send(keypoints)
        self.points.send(np.array([one.pt for one in keypoints], np.float32).reshape(-1, 2))
        self.descriptors.send(np.zeros((0, 32), kind) if described is None else described[order])

    def _make(self) -> Any:
        match self.method:
            case "ORB":
                return cv2.ORB.create(self.most)
            case "SIFT":
                return cv2.SIFT.create(self.most)
            case "AKAZE":
                return cv2.AKAZE.create()
            case "KAZE":
                return cv2.KAZE.create()
            case _:
                return cv2.BRISK.create()


@node
def match_descriptors(
    first: Descriptors,
    second: Descriptors,
    *,
    ratio: Annotated[float, Interval(gt=0, le=1), Unit("1")] = 0.8,
) -> list[cv2.DMatch]:
    """Find which keypoints of two pictures belong together.

    Fires once per pair. A match is kept if the best is much nearer than the second best (Lowe's test).

    Args:
      first: descriptors of the first picture.
      second: descriptors of the second picture, of the same kind.
      ratio: how near the best must be, compared to the second best; 1 keeps all.

    Returns:
      out: the matches, the nearest first.

    Raises:
      ValueError: the descriptors are of different kinds.

    CS::APEX: csapex::MatchDescriptors.
    """
    if first.dtype != second.dtype or (len(first) and len(second) and first.shape[1] != second.shape[1]):
        raise ValueError(
            f"both descriptors are of one kind, got {first.dtype} x {first.shape[1]} and {second.dtype} x "
            f"{second.shape[1]}: take the same method for both pictures"
        )
    if not first.size or not second.size:
        return []
    matcher = cv2.BFMatcher(cv2.NORM_HAMMING if first.dtype == np.uint8 else cv2.NORM_L2)
    pairs = matcher.knnMatch(first, second, k=2)
    kept = [pair[0] for pair in pairs if len(pair) == 1 or (pair and pair[0].distance <= ratio * pair[1].distance)]
    return sorted(kept, key=lambda match: match.distance)
