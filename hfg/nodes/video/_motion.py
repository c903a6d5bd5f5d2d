"""Changes from picture to picture; each node remembers earlier pictures, and a reset makes it forget them."""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal

import cv2
import numpy as np
import numpy.typing as npt
from annotated_types import Interval

from hfg.images import FlowField, Image, Mask, Picture, Rows
from hfg.nodes._pictures import colour, need_picture, refusal
from hfg.nodes._pictures import gray as gray_of
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Output, Parameter, State, slot
from hfg.types import Named

_LEAST_OBJECT: Final = 32
"""Pixels: in one of fewer, OpenCV draws features at random, for ever if none has room (measured up to 16)."""

Tracked = Annotated[npt.NDArray[np.float32], Rows(2), Named("Corners")]


class BackgroundSubtractor(Node):
    """Find what moves in front of a background that is learned.

    Fires once per picture. The first pictures are all foreground or all background, depending on the method. A picture
    of another size makes it start over.

    Attributes:
      method: "MOG2", a mixture of Gaussians for each pixel, or "KNN", the nearest of the last values.
      history: how many pictures it learns from.
      threshold: how far a pixel may be from the background; squared. 16 is usual for MOG2, 400 for KNN.
      shadows: shadows are found too, and are 127 in the mask. It takes longer.
      learning_rate: how fast the background follows, 0 to 1; -1 lets OpenCV choose by `history`.
      image: the picture, of any number of channels.
      mask: 255 where something moves, 127 for shadows, else 0.
      background: the background as it is known now; silence while nothing is known.
      forget: learn the background from scratch.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty, or OpenCV refuses it.
    """

    method = Parameter("MOG2", type=Literal["MOG2", "KNN"])
    history = Parameter(500, Interval(ge=1, le=100_000))
    threshold = Parameter(16.0, Interval(gt=0), unit="of the pixel, squared")
    shadows = Parameter(False)
    learning_rate = Parameter(-1.0, Interval(ge=-1, le=1), unit="1")
    image = Input(Image)
    mask = Output(Mask)
    background = Output(Image)

    model: State[Any] = State(None)
    made_of: State[Any] = State(None)

    def process(self, image: Image) -> None:
        """Compare with the background, and learn."""
        need_picture(self, image, Image)
        made_of = (self.method, self.history, self.threshold, self.shadows, image.shape)
        if made_of != self.made_of:
            self.model, self.made_of = self._make(), made_of
        try:
            mask = self.model.apply(image, None, self.learning_rate)
            background = self.model.getBackgroundImage()
        except cv2.error as error:
            raise refusal(f"OpenCV's {self.method}", error) from None
        self.mask.send(mask)
        if background is not None and background.size:
            self.background.send(background)

    def _make(self) -> Any:
        if self.method == "MOG2":
            return cv2.createBackgroundSubtractorMOG2(self.history, self.threshold, self.shadows)
        return cv2.createBackgroundSubtractorKNN(self.history, self.threshold, self.shadows)

    @slot
    def forget(self) -> None:
        """Learn the background from scratch."""
        self.made_of = None


class FrameDifference(Node):
    """Find what changed since the last picture.

    Fires once per picture; the first one, and one of another size than the last, is silence.

    Attributes:
      threshold: by how much a pixel must have changed, 0 to 255.
      image: the picture: gray, or in colour, which is made gray.
      mask: 255 where it changed, else 0.
      share: the share of pixels that changed, 0 to 1.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty, or has two channels.
    """

    threshold = Parameter(25, Interval(ge=0, le=255))
    image = Input(Picture)
    mask = Output(Mask)
    share = Output(float)

    last: State[Any] = State(None)

    def process(self, image: Picture) -> None:
        """Compare with the last picture."""
        need_picture(self, image)
        gray, last = gray_of(image), self.last
        self.last = gray
        if last is not None and last.shape == gray.shape:
            _, mask = cv2.threshold(cv2.absdiff(gray, last), self.threshold, 255, cv2.THRESH_BINARY)
            self.mask.send(mask)
            self.share.send(cv2.countNonZero(mask) / mask.size)


class RunningMean(Node):
    """Send the mean of the pictures so far, in which older ones count less and less.

    Fires once per picture; the first one, and one of another shape than the last, begins the mean.

    Attributes:
      weight: how much the new picture counts, 0 to 1.
      image: the picture, of any number of channels.
      mean: the mean, of the same kind.
      forget: starts over with the next picture.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty.

    CS::APEX: csapex::SequenceMean.
    """

    weight = Parameter(0.1, Interval(gt=0, le=1), unit="1")
    image = Input(Image)
    mean = Output(Image)

    total: State[Any] = State(None)

    def process(self, image: Image) -> Image:
        """Take the picture into the mean."""
        need_picture(self, image, Image)
        if self.total is None or self.total.shape != image.shape:
            self.total = image.astype(np.float32)
        else:
            cv2.accumulateWeighted(image, self.total, self.weight)
        return np.clip(np.rint(self.total), 0, 255).astype(np.uint8).reshape(image.shape)  # type: ignore[no-any-return]

    @slot
    def forget(self) -> None:
        """Start over with the next picture."""
        self.total = None


class OpticalFlow(Node):
    """Find how far each pixel moved since the last picture (dense inverse search).

    Fires once per picture; the first one, and one of another size than the last, is silence.

    Attributes:
      quality: "ultrafast", "fast" or "medium".
      image: the picture: gray, or in colour, which is made gray; at least 16 pixels wide and high.
      flow: for each pixel how far it moved to the right and down.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is too small, or has two channels.
    """

    quality = Parameter("fast", type=Literal["ultrafast", "fast", "medium"])
    image = Input(Picture)
    flow = Output(FlowField)

    last: State[Any] = State(None)

    def process(self, image: Picture) -> FlowField | None:
        """Compare with the last picture."""
        need_picture(self, image)
        if min(image.shape[:2]) < 16:
            raise ValueError(f"a picture is at least 16 pixels wide and high for optical flow, got {image.shape}")
        gray, last = gray_of(image), self.last
        self.last = gray
        if last is None or last.shape != gray.shape:
            return None
        preset = {"ultrafast": 0, "fast": 1, "medium": 2}[self.quality]
        return cv2.DISOpticalFlow.create(preset).calc(last, gray, None)  # type: ignore[call-overload,no-any-return]


class PointTracker(Node):
    """Follow points from picture to picture (Lucas-Kanade).

    Fires once per picture. Points are looked for in the first picture and whenever fewer than `least` are left.

    Attributes:
      most: how many points are followed.
      least: with fewer than this new ones are looked for.
      distance: how far points are from each other at least, in pixels.
      window: width and height of what is compared around a point, in pixels.
      image: the picture: gray, or in colour, which is made gray.
      points: where the points are now.
      before: where those points were in the last picture; equal to `points` where they were just found.
      forget: look for new points.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty, or has two channels.

    CS::APEX: csapex::LKTracking.
    """

    most = Parameter(100, Interval(ge=1, le=10_000))
    least = Parameter(10, Interval(ge=0))
    distance = Parameter(8.0, Interval(ge=1, le=32767), unit="px")
    window = Parameter(21, Interval(ge=3, le=101))
    image = Input(Picture)
    points = Output(Tracked)
    before = Output(Tracked)

    last: State[Any] = State(None)
    kept: State[Any] = State(None)

    def process(self, image: Picture) -> None:
        """Follow the points."""
        need_picture(self, image)
        gray, last, old = gray_of(image), self.last, self.kept
        self.last = gray
        now, before = _nothing(), _nothing()
        if old is not None and len(old) and last is not None and last.shape == gray.shape:
            size = (self.window, self.window)
            moved, status, _ = cv2.calcOpticalFlowPyrLK(last, gray, old, None, winSize=size)  # type: ignore[call-overload]
            height, width = gray.shape
            inside = (
                (moved[:, 0, 0] >= 0) & (moved[:, 0, 1] >= 0) & (moved[:, 0, 0] < width) & (moved[:, 0, 1] < height)
            )
            found = (status.ravel() == 1) & inside
            now, before = moved[found], old[found]
        if len(now) < max(1, self.least):
            fresh = cv2.goodFeaturesToTrack(gray, self.most, 0.01, self.distance)
            now = before = _nothing() if fresh is None else fresh
        self.kept = now
        self.points.send(now.copy())
        self.before.send(before.copy())

    @slot
    def forget(self) -> None:
        """Look for new points."""
        self.kept = None


def _nothing() -> Any:
    return np.zeros((0, 1, 2), np.float32)


class ObjectTracker(Node):
    """Follow an object from picture to picture (multiple instance learning).

    Fires once per picture; it is silent until `start` has said where the object is. Then the picture that comes next is
    the one in which it is there.

    Attributes:
      image: the picture: blue, green, red.
      box: where the object is: left, upper edge, width, height in pixels.
      start: left, upper edge, width, height of the object, in pixels.
      stop: follow nothing any more.
      lost: the object is not found any more; the search continues.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty, or the object does not lie in it or has fewer than 32 pixels.
    """

    image = Input(Picture)
    box = Output(tuple[int, int, int, int])
    lost = Event()

    begin: State[Any] = State(None)
    tracker: State[Any] = State(None)

    @slot
    def start(self, box: tuple[int, int, int, int]) -> None:
        """Follow what is there in the next picture."""
        self.begin, self.tracker = tuple(box), None

    @slot
    def stop(self) -> None:
        """Follow nothing any more."""
        self.begin = self.tracker = None

    def process(self, image: Picture) -> tuple[int, int, int, int] | None:
        """Look where the object is now."""
        need_picture(self, image)
        if self.begin is not None:
            x, y, width, height = self.begin
            if x < 0 or y < 0 or width < 2 or height < 2 or x + width > image.shape[1] or y + height > image.shape[0]:
                raise ValueError(f"the object {self.begin} does not lie in a picture of {image.shape}")
            if width * height < _LEAST_OBJECT:
                raise ValueError(f"the object {self.begin} has {width * height} pixels; it needs {_LEAST_OBJECT}")
            self.tracker, self.begin = cv2.TrackerMIL.create(), None
            self.tracker.init(colour(image), (x, y, width, height))
            return x, y, width, height
        if self.tracker is None:
            return None
        found, box = self.tracker.update(colour(image))
        if not found:
            self.lost.trigger()
            return None
        return int(box[0]), int(box[1]), int(box[2]), int(box[3])
