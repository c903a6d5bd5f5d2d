"""How far things are: two cameras, and what must be known of one."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import cv2
import msgspec
import numpy as np
import numpy.typing as npt
from annotated_types import Interval, MultipleOf

from hfg.images import Disparity, Picture, Rows
from hfg.nodes._pictures import gray, need_picture, refusal
from hfg.nodes.vision._detecting import chessboard
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Output, Parameter, State, slot
from hfg.types import Named

Corners = Annotated[npt.NDArray[np.float32], Rows(2), Named("Corners")]


class StereoDepth(Node):
    """Find how far each pixel moves from the left picture to the right one; near things move farther.

    Fires once for each pair of pictures, whose rows must belong together (rectified).

    Attributes:
      method: "SGBM" looks at neighbors too, "BM" is faster.
      smallest: the smallest disparity, in pixels.
      range: how many disparities are tried, a multiple of 16.
      block: width and height of what is compared, in pixels; odd.
      left: the picture of the left camera: gray, or in colour, which is made gray.
      right: the picture of the right camera, of the same size.
      disparity: in sixteenths of a pixel; below 16 times `smallest` where nothing was found, as in
        pictures that are too small for the range.

    Raises:
      TypeError: a picture is not of 8 bits.
      ValueError: the pictures differ in size or are empty.
    """

    method = Parameter("SGBM", type=Literal["SGBM", "BM"])
    smallest = Parameter(0, Interval(ge=-1024, le=1024), unit="px")
    range = Parameter(64, Interval(ge=16, le=1024), MultipleOf(16), unit="px")
    block = Parameter(5, type=Literal[3, 5, 7, 9, 11, 13, 15, 17, 19, 21])
    left = Input(Picture)
    right = Input(Picture)
    disparity = Output(Disparity)

    def process(self, left: Picture, right: Picture) -> Disparity:
        """Compare the pictures."""
        need_picture(self, left, port="left")
        need_picture(self, right, port="right")
        first, second = gray(left), gray(right)
        if first.shape != second.shape:
            raise ValueError(f"both pictures are of one size, got {first.shape} and {second.shape}")
        if first.shape[1] <= self.range + abs(self.smallest) + self.block or first.shape[0] <= self.block:
            return np.full(first.shape, 16 * (self.smallest - 1), np.int16)  # too small to find anything in
        try:
            if self.method == "BM":
                matcher: Any = cv2.StereoBM.create(self.range, max(5, self.block))
                matcher.setMinDisparity(self.smallest)
            else:
                area = self.block * self.block
                matcher = cv2.StereoSGBM.create(
                    self.smallest, self.range, self.block, 8 * area, 32 * area, 1, 63, 10, 100, 2
                )
            return matcher.compute(first, second)  # type: ignore[no-any-return]
        except cv2.error as error:
            raise refusal(f"OpenCV's {self.method}", error) from None


class Calibration(msgspec.Struct, frozen=True):
    """What is known of a camera.

    Attributes:
      error: how far corners lie from where they should, in pixels, root of the mean square.
      matrix: focal lengths and centre, 3 x 3, row by row, in pixels.
      distortion: k1, k2, p1, p2, k3.
      size: width and height of the pictures.
    """

    error: float
    matrix: list[list[float]]
    distortion: list[float]
    size: tuple[int, int]


class CameraCalibration(Node):
    """Calibrate a camera by pictures of a chessboard.

    Fires once per picture and keeps the corners that it finds; `calibrate` computes what `calibrated` tells.

    Attributes:
      columns: inner corners of the board from left to right.
      rows: inner corners from top to bottom.
      square: the side of a square, in metres.
      image: the picture: gray, or in colour, which is made gray.
      corners: the corners found; silence if there are none.
      accepted: in how many pictures a board was found.
      rejected: in how many there was none.
      calibrate: compute; it needs three boards at least.
      forget: throw the boards away.
      calibrated: what is known of the camera.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty, of another size than the first or has two channels; or there are too few boards.

    CS::APEX: csapex::CameraCalibration.
    """

    columns = Parameter(9, Interval(ge=3, le=100))
    rows = Parameter(6, Interval(ge=3, le=100))
    square = Parameter(0.025, Interval(gt=0), unit="m")
    image = Input(Picture)
    corners = Output(Corners)
    accepted = Output(int)
    rejected = Output(int)
    calibrated = Event(Calibration)

    boards = State(factory=list[Any])
    misses = State(0)
    size: State[tuple[int, int] | None] = State(None)

    def process(self, image: Picture) -> None:
        """Look for the board and keep its corners."""
        need_picture(self, image)
        size = (image.shape[1], image.shape[0])
        if self.size not in (None, size):
            raise ValueError(f"all pictures come from one camera, of {self.size} pixels, got one of {size}")
        self.size = size
        corners = chessboard(image, self.columns, self.rows)
        if corners is None:
            self.misses += 1
        else:
            self.boards.append(corners)
            self.corners.send(corners)
        self.accepted.send(len(self.boards))
        self.rejected.send(self.misses)

    @slot
    def calibrate(self) -> None:
        """Compute what is known of the camera."""
        if len(self.boards) < 3 or self.size is None:
            raise ValueError(f"a calibration needs the board in three pictures at least, got {len(self.boards)}")
        board = np.zeros((self.rows * self.columns, 3), np.float32)
        board[:, :2] = np.mgrid[0 : self.columns, 0 : self.rows].T.reshape(-1, 2) * self.square
        boards = [board] * len(self.boards)
        try:
            error, matrix, distortion, *_ = cv2.calibrateCamera(boards, self.boards, self.size, None, None)
        except cv2.error as problem:
            raise refusal("OpenCV's calibration", problem) from None
        self.calibrated.trigger(Calibration(float(error), matrix.tolist(), np.ravel(distortion).tolist(), self.size))

    @slot
    def forget(self) -> None:
        """Throw the boards away."""
        self.boards, self.misses, self.size = [], 0, None
