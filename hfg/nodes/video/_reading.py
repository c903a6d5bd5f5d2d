"""Sources that read video files and cameras.

OpenCV blocks while it decodes and while it waits for a camera, so it works in a thread. Releasing the capture waits for
that thread, because OpenCV ends the process if a capture is released during a read.
"""

from __future__ import annotations

import asyncio
import glob
import re
import threading
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, Literal

import cv2
from annotated_types import Ge, Gt

from hfg.base.clock import now
from hfg.encoding.pictures import need_fair_size, pixels_problem
from hfg.errors import EndOfStream
from hfg.images import Image
from hfg.nodes._encodable import need_encodable
from hfg.nodes.files.access import find_files
from hfg.nodetypes.node import Node
from hfg.ports import Output, Parameter, State


class _Capture:
    """An open video or camera that one thread at a time reads."""

    def __init__(self, source: str | int) -> None:
        need_encodable("the path", source)
        self._lock = threading.Lock()
        self._capture = cv2.VideoCapture(source)
        self._open = self._capture.isOpened()

    @property
    def is_open(self) -> bool:
        return self._open

    def get(self, what: int) -> float:
        with self._lock:
            return float(self._capture.get(what)) if self._open else 0.0

    def set(self, what: int, value: float) -> None:
        with self._lock:
            if self._open:
                self._capture.set(what, value)

    def read(self) -> Any:
        """Return the next picture, or None after the last one."""
        with self._lock:
            if not self._open:
                return None
            read, image = self._capture.read()
            return image if read else None

    def skip(self) -> bool:
        """Go one picture on without decoding it."""
        with self._lock:
            return self._open and self._capture.grab()

    def close(self) -> None:
        with self._lock:
            self._open = False
            self._capture.release()


_SIDES: Final = (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
_HEADER: Final = 2**16


def _need_fair_pictures(pattern: str) -> None:
    """Look at the pictures that a pattern like "pictures/%04d.png" names: OpenCV decodes them whole, whatever they are.

    Raises:
      ValueError: one is too large.
    """
    parts = re.split(r"%0?\d*d", pattern)
    found: list[Path] = []
    with suppress(FileNotFoundError):  # which OpenCV says as well
        found = find_files("*".join(map(glob.escape, parts)), "name")
    for path in found:
        with path.open("rb") as file:
            need_fair_size(file.read(_HEADER), f'"{path}"')


class VideoFile(Node):
    """Read a video file, picture by picture.

    A source. With rate "file" a picture leaves when its time has come since the first one left, as the file says; a
    consumer that is too slow delays it, and nothing is left out. With "fast" pictures leave as fast as they are taken.
    The stamp of a picture is its time in the video, in seconds; it keeps counting in each round of a loop. After the
    last picture the stream ends. A running node that is reset starts over.

    Attributes:
      path: the file; anything that FFmpeg reads, or a pattern as in "pictures/%04d.png".
      rate: "file" or "fast".
      start: the number of the first picture, from 0.
      end_before: the number of the picture before which it stops; None for the whole video.
      loop: start over after the last picture, endlessly.
      image: the picture: blue, green, red.
      number: the number of the picture in the file, from 0.

    Raises:
      FileNotFoundError: there is no such file.
      ValueError: OpenCV cannot read the file as a video, a picture has more pixels than are allowed, or the video is
        over before `start`.
    """

    path = Parameter("", pattern="*")
    rate = Parameter("file", type=Literal["file", "fast"])
    start = Parameter(0, Ge(0))
    end_before = Parameter(None, type=int | None)
    loop = Parameter(False)
    image = Output(Image)
    number = Output(int)

    capture: State[_Capture | None] = State(None)
    position = State(0)
    sent = State(0)
    begun: State[float | None] = State(None)
    frame_s = State(1 / 25)

    def setup(self) -> None:
        """Open the file and go to the first picture."""
        if not self.path:
            raise FileNotFoundError('no video is named: set path, as in VideoFile(path="people.avi")')
        if "%" not in self.path and not Path(self.path).is_file():
            raise FileNotFoundError(f'there is no video "{self.path}": correct path, or put the file there')
        self._open()

    def _open(self) -> None:
        self._close()
        if "%" in self.path:
            _need_fair_pictures(self.path)
        capture = self.capture = _Capture(self.path)
        if not capture.is_open:
            raise ValueError(
                f'"{self.path}" cannot be read as a video: it is damaged, or of a kind that this OpenCV does not know'
            )
        problem = pixels_problem(*(int(capture.get(side)) for side in _SIDES))
        if problem is not None:
            self._close()
            raise ValueError(f'"{self.path}" {problem}')
        rate = capture.get(cv2.CAP_PROP_FPS)
        self.frame_s = 1 / rate if 0 < rate < 10_000 else 1 / 25  # a sequence of pictures has no rate
        self.position = 0
        while self.position < self.start:  # to jump would land on the nearest key frame in many kinds of files
            if not capture.skip():
                raise ValueError(f'"{self.path}" has {self.position} pictures, so none has the number {self.start}')
            self.position += 1

    async def process(self) -> None:
        """Send the next picture when its time has come."""
        image = await self._next()
        due = self.sent * self.frame_s
        if self.rate == "file":
            if self.begun is None:
                self.begun = now()
            await asyncio.sleep(max(0.0, self.begun + due - now()))
        self.image.send(image, stamp=due + self.start * self.frame_s)
        self.number.send(self.position, stamp=due + self.start * self.frame_s)
        self.position += 1
        self.sent += 1

    async def _next(self) -> Any:
        for _ in range(2):
            assert self.capture is not None
            over = self.end_before is not None and self.position >= self.end_before
            image = None if over else await asyncio.to_thread(self.capture.read)
            if image is not None:
                return image
            if not self.loop or self.sent == 0:
                break
            await asyncio.to_thread(self._open)
        raise EndOfStream

    def teardown(self) -> None:
        """Close the file."""
        self._close()

    def _close(self) -> None:
        if self.capture is not None:
            self.capture.close()


class Camera(Node):
    """Read pictures from a camera.

    A source. It waits for the next picture of the camera and sends it; a consumer that is too slow gets older pictures
    unless the camera keeps only one (`buffer`). Connect `camera.image.sent` with `overflow="latest"` to leave pictures
    out instead. The stamp is the time at which the picture was there.

    Attributes:
      device: the number of the camera, from 0, or its path or address: "/dev/video2", "rtsp://...".
      width: in pixels; 0 for what the camera has. A camera takes what is next to it.
      height: in pixels; 0 for what the camera has.
      fps: pictures per second; 0 for what the camera has.
      buffer: how many pictures wait in the driver.
      image: the picture: blue, green, red.

    Raises:
      OSError: there is no such camera, or it gives no more pictures.
      ValueError: the path of the camera has half of a character.

    CS::APEX: csapex::Camera.
    """

    device = Parameter(0, type=int | str)
    width = Parameter(0, Ge(0), unit="px")
    height = Parameter(0, Ge(0), unit="px")
    fps = Parameter(0.0, Ge(0.0), unit="1/s")
    buffer = Parameter(1, Gt(0))
    image = Output(Image)

    capture: State[_Capture | None] = State(None)

    def setup(self) -> None:
        """Open the camera."""
        device = int(self.device) if str(self.device).isdecimal() else self.device
        if isinstance(device, int) and device < 0:  # OpenCV would end the process
            raise OSError(f"there is no camera {device}: cameras are counted from 0")
        capture = self.capture = _Capture(device)
        if not capture.is_open:
            raise OSError(f"there is no camera {self.device!r}, or another program uses it: correct device")
        wanted = (
            (cv2.CAP_PROP_FRAME_WIDTH, self.width),
            (cv2.CAP_PROP_FRAME_HEIGHT, self.height),
            (cv2.CAP_PROP_FPS, self.fps),
            (cv2.CAP_PROP_BUFFERSIZE, self.buffer),
        )
        for what, value in wanted:
            if value:
                capture.set(what, value)

    async def process(self) -> None:
        """Send the next picture."""
        assert self.capture is not None
        image = await asyncio.to_thread(self.capture.read)
        if image is None:
            raise OSError(f"camera {self.device!r} gives no more pictures: is it still connected?")
        self.image.send(image, stamp=now())

    def teardown(self) -> None:
        """Let the camera go."""
        if self.capture is not None:
            self.capture.close()
