"""The cube in the basket: which station its bar code names, whether there is one at all."""

from __future__ import annotations

from typing import Any, Final

import cv2
import numpy as np
from annotated_types import Interval

import hfg
from examples.fetch_delivery import signs
from examples.fetch_delivery.perception.records import Cube
from hfg.images import Gray, wrong_image

_CODES: Final = {signs.cube_code(station): station for station in range(1, 5)}
_LIGHTER: Final = (
    1.28  # paper than the basket, whose lightest parts are 1.16 times its median; in overexposed pictures 1.4
)
_WHITE: Final = 240  # gray levels: as light as paper, even if most of the picture is
_LEAST: Final = 0.015  # of the picture
_MARGIN: Final = 24  # pixels


@hfg.node
def read_cube(image: Gray) -> Cube:
    """Say what lies in the basket.

    A code counts if it is one of those that are printed on cubes, to the last digit, which is the check digit. White
    paper without such a code is a cube that cannot be read.

    Args:
      image: of the basket camera.

    Returns:
      out: no cube, one that cannot be read, or the number of a station.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty.
    """
    wrong = wrong_image(image, Gray)
    if wrong is not None:
        raise TypeError(f'input "image" of read_cube: {wrong}')
    if image.size == 0:
        raise ValueError('input "image" of read_cube is empty')
    picture = np.ascontiguousarray(image.reshape(image.shape[:2]))
    rough = (
        cv2.resize(picture, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA) if min(picture.shape) > 8 else picture
    )
    light = _paper(rough)
    if np.count_nonzero(light) < _LEAST * rough.size:
        return Cube("none")
    cut = _around(picture, light)
    read = _codes(cut) or _codes(cv2.GaussianBlur(cut, (3, 3), 0))  # where white is overexposed edges are ragged
    return Cube("number", _CODES[read.pop()]) if len(read) == 1 else Cube("unreadable")


def _paper(rough: Any) -> Any:
    """Say where white paper is, in dim and bright light: it is lighter than the basket, which fills most pictures."""
    light = (rough > min(_LIGHTER * float(np.median(rough)), _WHITE)).astype(np.uint8)
    return cv2.morphologyEx(light, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))  # single pixels are noise


def _around(picture: Any, light: Any) -> Any:
    """Cut out what is light, with a margin: to look for codes in all of the picture takes three times as long."""
    down, right = (round(whole / rough) for whole, rough in zip(picture.shape, light.shape, strict=True))
    x, y, width, height = cv2.boundingRect(light)
    top, left = max(0, down * y - _MARGIN), max(0, right * x - _MARGIN)
    cut = picture[top : down * (y + height) + _MARGIN, left : right * (x + width) + _MARGIN]
    return np.ascontiguousarray(cut)


def _codes(picture: Any) -> set[str]:
    return {text for text in _texts(picture) if text in _CODES}


def _texts(picture: Any) -> tuple[str, ...]:
    if min(picture.shape) <= 40:  # OpenCV looks at none that is smaller
        return ()
    try:
        found = cv2.barcode.BarcodeDetector().detectAndDecodeMulti(picture)
    except cv2.error:  # some pictures without any code make it fail
        return ()
    return tuple(found[1]) if found[0] else ()


class CubeWatch(hfg.Node):
    """Watch the basket, and tell what is in it once it was seen several times in a row.

    Fires once for each picture. An event comes when what is in the basket has changed, and stays changed; `ask` makes
    it come again.

    Attributes:
      times: so often in a row it has to be seen.
      doubtful: and so often a cube without a code: an operator sets right what lies askew.
      image: of the basket camera.
      cube: what this picture shows, right or wrong.
      number: a cube of this station lies in the basket.
      unreadable: a cube lies there, but its code cannot be read.
      none: no cube lies there.
      ask: report again what is there, after that number of new sightings.

    Raises:
      TypeError: the picture is not of 8 bits.
      ValueError: the picture is empty.
    """

    times = hfg.Parameter(2, Interval(ge=1, le=100))
    doubtful = hfg.Parameter(12, Interval(ge=1, le=100))
    image = hfg.Input(Gray)
    cube = hfg.Output(Cube)
    number = hfg.Event(int)
    unreadable = hfg.Event()
    none = hfg.Event()

    last: hfg.State[Any] = hfg.State(None)
    told: hfg.State[Any] = hfg.State(None)
    count = hfg.State(0)
    unread = hfg.State(0)  # pictures in a row, whatever was asked meanwhile

    def process(self, image: Gray) -> Cube:
        """Read, and tell what has become certain."""
        cube = read_cube.function(image)
        self.count = self.count + 1 if cube == self.last else 1
        self.last = cube
        self.unread = self.unread + 1 if cube.state == "unreadable" else 0
        certain = cube.state != "unreadable" or self.unread >= self.doubtful
        if self.count >= self.times and certain and cube != self.told:
            self.told = cube
            if cube.state == "number":
                self.number.trigger(cube.station)
            elif cube.state == "unreadable":
                self.unreadable.trigger()
            else:
                self.none.trigger()
        return cube

    @hfg.slot
    def ask(self) -> None:
        """Start over."""
        self.last, self.told, self.count = None, None, 0
