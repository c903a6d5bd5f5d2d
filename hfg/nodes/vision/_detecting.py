"""Detectors: what they find are boxes, texts and corners."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import cv2
import numpy as np
import numpy.typing as npt
from annotated_types import Interval, Len

from hfg.images import Gray, Picture, Rows
from hfg.nodes._encodable import need_encodable
from hfg.nodes._pictures import colour, gray, need_picture, refusal
from hfg.nodes._structured import cascade_of, need_harmless
from hfg.nodes.files.access import read_whole
from hfg.nodetypes.functions import node
from hfg.nodetypes.node import Node
from hfg.ports import Event, Input, Output, Parameter, State
from hfg.types import Named

Box = tuple[int, int, int, int]
Corners = Annotated[npt.NDArray[np.float32], Rows(2), Named("Corners")]


def _boxes(found: Any) -> list[Box]:
    return [(int(x), int(y), int(width), int(height)) for x, y, width, height in found]


class PeopleDetector(Node):
    """Find people who stand or walk, by histograms of gradients and OpenCV's own support vector machine.

    Fires once per picture. People are found from 128 pixels of height on; `scale_up` makes smaller ones larger.

    Attributes:
      threshold: how sure it must be; higher finds fewer.
      stride: how many pixels lie between two places that are looked at.
      pyramid: how much smaller each further scale is.
      scale_up: by how much the picture is made larger first.
      image: the picture: gray, or blue, green, red.
      boxes: each a person: left, upper edge, width, height in pixels, the surest first.
      weights: how sure each is.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty, or has two channels.

    CS::APEX: csapex::HOGDetector.
    """

    threshold = Parameter(0.4, Interval(ge=0, le=10), unit="1")
    stride = Parameter(8, type=Literal[4, 8, 16])
    pyramid = Parameter(1.05, Interval(ge=1.01, le=2), unit="1")
    scale_up = Parameter(1.0, Interval(ge=0.25, le=4), unit="1")
    image = Input(Picture)
    boxes = Output(list[Box])
    weights = Output(list[float])

    detector: State[Any] = State(None)

    def setup(self) -> None:
        """Make the detector."""
        self.detector = cv2.HOGDescriptor()
        self.detector.setSVMDetector(cv2.HOGDescriptor.getDefaultPeopleDetector())

    def process(self, image: Picture) -> None:
        """Look for people."""
        need_picture(self, image)
        picture = colour(image)
        if self.scale_up != 1.0:
            picture = cv2.resize(picture, None, fx=self.scale_up, fy=self.scale_up)
        if picture.shape[0] < 128 or picture.shape[1] < 64:  # the window of the detector
            self.boxes.send([])
            self.weights.send([])
            return
        found, weights = self.detector.detectMultiScale(
            picture,
            hitThreshold=self.threshold,
            winStride=(self.stride, self.stride),
            padding=(8, 8),
            scale=self.pyramid,
        )
        order = np.argsort(-np.ravel(weights), kind="stable")
        self.boxes.send(_boxes(np.rint(np.reshape(found, (-1, 4))[order] / self.scale_up)))
        self.weights.send([float(np.ravel(weights)[place]) for place in order])


class CascadeDetector(Node):
    """Find objects by a cascade of classifiers (Viola and Jones): faces, eyes, bodies, or what a file describes.

    Fires once per picture.

    Attributes:
      cascade: one of those that OpenCV ships, "frontalface_default", or the path of an .xml file.
      scale: how much larger each further scale is.
      neighbors: how many overlapping finds make one.
      smallest: width and height of the smallest object, in pixels.
      image: the picture: gray, or in colour, which is made gray.
      boxes: left, upper edge, width, height in pixels.

    Raises:
      FileNotFoundError: there is no such cascade.
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty or has two channels, or the file is not a cascade.

    CS::APEX: csapex::VJDetector.
    """

    cascade = Parameter("frontalface_default")
    scale = Parameter(1.1, Interval(ge=1.01, le=2), unit="1")
    neighbors = Parameter(3, Interval(ge=0, le=100))
    smallest = Parameter(24, Interval(ge=1), unit="px")
    image = Input(Picture)
    boxes = Output(list[Box])

    detector: State[Any] = State(None)

    def setup(self) -> None:
        """Read the cascade."""
        shipped = Path(cv2.__file__).parent / "data"
        file = shipped / f"haarcascade_{self.cascade}.xml"
        is_shipped = file.is_file()
        if not is_shipped:
            file = Path(self.cascade)
        if not file.is_file():
            known = ", ".join(
                sorted(one.stem.removeprefix("haarcascade_") for one in shipped.glob("haarcascade_*.xml"))
            )
            raise FileNotFoundError(f'there is no cascade "{self.cascade}": name a file, or one of {known}')
        need_encodable("the path", str(file))
        if is_shipped:
            self.detector = cv2.CascadeClassifier(str(file))
            return
        data = read_whole(file)
        try:
            need_harmless("cascade", data)
            self.detector = cascade_of(data)
        except ValueError as error:
            raise ValueError(
                f'"{file}" is not a cascade ({error}): give an .xml file as opencv_traincascade writes it'
            ) from None

    def process(self, image: Picture) -> list[Box]:
        """Look for the objects."""
        need_picture(self, image)
        size = (self.smallest, self.smallest)
        return _boxes(self.detector.detectMultiScale(gray(image), self.scale, self.neighbors, minSize=size))


class BarcodeReader(Node):
    """Read bar codes (EAN-8, EAN-13, UPC) and QR codes.

    Fires once per picture; one without a code gives empty lists. `read` tells each code when it is seen first, and
    again when it was gone in between; with `republish` in every picture.

    Attributes:
      kinds: "bar", "qr" or "both".
      republish: tell `read` in every picture in which a code is seen.
      image: the picture: gray, or blue, green, red.
      texts: what the codes say.
      boxes: around each code: left, upper edge, width, height in pixels.
      corners: the four corners of each code.
      read: what a code says.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty, or has two channels.

    CS::APEX: csapex::BarCodeReader.
    """

    kinds = Parameter("both", type=Literal["both", "bar", "qr"])
    republish = Parameter(False)
    image = Input(Picture)
    texts = Output(list[str])
    boxes = Output(list[Box])
    corners = Output(list[Corners])
    read = Event(str)

    bar: State[Any] = State(None)
    qr: State[Any] = State(None)
    seen = State(frozenset[str]())

    def setup(self) -> None:
        """Make the detectors."""
        self.bar, self.qr = cv2.barcode.BarcodeDetector(), cv2.QRCodeDetectorAruco()  # reads turned ones more often

    def process(self, image: Picture) -> None:
        """Look for codes and read them."""
        need_picture(self, image)
        picture = gray(image)
        found: list[tuple[str, Any]] = []
        try:
            if self.kinds != "qr" and min(picture.shape) > 40:  # OpenCV looks at none that is smaller
                found += _codes(self.bar.detectAndDecodeMulti(picture))
            if self.kinds != "bar":
                found += _codes(self.qr.detectAndDecodeMulti(picture))
        except cv2.error as error:
            raise refusal("OpenCV's reader of codes", error) from None
        texts = [text for text, _ in found]
        for text in dict.fromkeys(texts):
            if self.republish or text not in self.seen:
                self.read.trigger(text)
        self.seen = frozenset(texts)
        self.texts.send(texts)
        self.boxes.send(_boxes(cv2.boundingRect(corners) for _, corners in found))
        self.corners.send([corners for _, corners in found])


def _codes(found: Any) -> list[tuple[str, Any]]:
    """Take those that could be read; OpenCV also gives places where a code may be."""
    _, texts, points, *_ = found
    if points is None or texts is None:
        return []
    return [
        (text, np.ascontiguousarray(corners, np.float32).reshape(-1, 2))
        for text, corners in zip(texts, points, strict=False)
        if text
    ]


class MarkerDetector(Node):
    """Find ArUco and AprilTag markers.

    Fires once per picture; one without a marker gives empty lists.

    Attributes:
      dictionary: which markers there are: "4X4_50", "5X5_100", "APRILTAG_36h11" ...
      image: the picture: gray, or blue, green, red.
      numbers: the number of each marker.
      corners: its four corners: upper left, upper right, lower right, lower left, as seen on the marker.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty, or has two channels.
    """

    dictionary = Parameter(
        "4X4_50",
        type=Literal[
            "4X4_50", "4X4_100", "4X4_250", "4X4_1000", "5X5_50", "5X5_100", "5X5_250", "5X5_1000", "6X6_50",
            "6X6_100", "6X6_250", "6X6_1000", "7X7_50", "7X7_100", "7X7_250", "7X7_1000", "ARUCO_ORIGINAL",
            "APRILTAG_16h5", "APRILTAG_25h9", "APRILTAG_36h10", "APRILTAG_36h11",
        ],
    )  # fmt: skip
    image = Input(Picture)
    numbers = Output(list[int])
    corners = Output(list[Corners])

    detector: State[Any] = State(None)

    def setup(self) -> None:
        """Make the detector."""
        known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{self.dictionary}"))
        self.detector = cv2.aruco.ArucoDetector(known)

    def process(self, image: Picture) -> None:
        """Look for markers."""
        need_picture(self, image)
        try:
            corners, numbers, _ = self.detector.detectMarkers(gray(image))
        except cv2.error as error:
            raise refusal("OpenCV's detector of markers", error) from None
        self.numbers.send([] if numbers is None else [int(number) for number in np.ravel(numbers)])
        self.corners.send([one.reshape(4, 2).astype(np.float32) for one in corners])


class ChessboardFinder(Node):
    """Find the inner corners of a chessboard, to a fraction of a pixel.

    Fires once per picture; one without a whole board is silence.

    Attributes:
      columns: inner corners from left to right.
      rows: inner corners from top to bottom.
      image: the picture: gray, or in colour, which is made gray.
      corners: row by row.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty, or has two channels.
    """

    columns = Parameter(9, Interval(ge=3, le=100))
    rows = Parameter(6, Interval(ge=3, le=100))
    image = Input(Picture)
    corners = Output(Corners)

    def process(self, image: Picture) -> Corners | None:
        """Look for the board."""
        need_picture(self, image)
        return chessboard(image, self.columns, self.rows)  # type: ignore[no-any-return]


def chessboard(image: Any, columns: int, rows: int) -> Any:
    """Return the corners of a chessboard, or None."""
    picture = gray(image)
    try:
        found, corners = cv2.findChessboardCorners(picture, (columns, rows))
        if not found:
            return None
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.01)
        return cv2.cornerSubPix(picture, corners, (5, 5), (-1, -1), criteria)
    except cv2.error as error:
        raise refusal("OpenCV's search for a chessboard", error) from None


@node
def qr_code(text: Annotated[str, Len(1, 1000)], *, scale: Annotated[int, Interval(ge=1, le=64)] = 4) -> Gray:
    """Draw a QR code with a white rim.

    Fires once for each text.

    Args:
      text: what the code says.
      scale: pixels for each dot.

    Returns:
      out: the picture; dots are black.

    Raises:
      ValueError: the text is empty, too long for a code, or has half of a character.
    """
    if not text:
        raise ValueError("a QR code needs a text, got an empty one")
    need_encodable("the text", text)
    try:
        dots = cv2.QRCodeEncoder.create().encode(text)
    except cv2.error as error:
        raise refusal("OpenCV's QR code", error) from None
    rim = cv2.copyMakeBorder(dots, 2, 2, 2, 2, cv2.BORDER_CONSTANT, value=255)
    return np.repeat(np.repeat(rim, scale, axis=0), scale, axis=1)
